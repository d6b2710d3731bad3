"""Passes of a run, and the choice of the best one."""

from dataclasses import dataclass, replace
from typing import Any

from kohonen_adapt.loop.growth import drift_of_nodes
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.step import Solved
from kohonen_adapt.loop.underrating import error_measure

__all__ = ["BestPasses"]


@dataclass(frozen=True)
class BestPasses:
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
        Last pass, if it meets tolerances that the best one misses, else None.
    """

    passes: tuple[Pass, ...] = ()
    last: Solved | None = None
    least_error: Solved | None = None
    lowest_functional: Solved | None = None
    last_by_energy: bool = False
    chosen: Solved | None = None

    def with_pass(self, solved: Solved) -> "BestPasses":
        if self.least_error is None or self.lowest_functional is None:
            return BestPasses((solved.record,), solved, solved, solved)
        record, least, lowest = solved.record, self.least_error, self.lowest_functional
        least = solved if has_less_error(record, least.record) else least
        lowest = solved if has_lower_functional(record, lowest.record) else lowest
        return BestPasses((*self.passes, record), solved, least, lowest, self.returns_to_best)

    def with_solution(self, before: Solved, now: Solved) -> "BestPasses":
        names = ("last", "least_error", "lowest_functional", "chosen")
        changes: dict[str, Any] = {name: now for name in names if getattr(self, name) is before}
        return replace(self, **changes)

    @property
    def best(self) -> Solved:
        best = self.lowest_functional if all(step.comparable for step in self.passes) else self.least_error
        best = self.chosen or best
        if best is None:
            raise RuntimeError("the history has no pass.")
        return best

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


def has_less_error(step: Pass, best: Pass) -> bool:
    # indicators that are all zero do not compare passes
    now, least = error_measure(step, best), error_measure(best, step)
    return now < least or (now == least == 0.0 and step.unknowns > best.unknowns)


def has_lower_functional(step: Pass, best: Pass) -> bool:
    return step.functional is not None and best.functional is not None and step.functional < best.functional
