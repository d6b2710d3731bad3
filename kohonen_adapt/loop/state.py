"""State of an adaptive loop, and the choice of the best pass."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.loop.growth import drift_of_nodes
from kohonen_adapt.loop.passes import Ending, Pass, Passes
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.mesh.cells import centroids_of
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.polishing.functional import Functional

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
    def share(self) -> float | None:
        return self.functional.share if self.functional else None


def curved_of(movable: MovableMesh | MovableSolid) -> MovableMesh | None:
    # the movable mesh if sides are curved
    return movable if isinstance(movable, MovableMesh) and movable.curved else None


@dataclass(frozen=True)
class State:
    """Passes so far, with the solutions of the last and the best pass.

    Attributes
    ----------
    passes
        All passes in order, the input first.
    last
        Last pass, from which the next one may start warm.
    least_error, lowest_functional
        Pass with the least error measure, and pass with the lowest functional.
    last_by_energy
        True if the last pass started from the best mesh, and was polished without density and map.
    chosen
        Last pass, if it meets tolerances that the best one misses or has a higher order, else None.
    ending
        Reason for the end of the passes, or None.
    raised
        Sentence on the higher order of the last pass, or an empty string.
    notes
        Sentences on errors of the goal and the outputs, at the end of the message.
    """

    passes: Passes
    last: Solved
    least_error: Solved
    lowest_functional: Solved
    last_by_energy: bool = False
    chosen: Solved | None = None
    ending: Ending | None = None
    raised: str = ""
    notes: tuple[str, ...] = ()

    @classmethod
    def first(cls, solved: Solved) -> "State":
        return cls((solved.record,), solved, solved, solved)

    def with_pass(self, solved: Solved) -> "State":
        record, least, lowest = solved.record, self.least_error, self.lowest_functional
        error, known = error_measure(record, least.record), error_measure(least.record, record)
        # indicators that are all zero do not compare passes
        if error < known or (error == known == 0.0 and record.unknowns > least.record.unknowns):
            least = solved
        now, before = record.functional, lowest.record.functional
        lowest = solved if now is not None and before is not None and now < before else lowest
        return State((*self.passes, record), solved, least, lowest, self.returns_to_best)

    def with_solution(self, before: Solved, now: Solved) -> "State":
        names = ("last", "least_error", "lowest_functional", "chosen")
        changes: dict[str, Any] = {name: now for name in names if getattr(self, name) is before}
        return replace(self, **changes)

    def ended(self, ending: Ending) -> "State":
        return replace(self, ending=ending)

    def with_note(self, note: str) -> "State":
        return replace(self, notes=(*self.notes, note)) if note else self

    def with_record(self, record: Pass) -> "State":
        """Return the state with another record of the best pass."""
        best = self.best
        passes = tuple(record if step is best.record else step for step in self.passes)
        return replace(self.with_solution(best, replace(best, record=record)), passes=passes)

    @property
    def best(self) -> Solved:
        comparable = all(step.comparable for step in self.passes)
        return self.chosen or (self.lowest_functional if comparable else self.least_error)

    @property
    def returns_to_best(self) -> bool:
        # True for the next pass if the last pass is worse than the best one, with as many unknowns
        last, best = self.passes[-1], self.best.record
        if last is best or last.unpolished or not (last.calibrated or all(step.comparable for step in self.passes)):
            return False
        return last.unknowns >= (1.0 - drift_of_nodes(last.mesh.dim(), last.order)) * best.unknowns

    @property
    def owes_pass(self) -> bool:
        # True if the polish of the best mesh alone has not been tried since a pass was worse
        return self.returns_to_best and not self.last_by_energy

    def result(self, ending: Ending) -> AdaptResult:
        best = self.best
        return AdaptResult(
            mesh=best.record.mesh,
            solution=best.solution,
            indicators=best.record.indicators,
            estimate=best.record.estimate,
            history=self.passes,
            status=ending.status,
            message=ending.message,
            nodes=best.record.nodes,
            error=ending.error,
        )


# Ratio of a squared error to its estimate above which the mesh does not resolve the solution. In 578 runs with a finer
# reference (C-cores of 57 to 211 nodes, devices of 60 to 1024 nodes, orders 1 to 3) the warning after one pass is given
# for 11 of 50 results with an error above 1.2 times the estimate, and for 6 of the remaining 528; after two and three
# passes falsely for 1 of 542 and for 1 of 548.
UNRESOLVED = 2.0


def error_measure(step: Pass, other: Pass) -> float:
    """Return the error measure of a pass, with the error that `other` shows."""
    return step.worth * underrating(step, other)


def underrating(step: Pass, other: Pass) -> float:
    """Return the error over the estimate of a pass as shown by `other`, at least 1."""
    if step.estimate == 0.0:
        return 1.0
    if step.functional is None and other.functional is None:
        ratio = ratio_by_smaller_elements(step, other)
    else:
        ratio = ratio_by_functional(step, other)
    return float(np.sqrt(ratio)) if ratio > UNRESOLVED else 1.0


def ratio_by_functional(step: Pass, other: Pass) -> float:
    # A functional lies above its minimum by half the square of the error in the energy norm. Hence the squared error is
    # twice the decrease to the other pass, plus the squared error of the other pass.
    comparable = step.comparable and other.comparable and other.calibrated and other.share is None
    if not comparable or step.functional is None or other.functional is None:
        return 1.0
    return (2.0 * (step.functional - other.functional) + other.estimate**2) / step.estimate**2


def ratio_by_smaller_elements(step: Pass, other: Pass) -> float:
    # Smaller elements have less error. Elements whose error is contradicted by smaller ones inside have the error of
    # these, scaled to the larger size: squared errors over areas are proportional to h^(2 order).
    size, part = area(step.mesh), area(other.mesh)
    inside = find_elements(step.mesh, centroids_of(other.mesh))
    rows = np.flatnonzero((inside >= 0) & (part < size[inside]))
    around, part = inside[rows], part[rows]
    scale = step.indicators.max()
    squared, smaller = (step.indicators / scale) ** 2, (other.indicators[rows] / scale) ** 2
    scaled = smaller * (size[around] / part) ** (2.0 * step.order / step.mesh.dim())
    covered, found, total = (np.bincount(around, values, len(size)) for values in (part, smaller, scaled))
    own = squared * np.minimum(covered / size, 1.0)
    return float(1.0 + np.sum((total - own)[found > UNRESOLVED * own]) / np.sum(squared))


# The random training points scatter the estimate of a pass by about 1 %, so a pass without a decrease is often followed
# by a pass with one. On the L-shape, example 22 of scikit-fem and a square magnet, with 225 to 3201 nodes, stopping
# after two passes without a decrease gave an estimate 0.3 % (mean) and 1.6 % (maximum) above the best of ten passes;
# after one pass 0.5 and 2.6 %, after three 0.2 and 1.6 %. A decrease by 0.1 % does not pay for a pass.
STALL_PASSES = 2
STALL_GAIN = 1e-3


def stalls_by_estimate(passes: Passes) -> bool:
    if len(passes) <= STALL_PASSES:
        return False
    before = min(passes[:-STALL_PASSES], key=lambda step: step.worth)
    return all(
        error_measure(step, before) > (1.0 - STALL_GAIN) * error_measure(before, step)
        for step in passes[-STALL_PASSES:]
    )


def stalls_by_functional(passes: Passes) -> bool:
    """Return True if the last passes contributed too little of the total decrease.

    Estimates overrate stretched tetrahedra, so they are compared only if a pass has no comparable functional.
    """
    levels = [step.functional for step in passes if step.functional is not None and step.comparable]
    if len(levels) < len(passes):
        return stalls_by_estimate(passes)
    if len(levels) <= STALL_PASSES:
        return False
    now = min(levels[-STALL_PASSES:])
    return min(levels[:-STALL_PASSES]) - now <= STALL_GAIN * (levels[0] - now)
