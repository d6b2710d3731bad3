"""Steps of a pass, which solve, estimate, relocate and polish."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import with_thin_layers
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.loop.corners import singular_parts
from kohonen_adapt.loop.dimension import method_of
from kohonen_adapt.loop.directions import wanted_of
from kohonen_adapt.loop.functional_of_pass import FROZEN, FunctionalOfPass, differs_on, functional_of
from kohonen_adapt.loop.growth import drift_of_nodes
from kohonen_adapt.loop.passes import Pass, Steps, Work, text_of, work_of
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.sides import Sides
from kohonen_adapt.loop.state import Solved, curved_of
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.host import count_unknowns, number_facets
from kohonen_adapt.mesh.measures import area, quality
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
from kohonen_adapt.problem.uncertain import Uncertain, doubts_of, error_of, shifted
from kohonen_adapt.som.relocate import split_edges
from kohonen_adapt.som.relocation_record import Moved

GROWING_ENTRIES = 2  # entries of the plan of a polish, because nodes added later undo the effect of further entries

TWICE = 1.8  # factor of the unknowns from which the difference of two passes bounds the error of an output


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
    method: ModuleType
    movable: MovableMesh | MovableSolid
    settings: Settings
    steps: Steps
    order: int

    @classmethod
    def of(cls, mesh: Mesh, problem: CheckedProblem, settings: Settings, steps: Steps) -> "Adaptation":
        """Return the steps from a mesh on, which gets its missing layers."""
        method, growth = method_of(mesh), settings.growth
        expect(*method.moving_kernels(settings.rules.topology, settings.schedule))
        if settings.polish:
            expect(*method.polish_kernels(problem), *method.TRANSFER_KERNELS)
        start = with_thin_layers(mesh, settings.rules, grows=growth.target > growth.start)
        movable = method.opened(start, settings.rules, problem.is_curved)
        return cls(problem, method, movable, settings, steps, problem.order)

    def assess(self, before: Solved | None = None, moved: Moved[Any] | None = None) -> Solved:
        """Solve and estimate on the current mesh."""
        mesh = self.movable.mesh() if before else self.movable.start()
        work = work_of(moved, self.movable) if moved else Work()
        if before and moved:
            old = moved.recycled.old
            nodes = np.where(old >= 0, before.record.nodes[old], -1)
        else:
            nodes = np.arange(self.movable.nnodes)
            nodes[self.settings.growth.start :] = -1  # new
        return self._assessed(self.problem, mesh, self.movable.copy(), before, work, nodes)

    def assess_at(self, problem: CheckedProblem, mesh: Mesh, before: Solved) -> Solved:
        """Solve and estimate at a higher order, on a mesh with more nodes."""
        old = before.record.nodes
        nodes = np.append(old, np.full(mesh.nvertices - old.size, -1))
        return self._assessed(problem, mesh, before.movable, before, Work(), nodes)

    def _assessed(
        self,
        problem: CheckedProblem,
        mesh: Mesh,
        movable: MovableMesh | MovableSolid,
        before: Solved | None,
        work: Work,
        nodes: Ints,
    ) -> Solved:
        is_raised = problem is not self.problem
        with self.steps("solve"):
            number_facets(mesh)  # faster than scikit-fem, which numbers them otherwise in the solver
            solution = problem.solve(mesh, *((before.record.mesh, before.solution) if before else ()))
        with self.steps("estimate"):
            sides = Sides(problem, mesh, solution, None if is_raised else curved_of(movable))
            figures = self.figures(sides, movable.cut_off(), is_raised)
            found = (
                FunctionalOfPass() if is_raised else self._functional(mesh, solution, before.share if before else None)
            )
            functional = found.functional
        figures["worth"] = float(np.hypot(figures["worth"], found.oscillation))
        outputs, errors, unimproved = self.outputs(solution), dict[str, float](), ""
        if self.settings.tolerance.output_rtol is not None or (is_raised and figures["goal"] is not None):
            last = before.record if before else None
            errors, unimproved = self.output_errors(sides, outputs, figures["unknowns"], last)
        incomparable = self.incomparable(before, functional, mesh)
        record = Pass(
            **vars(work),
            **figures,
            outputs=outputs,
            output_errors=errors,
            unimproved=unimproved,
            doubts=doubts_of({**errors, "goal": figures["goal_error"]}),
            smooth=before.record.smooth if before else self.is_smooth(mesh, solution),
            number=self.steps.number,
            mesh=mesh,
            nodes=nodes,
            functional=found.value,
            comparable=functional is not None and not incomparable,
            incomparable=incomparable,
            share=functional.share if functional else None,
            unpolished=found.unpolished,
            sagitta=movable.sagitta(),
            seconds=self.steps.seconds,  # last, because outputs add their time
            compile_seconds=self.steps.compile_seconds,
        )
        return Solved(record, solution, functional, movable)

    def is_smooth(self, mesh: Mesh, solution: Any) -> bool:
        # True in space if the edges are known and none is singular, for passes at a chosen order before a higher one
        if mesh.dim() != TETRAHEDRON.dim or self.problem.chosen_order is None or not self.settings.tolerance:
            return False
        try:
            nodes, edges = singular_parts(self.problem, mesh, solution)
        except NotOffered:
            return False
        return edges is not None and not nodes.size and not edges.size

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

    def figures(self, sides: Sides, cut_off: float, is_raised: bool) -> dict[str, Any]:
        # Fields of a `Pass`. `cut_off` is the area or volume between elements and their curved parts.
        problem, mesh, tolerance = sides.problem, sides.mesh, self.settings.tolerance
        order = problem.order if is_raised else self.order
        indicators = estimate(problem, mesh, sides.solution)
        norm = energy_norm(problem, mesh, sides.solution, tolerance.rtol)
        goal = goal_of(problem, sides.solution)
        total = root_of_squares(indicators)
        size, qualities = area(mesh), quality(mesh)
        length = 1.0 if problem.norm == "energy" else size ** (1 / mesh.dim())
        if goal is None and total <= (tolerance.of_energy(norm) or 0.0):
            total = sides.error_with_sides(total, self.settings.rules.curves)
        wants_error = tolerance.goal_rtol is not None or (is_raised and goal is not None)
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

    def assess_again(self, record: Pass) -> Solved:
        # Raises ValueError if indicators or signs of outputs differ from the stored values, which means another
        # problem.
        solution = solve_again(self.problem, record.mesh, record.indicators)
        check_signs(record.outputs, self.outputs(solution))
        functional = self._functional(record.mesh, solution, record.share).functional
        return Solved(record, solution, functional, self.movable.copy())

    def relocate(self, solved: Solved, by_energy: bool) -> Moved[Any]:
        """Move the nodes to the density of equal errors, or only split edges `by_energy`."""
        with self.steps("relocate"):
            settings, method, movable = self.settings, self.method, self.movable
            functional, topology, schedule = solved.functional, settings.rules.topology, settings.schedule
            ritz = functional.ritz if functional else None
            directions, last = settings.anisotropic, solved.record
            # Elements whose edges stay cannot turn. After a pass that was worse the energy alone moves nodes.
            measured = not method.ALWAYS_DIRECTED and (settings.tolerance or last.goal is not None)
            if by_energy or (directions == "auto" and (topology == "fixed" or measured)):
                directions = False
            last, density = wanted_of(self.problem, last, solved.solution, ritz, directions)
            nodes = settings.growth.nodes(self.steps.number, functional is not None, last)
            # After the first passes, and after a pass that was worse, the energy exchanges nodes at a constant number.
            # On a surface that holds its nodes in the polish only a density adds nodes.
            steers = ritz is not None and not ritz.shapes_only and ritz.surface is None
            exchanges = by_energy or (steers and self.steps.number > method.PASSES_BY_DENSITY)
            drift = drift_of_nodes(movable.input_mesh.dim(), self.order) * nodes
            recycles = not exchanges or abs(nodes - movable.nnodes) > drift
            held, longest = 0, None
            if functional:
                held = int(method.held_in_polish(movable, functional).sum())
                longest = method.longest_sides(movable, functional, root_of_squares(solved.record.indicators))
                if schedule is None and topology == "recycle":
                    schedule = method.BEFORE_POLISH
            if by_energy:
                moved = split_edges(movable, density, nodes if recycles else movable.nnodes)
            else:
                rng = settings.rng(self.steps.number)
                moved = method.move(movable, density, schedule, topology, rng, nodes, recycles, longest)
            return replace(moved, held_in_polish=held)

    def polish(self, solved: Solved, moved: Moved[Any]) -> Moved[Any]:
        """Transfer the solution to the moved mesh, and lower its energy."""
        with self.steps("polish"):
            functional = solved.functional
            if functional is None:
                return moved
            trial = self.method.carry(functional, moved.before, self.movable, moved.recycled.start_element)
            descent = self.method.descent(self.movable, functional, trial, moved.recycled)
            recycles = self.settings.rules.topology == "recycle" and not functional.ritz.shapes_only
            plan: tuple[int, ...] = PLAN if recycles else (SWEEPS,)
            plan = plan[:GROWING_ENTRIES] if self.settings.growth.grows_after(self.steps.number) else plan
            recycled, gain = descend_and_recycle(descent, plan)
            return replace(moved, recycled=recycled, polish_gain=gain)

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

    def sides(self, solved: Solved) -> Sides:
        return Sides(self.problem, solved.record.mesh, solved.solution, curved_of(solved.movable))

    def goal_error(self, solved: Solved) -> tuple[Uncertain | None, str]:
        try:
            return goal_error(self.sides(solved)), ""
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


def goal_error(sides: Sides) -> Uncertain:
    error, (_, exact) = goal_error_of(sides.problem, sides.solution), sides.exact
    if exact is sides.solution:
        return error
    goal, on_exact = (goal_of(sides.problem, solution) or 0.0 for solution in (sides.solution, exact))
    return shifted(error, on_exact - goal)


def root_of_squares(values: Floats) -> float:
    """Return the square root of the sum of squares, free of overflow and underflow."""
    largest = values.max()
    return float(largest * np.linalg.norm(values / largest)) if largest > 0.0 else 0.0
