"""Do the steps of a pass: solve and estimate a mesh, relocate its nodes, polish."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.steps import Steps
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, quality
from kohonen_adapt.mesh.polynomials import count_unknowns
from kohonen_adapt.outline.movable import MovableMesh, Work
from kohonen_adapt.outline.movable_solid import MovableSolid
from kohonen_adapt.outline.rules import Rules
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.regions import VariesInside
from kohonen_adapt.polishing.sweeps import SWEEPS
from kohonen_adapt.problem.outputs import output_value
from kohonen_adapt.problem.protocol import (
    NotOffered,
    Problem,
    energy_norm,
    estimate,
    goal_error_of,
    goal_of,
    goal_unit_of,
    improved,
    is_calibrated,
    norm_of,
    order_of,
    ritz_of,
    solve,
    solve_again,
)
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.density import equidistributing
from kohonen_adapt.som.moved import Moved

__all__ = ["UNSOLVED", "Adaptation", "Room", "Solved"]

WHILE_GROWING = 2  # numbers of the plan of a polish: what more of them do is undone by the nodes to come

UNSOLVED = object()
"""In place of the solution of a pass that was not solved in this process."""


@dataclass(frozen=True)
class Solved:
    """A pass with what the next one starts from, which no file keeps.

    Attributes
    ----------
    record
        The pass.
    solution
        What the problem's ``solve`` returned; `UNSOLVED` in a process that did not solve it.
    functional
        What the polish can lower, or None.
    """

    record: Pass
    solution: Any
    functional: Functional | None = None


class Room(NamedTuple):
    """What passes over meshes of one kind of elements are made of."""

    dim: int
    taken_apart: Callable[[Mesh, Rules, bool | None], Any]  # with bent sides if True, as it comes with None
    loops: Callable[[Problem, Settings], tuple[str, ...]]  # chapters of `kernels/entries.py`
    moved: Callable[..., Moved[Any]]  # as `moved_triangles`
    stated: Callable[[Ritz, Any, Mesh], tuple[Any, float]]  # what the polish lowers, on a movable mesh, and its value
    carried: Callable[..., Any]  # a solution, onto the moved mesh
    lowered: Callable[..., Any]  # a functional, as `descend_and_recycle`
    # Passes after which nodes are recycled by energy alone. A density knows of no directions: where the energy wants
    # long elements, it goes on to move a fifth of all nodes in every pass, to where the energy takes them away again.
    # How many are best is measured: `python -m benchmarks space-passes`.
    by_density: int
    corrects: Callable[[Problem], bool]  # whether a polish makes up for an estimate that places more nodes than it had
    stalls: Callable[[tuple[Pass, ...]], bool]  # whether the last passes have gained nothing
    plan: tuple[int, ...]  # sweeps of the polish, with recycling by energy between its numbers


@dataclass(frozen=True)
class Adaptation:
    """A mesh while it is adapted to a problem: what every step of a pass works on.

    Attributes
    ----------
    problem
        What is solved.
    room
        By what, where that depends on the dimension.
    movable
        The mesh as it is now; `relocate` and `polish` change it.
    settings
        What every pass depends on.
    steps
        Times the steps, and knows which pass is in the making.
    order
        Of the elements, as the problem says at first.
    """

    problem: Problem
    room: Room
    movable: MovableMesh | MovableSolid
    settings: Settings
    steps: Steps
    order: int

    def plan(self, functional: Functional) -> tuple[int, ...]:
        """Sweeps of the polish, with recycling by energy between its numbers; a single one switches that off."""
        recycles = self.settings.rules.topology == "recycle" and not functional.ritz.shapes_only
        plan = self.room.plan if recycles else (SWEEPS,)
        return plan[:WHILE_GROWING] if self.settings.growth.goes_on(self.steps.number) else plan

    def assess(self, before: Solved | None = None, moved: Moved[Any] | None = None, polish_gain: float = 0.0) -> Solved:
        """Solve and estimate the mesh as it is now, made from the pass `before` by these moves; None for the input."""
        mesh = self.movable.mesh() if before else self.movable.start()
        with self.steps("solve"):
            number_facets(mesh)  # for who solves wants to know them, and scikit-fem takes longer
            solution = solve(self.problem, mesh, *((before.record.mesh, before.solution) if before else ()))
        with self.steps("estimate"):
            indicators = estimate(self.problem, mesh, solution)
            norm = energy_norm(self.problem, mesh, solution, self.settings.rtol)
            share = before.functional.share if before and before.functional else None
            functional, value, unpolished = self._functional(mesh, solution, share)
            goal = goal_of(self.problem, solution)
        qualities, weight = quality(mesh), 1.0 if norm_of(self.problem) == "energy" else np.sqrt(area(mesh))
        record = Pass(
            **vars(moved.work(self.movable, polish_gain) if moved else Work()),
            number=before.record.number + 1 if before else 0,
            mesh=mesh,
            indicators=indicators,
            nodes=numbers_in_input(before, moved, self.movable.nnodes, self.settings.growth.start),
            unknowns=count_unknowns(mesh, self.order),
            estimate=root_of_squares(indicators),
            worth=root_of_squares(weight * indicators),
            energy_norm=norm,
            calibrated=is_calibrated(self.problem),
            min_quality=float(qualities.min()),
            mean_quality=float(qualities.mean()),
            functional=value,
            comparable=functional is not None and functional.comparable,
            share=functional.share if functional else None,
            unpolished=unpolished,
            goal=goal,
            goal_unit="" if goal is None else goal_unit_of(self.problem),
            sagitta=self.movable.sagitta(),
            outputs=self._outputs(solution),
            seconds=self.steps.seconds,  # last, for outputs take their time, too
        )
        return Solved(record, solution, functional)

    def assess_again(self, record: Pass) -> Solved:
        """Solve a mesh that another process solved and estimated, to go on from there.

        Raises
        ------
        ValueError
            If its indicators are no longer those of before, so that it is another problem.
        """
        solution = solve_again(self.problem, record.mesh, record.indicators)
        return Solved(record, solution, self._functional(record.mesh, solution, record.share)[0])

    def relocate(self, solved: Solved) -> Moved[Any]:
        """Recycle and move nodes to where all elements would carry the same error."""
        with self.steps("relocate"):
            record, order, norm = solved.record, order_of(self.problem), norm_of(self.problem)
            density = equidistributing(record.mesh, record.indicators, order, norm)
            settings, number = self.settings, self.steps.number
            estimate, functional = record.estimate, solved.functional
            steers = functional is not None and not functional.ritz.shapes_only
            by_energy = steers and number > self.room.by_density
            recycles = not by_energy or settings.growth.nodes(number, functional is not None) != self.movable.nnodes
            return self.room.moved(self.movable, density, functional, estimate, settings, number, recycles)

    def polish(self, solved: Solved, moved: Moved[Any]) -> tuple[Moved[Any], float]:
        """Carry the last solution to the moved mesh and descend its functional; returns all moves, and its gain."""
        with self.steps("polish"):
            if solved.functional is None:
                return moved, 0.0
            functional = solved.functional
            trial = self.room.carried(functional, moved.before, self.movable, moved.recycled.hint)
            recycled, gain = self.room.lowered(self.movable, functional, trial, moved.recycled, self.plan(functional))
            return replace(moved, recycled=recycled), gain

    def better_outputs(self, mesh: Mesh, solution: Any) -> dict[str, float]:
        """Better values of the outputs, none where the problem has none to give."""
        outputs = self.settings.outputs
        try:
            return improved(self.problem, mesh, solution, outputs) if outputs else {}
        except (Exception, KeyboardInterrupt):  # a remark more or less: the result is there, whatever goes wrong here
            return {}

    def goal_error(self, solution: Any) -> tuple[float | None, str]:
        """Return the estimated error of the goal, None where that fails, and why it fails."""
        try:
            return goal_error_of(self.problem, solution), ""
        except (Exception, KeyboardInterrupt) as error:  # the result is there, whatever happens to its error
            return None, ": ".join([type(error).__name__, *str(error).splitlines()[:1]]).rstrip(".")

    def _functional(
        self, mesh: Mesh, solution: Any, share: float | None
    ) -> tuple[Functional | None, float | None, str]:
        """What the solution minimises, its value unless it only shapes elements, None without a polish, and why not.

        A dual has its share of an earlier pass, where there is one.
        """
        if not self.settings.polish:
            return None, None, "it is switched off"
        if norm_of(self.problem) != "energy":
            return None, None, f"an error in the norm {norm_of(self.problem)!r} has no energy to lower"
        try:
            ritz = ritz_of(self.problem, mesh, solution)
            ritz = ritz if share is None else replace(ritz, share=share)
            functional, value = self.room.stated(ritz, self.movable, mesh)
            return functional, None if ritz.shapes_only else value, ""
        except NotOffered as offered:
            return None, None, str(offered)
        except VariesInside:
            return None, None, "coefficients vary inside a region of the mesh"

    def _outputs(self, solution: Any) -> dict[str, float]:
        """The values of all outputs of a solution."""
        values = {}
        for name, function in self.settings.outputs.items():
            with self.steps("estimate", f"output {name!r}"):
                values[name] = output_value(name, function, solution)
        return values


def numbers_in_input(before: Solved | None, moved: Moved[Any] | None, nnodes: int, in_input: int) -> Ints:
    """Number in the input of every node of a mesh, -1 for a new one; those that layers have taken are the last."""
    if before is None or moved is None:
        return np.where(np.arange(nnodes) < in_input, np.arange(nnodes), -1)
    old = moved.recycled.old
    return np.where(old >= 0, before.record.nodes[old], -1)


def root_of_squares(values: Floats) -> float:
    """Square root of the sum of squares, scaled so that neither tiny nor huge values are lost."""
    largest = values.max()
    return float(largest * np.linalg.norm(values / largest)) if largest > 0.0 else 0.0
