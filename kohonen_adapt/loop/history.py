"""History of an adaptive loop, and the end of the loop."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from kohonen_adapt.checks import check_hook
from kohonen_adapt.loop.checkpoint import Checkpoint
from kohonen_adapt.loop.passes import Pass, Status
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.step import UNSOLVED, Adaptation, Solved
from kohonen_adapt.loop.steps import StepFailed, Steps
from kohonen_adapt.loop.stopping import (
    Ending,
    StopTest,
    failed,
    final,
    interrupted,
    not_moved,
    under_way,
    worse_outputs,
)
from kohonen_adapt.outline.movable import Work
from kohonen_adapt.problem.protocol import solve_again

__all__ = ["History"]


@dataclass(frozen=True)
class Kept:
    """Passes so far, with the solutions of the last and the best pass.

    Attributes
    ----------
    passes
        All passes in order, the input first.
    last
        Last pass, from which the next one may start warm.
    least, lowest
        Pass with the least error measure, and pass with the lowest functional.
    """

    passes: tuple[Pass, ...] = ()
    last: Solved | None = None
    least: Solved | None = None
    lowest: Solved | None = None

    def extended(self, solved: Solved) -> "Kept":
        if self.least is None or self.lowest is None:
            return Kept((solved.record,), solved, solved, solved)
        least = solved if solved.record.worth < self.least.record.worth else self.least
        lowest = solved if _lies_below(solved.record, self.lowest.record) else self.lowest
        return Kept((*self.passes, solved.record), solved, least, lowest)

    def solved(self, before: Solved, now: Solved) -> "Kept":
        found: dict[str, Any] = {name: now for name in ("last", "least", "lowest") if getattr(self, name) is before}
        return replace(self, **found)

    @property
    def best(self) -> Solved:
        best = self.lowest if all(step.comparable for step in self.passes) else self.least
        if best is None:
            raise RuntimeError("the history has no pass.")
        return best


def _lies_below(one: Pass, other: Pass) -> bool:
    return one.functional is not None and other.functional is not None and one.functional < other.functional


class History:
    """Passes of one run and the reason for its end.

    Parameters
    ----------
    adaptation
        Steps of a pass, with the mesh.
    stop
        Stop test, called once for every pass.
    checkpoint
        Files of the passes, or None.
    interim
        Function called after every pass with the result so far, or None.
    """

    def __init__(
        self,
        adaptation: Adaptation,
        stop: StopTest,
        checkpoint: Checkpoint | None,
        interim: Callable[[AdaptResult], Any] | None,
    ) -> None:
        check_hook("interim", interim, "the result so far")
        self._adaptation, self._stop = adaptation, stop
        self._checkpoint, self._interim = checkpoint, interim
        self._kept = Kept()
        self._ending: Ending | None = None

    @property
    def _steps(self) -> Steps:
        return self._adaptation.steps

    @property
    def growing(self) -> bool:
        return self._adaptation.settings.growth.goes_on(self._steps.number - 1)

    @property
    def goes_on(self) -> bool:
        return self._ending is None

    def resumed(self) -> Solved | None:
        """Return the last stored pass, solved again unless the loop ended there.

        The mesh is set to the mesh of this pass. Return None if no pass is stored.
        """
        last = None
        for record in self._checkpoint.passes(self._adaptation.movable) if self._checkpoint else ():
            last = Solved(record, UNSOLVED)
            self._record(last)
            if not self.goes_on:
                return last
        if last is None:
            return None
        self._steps.begin(last.record.number, "solve again")
        solved = self._adaptation.assess_again(last.record)
        self._kept = self._kept.solved(last, solved)
        self._steps.begun = True
        return solved

    def add(self, solved: Solved) -> Solved:
        self._kept = self._kept.extended(solved)
        self._steps.begun = True
        if self._interim:
            self._solve_best()
            self._interim(self._result(under_way(self._kept.passes, self._kept.best.record)))
        if self._checkpoint:
            number = solved.record.number
            with self._steps("checkpoint", f"checkpoint of pass {number}", number):
                self._checkpoint.keep(solved.record, self._adaptation.movable)
        self._test()
        return solved

    def _record(self, solved: Solved) -> None:
        self._kept = self._kept.extended(solved)
        self._test()

    def _test(self) -> None:
        passes = self._kept.passes
        self._steps.next_pass(len(passes))
        stalled = self._adaptation.method.stalls(passes)
        self._ending = self._stop(passes, self._kept.best.record, self.growing, stalled)

    def end_unmoved(self, work: Work) -> None:
        self._ending = not_moved(work, self._kept.best.record)

    @contextmanager
    def ending_kept(self) -> Iterator[None]:
        """Convert Ctrl-C and a failed step into an ending after the first solve."""
        try:
            yield
        except KeyboardInterrupt:
            if not self._steps.begun:
                raise
            self._ending = interrupted(self._kept.passes, self._kept.best.record)
        except StepFailed as failure:
            self._ending = failed(failure, self._kept.best.record)

    def result(self) -> AdaptResult:
        """Return the best pass with its solution, the history and the reason for the end.

        The last pass replaces the best pass of a resumed run if the best pass cannot be solved again.
        """
        with self.ending_kept():
            self._solve_best()
        if self._ending is None:
            raise RuntimeError("the loop has not ended.")
        ending = final(self._ending, self._kept.passes, self._kept.best.record, self._adaptation.settings)
        result = self._with_goal_error(self._result(ending))
        if result.status is not Status.STALLED:
            return result
        better = self._adaptation.better_outputs(result.mesh, result.solution)
        remark = worse_outputs(result.history[0], result.best, better)
        return replace(result, message=f"{result.message} {remark}".rstrip())

    def _with_goal_error(self, result: AdaptResult) -> AdaptResult:
        best = result.best
        if best.goal is None:
            return result
        self._steps.begin(best.number, "estimate the error of the goal")
        error, trouble = self._adaptation.goal_error(result.solution)
        if trouble:
            return replace(result, message=f"{result.message} The error of the goal could not be estimated: {trouble}.")
        known = replace(best, goal_error=error)
        return replace(result, history=tuple(known if step is best else step for step in result.history))

    def _solve_best(self) -> None:
        kept = self._kept
        best, last = kept.best, kept.last
        if best.solution is not UNSOLVED or last is None:
            return
        self._kept = kept.solved(best, last)  # the result if the solver fails
        record = best.record
        with self._steps("solve again", number=record.number):
            solution = solve_again(self._adaptation.problem, record.mesh, record.indicators)
        self._steps.begun = True
        self._kept = kept.solved(best, replace(best, solution=solution))

    def _result(self, ending: Ending) -> AdaptResult:
        best = self._kept.best
        return AdaptResult(
            mesh=best.record.mesh,
            solution=best.solution,
            indicators=best.record.indicators,
            estimate=best.record.estimate,
            history=self._kept.passes,
            status=ending.status,
            message=ending.message,
            nodes=best.record.nodes,
            error=ending.error,
        )
