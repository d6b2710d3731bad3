"""Steps of a pass, which solve, estimate, relocate and polish."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.movable import Work
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.loop.directions import wanted_of
from kohonen_adapt.loop.functional_of_pass import FROZEN, FunctionalOfPass, differs_on, functional_of
from kohonen_adapt.loop.growth import drift_of_nodes
from kohonen_adapt.loop.method import Method
from kohonen_adapt.loop.passes import Pass, Steps, text_of
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.sides import Sides
from kohonen_adapt.mesh.host import count_unknowns, number_facets
from kohonen_adapt.mesh.measures import area, quality
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.held_nodes import counted
from kohonen_adapt.polishing.polish import PLAN, SWEEPS, descend_and_recycle
from kohonen_adapt.problem.evaluation import (
    check_signs,
    energy_norm,
    estimate,
    goal_error_of,
    goal_of,
    output_value,
    solve_again,
)
from kohonen_adapt.problem.protocol import CheckedProblem, NotOffered
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.uncertain import Uncertain, doubts_of, error_of, shifted
from kohonen_adapt.som.relocation_record import Moved

__all__ = ["UNSOLVED", "Adaptation", "Solved", "root_of_squares"]

GROWING_ENTRIES = 2  # entries of the plan of a polish, because nodes added later undo the effect of further entries

TWICE = 1.8  # factor of the unknowns from which the difference of two passes bounds the error of an output

UNSOLVED = object()  # replaces the solution of a pass of an earlier process


@dataclass(frozen=True)
class Solved:
    """Pass with the data from which the next pass starts.

    Attributes
    ----------
    record
        The pass.
    solution
        Solution returned by the problem, or `UNSOLVED` for a pass of an earlier process.
    functional
        Functional for the polish, or None.
    movable
        Copy of the movable mesh.
    """

    record: Pass
    solution: Any
    functional: Functional | None
    movable: MovableMesh | MovableSolid

    @property
    def curved(self) -> MovableMesh | None:
        return curved_of(self.movable)


@dataclass(frozen=True)
class Adaptation:
    """Mesh and problem of a run, with the steps of a pass.

    Attributes
    ----------
    problem
        Problem to solve.
    method
        Methods for the dimension of the mesh.
    movable
        Current mesh, changed by `relocate` and `polish`.
    settings
        Settings of the run.
    steps
        Timer of the steps, with the index of the pass in progress.
    order
        Degree of the elements, read from the problem once.
    """

    problem: CheckedProblem
    method: Method
    movable: MovableMesh | MovableSolid
    settings: Settings
    steps: Steps
    order: int

    def plan(self, functional: Functional) -> tuple[int, ...]:
        recycles = self.settings.rules.topology == "recycle" and not functional.ritz.shapes_only
        plan = PLAN if recycles else (SWEEPS,)
        return plan[:GROWING_ENTRIES] if self.settings.growth.grows_after(self.steps.number) else plan

    def assess(self, before: Solved | None = None, moved: Moved[Any] | None = None, polish_gain: float = 0.0) -> Solved:
        mesh = self.movable.mesh() if before else self.movable.start()
        with self.steps("solve"):
            number_facets(mesh)  # faster than scikit-fem, which numbers them otherwise in the solver
            solution = self.problem.solve(mesh, *((before.record.mesh, before.solution) if before else ()))
        with self.steps("estimate"):
            movable = self.movable.copy()
            sides = Sides(self.problem, mesh, solution, curved_of(movable))
            figures = self.figures(sides, self.order, movable.cut_off())
            share = before.functional.share if before and before.functional else None
            found = self._functional(mesh, solution, share)
            functional = found.functional
        incomparable = self.incomparable(before, functional, mesh)
        figures["worth"] = float(np.hypot(figures["worth"], found.oscillation))
        outputs = self.figures_of_outputs(sides, figures, before.record if before else None)
        record = Pass(
            **vars(moved.work(self.movable, polish_gain) if moved else Work()),
            **figures,
            **outputs,
            number=self.steps.number,
            mesh=mesh,
            nodes=indices_in_input(before, moved, self.movable.nnodes, self.settings.growth.start),
            functional=found.value,
            comparable=functional is not None and not incomparable,
            incomparable=incomparable,
            share=functional.share if functional else None,
            unpolished=found.unpolished,
            sagitta=self.movable.sagitta(),
            seconds=self.steps.seconds,  # last, because outputs add their time
            compile_seconds=self.steps.compile_seconds,
        )
        return Solved(record, solution, functional, movable)

    def incomparable(self, before: Solved | None, functional: Any, mesh: Mesh) -> str:
        # reason for which functionals do not compare passes
        if functional is None:
            return ""
        if not functional.ritz.comparable:
            return "its functional depends on the solution (`comparable=False` of `Ritz`)"
        old = before.functional if before and functional.share is None else None
        if before and old and differs_on(mesh, functional.ritz, old.ritz, before.record):
            return FROZEN
        return "" if functional.comparable else counted(self.method.polish_reasons(self.movable, functional))

    def figures(self, sides: Sides, order: int, cut_off: float = 0.0, has_all_errors: bool = False) -> dict[str, Any]:
        # Fields of a `Pass`. `cut_off` is the area or volume between elements and their curved parts.
        problem, mesh, solution, tolerance = sides.problem, sides.mesh, sides.solution, self.settings.tolerance
        indicators = estimate(problem, mesh, solution)
        norm, goal = energy_norm(problem, mesh, solution, tolerance.rtol), goal_of(problem, solution)
        total, length, size, qualities = root_of_squares(indicators), 1.0, area(mesh), quality(mesh)
        if problem.norm != "energy":
            length = size ** (1 / mesh.dim())
        if goal is None and total <= (tolerance.of_energy(norm) or 0.0):
            total = sides.error_with_sides(total, self.settings.rules.curves)
        wants_error = tolerance.goal_rtol is not None or (has_all_errors and goal is not None)
        return {
            "indicators": indicators,
            "order": int(order),
            "unknowns": count_unknowns(mesh, order),
            "min_quality": float(qualities.min()),
            "mean_quality": float(qualities.mean()),
            "estimate": total,
            "worth": root_of_squares(length * indicators) * math.sqrt(1.0 + cut_off / float(size.sum())),
            "energy_norm": norm,
            "calibrated": problem.calibrated,
            "goal": goal,
            "goal_error": goal_error(sides) if wants_error else None,
            "goal_unit": "" if goal is None else problem.goal_unit,
        }

    def figures_of_outputs(
        self, sides: Sides, figures: Mapping[str, Any], before: Pass | None, has_errors: bool = False
    ) -> dict[str, Any]:
        # fields of a `Pass`
        outputs, errors, unimproved = self.outputs(sides.solution), dict[str, float](), ""
        if has_errors or self.settings.tolerance.output_rtol is not None:
            errors, unimproved = self.output_errors(sides, outputs, figures["unknowns"], before)
        doubts = doubts_of({**errors, "goal": figures["goal_error"]})
        return {"outputs": outputs, "output_errors": errors, "unimproved": unimproved, "doubts": doubts}

    def assess_again(self, record: Pass) -> Solved:
        # Raises ValueError if indicators or signs of outputs differ from the stored values, which means another
        # problem.
        solution = solve_again(self.problem, record.mesh, record.indicators)
        check_signs(record.outputs, self.outputs(solution))
        functional = self._functional(record.mesh, solution, record.share).functional
        return Solved(record, solution, functional, self.movable.copy())

    def unsolved(self, record: Pass) -> Solved:
        return Solved(record, UNSOLVED, None, self.movable.copy())

    def relocate(self, solved: Solved, by_energy: bool) -> Moved[Any]:
        with self.steps("relocate"):
            functional = solved.functional
            ritz = None if functional is None else functional.ritz
            directions = self.anisotropic(solved.record, by_energy)
            wanted = wanted_of(self.problem, solved.record, solved.solution, ritz, directions)
            nodes = self.settings.growth.nodes(self.steps.number, functional is not None, wanted.record)
            recycles = self.recycles_by_density(ritz, by_energy, nodes)
            held = None if functional is None else self.method.held_in_polish(self.movable, functional)
            if by_energy:
                moved = self.method.split(self.movable, wanted.density, nodes if recycles else self.movable.nnodes)
            else:
                moved = self.moved(wanted.density, solved, nodes, recycles)
            return moved if held is None else replace(moved, held_in_polish=int(held.sum()))

    def recycles_by_density(self, ritz: Ritz | None, by_energy: bool, nodes: int) -> bool:
        # After the first passes, and after a pass that was worse, the energy exchanges nodes at a constant number. On a
        # surface that holds its nodes in the polish only a density adds nodes.
        steers = ritz is not None and not ritz.shapes_only and ritz.surface is None
        exchanges = by_energy or (steers and self.steps.number > self.method.passes_by_density)
        drift = drift_of_nodes(self.method.dim, self.order) * nodes
        return not exchanges or abs(nodes - self.movable.nnodes) > drift

    def moved(self, density: ArrayLike, solved: Solved, nodes: int, recycles: bool) -> Moved[Any]:
        settings, method, functional, longest = self.settings, self.method, solved.functional, None
        topology, schedule = settings.rules.topology, settings.schedule
        if functional is not None:
            longest = method.longest_sides(self.movable, functional, root_of_squares(solved.record.indicators))
            if schedule is None and topology == "recycle":
                schedule = method.schedule_before_polish
        rng = settings.rng(self.steps.number)
        return method.move(self.movable, density, schedule, topology, rng, nodes, recycles, longest)

    def anisotropic(self, last: Pass, by_energy: bool) -> bool | str:
        # Elements whose edges stay cannot turn. After a pass that was worse the energy alone moves nodes.
        given = self.settings.anisotropic
        kept = given == "auto" and not self.method.takes_directions(self.settings, last)
        return False if by_energy or kept else given

    def polish(self, solved: Solved, moved: Moved[Any]) -> tuple[Moved[Any], float]:
        with self.steps("polish"):
            if solved.functional is None:
                return moved, 0.0
            functional = solved.functional
            trial = self.method.carry(functional, moved.before, self.movable, moved.recycled.start_element)
            descent = self.method.descent(self.movable, functional, trial, moved.recycled)
            recycled, gain = descend_and_recycle(descent, self.plan(functional))
            return replace(moved, recycled=recycled), gain

    def output_errors(
        self, sides: Sides, outputs: Mapping[str, float], unknowns: int, before: Pass | None
    ) -> tuple[dict[str, float], str]:
        # They are the differences from better values, or else from a pass with half the unknowns. Returned last is the
        # error of the method for better values.
        better, trouble = self.better_outputs(sides)
        if not better and before is not None and unknowns >= TWICE * before.unknowns:
            return {name: value - before.outputs[name] for name, value in outputs.items()}, trouble
        return {name: error_of(value, better[name]) for name, value in outputs.items() if name in better}, trouble

    def better_outputs(self, sides: Sides) -> tuple[Mapping[str, float], str]:
        outputs, solution = self.settings.outputs, sides.solution
        try:
            better = sides.problem.optional("improved")(sides.mesh, solution, outputs) if outputs else {}
            exact = sides.exact[1] if better else solution
            if exact is solution:
                return better, ""
            changes = {name: outputs[name](exact) - outputs[name](solution) for name in better}
            return {name: shifted(value, changes[name]) for name, value in better.items()}, ""
        except NotOffered:
            return {}, ""
        except Exception as error:  # an unknown error is no reason to lose the result
            return {}, text_of(error)

    def goal_error(self, solved: Solved) -> tuple[Uncertain | None, str]:
        try:
            return goal_error(Sides(self.problem, solved.record.mesh, solved.solution, solved.curved)), ""
        except Exception as error:  # an unknown error is no reason to lose the result
            return None, text_of(error)

    def _functional(self, mesh: Mesh, solution: Any, share: float | None) -> FunctionalOfPass:
        if not self.settings.polish:
            return FunctionalOfPass(unpolished="polish=False")
        return functional_of(self.problem, self.method, self.movable, mesh, solution, share)

    def outputs(self, solution: Any) -> dict[str, float]:
        values = {}
        for name, function in self.settings.outputs.items():
            with self.steps("estimate", f"output {name!r}"):
                values[name] = output_value(name, function, solution)
        return values


def curved_of(movable: MovableMesh | MovableSolid) -> MovableMesh | None:
    return movable if isinstance(movable, MovableMesh) and movable.curved else None


def goal_error(sides: Sides) -> Uncertain:
    error, (_, exact) = goal_error_of(sides.problem, sides.solution), sides.exact
    if exact is sides.solution:
        return error
    goal, on_exact = (goal_of(sides.problem, solution) or 0.0 for solution in (sides.solution, exact))
    return shifted(error, on_exact - goal)


def indices_in_input(before: Solved | None, moved: Moved[Any] | None, nnodes: int, ninput: int) -> Ints:
    """Return the index in the input mesh of every node, -1 for a new node.

    In the first mesh, nodes inserted for layers follow the `ninput` nodes of the input.
    """
    if before is None or moved is None:
        return np.where(np.arange(nnodes) < ninput, np.arange(nnodes), -1)
    old = moved.recycled.old
    return np.where(old >= 0, before.record.nodes[old], -1)


def root_of_squares(values: Floats) -> float:
    """Return the square root of the sum of squares, free of overflow and underflow."""
    largest = values.max()
    return float(largest * np.linalg.norm(values / largest)) if largest > 0.0 else 0.0
