"""History of an adaptive loop, and the end of the loop."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from kohonen_adapt.checks import check_hook
from kohonen_adapt.geometry.movable import Work
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.loop.best_passes import BestPasses
from kohonen_adapt.loop.checkpoint import Checkpoint
from kohonen_adapt.loop.corners import corner_remark
from kohonen_adapt.loop.passes import Pass, Status, StepFailed, Steps
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.sides import Sides
from kohonen_adapt.loop.step import UNSOLVED, Adaptation, Solved
from kohonen_adapt.loop.stopping import (
    Ending,
    StopTest,
    beside_goal_remark,
    failed_ending,
    interim_ending,
    interrupted_ending,
    outputs_remark,
    stalled_ending,
    unimproved_remark,
    unmoved_ending,
    with_remarks,
)
from kohonen_adapt.problem.evaluation import solve_again
from kohonen_adapt.problem.uncertain import doubts_of

__all__ = ["History", "run_loop"]


def with_best(result: AdaptResult, known: Pass) -> AdaptResult:
    best = result.best
    return replace(result, history=tuple(known if step is best else step for step in result.history))


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
        self._passes = BestPasses()
        self._ending: Ending | None = None

    @property
    def _steps(self) -> Steps:
        return self._adaptation.steps

    @property
    def growing(self) -> bool:
        return self._adaptation.settings.growth.grows_after(self._steps.number - 1)

    @property
    def running(self) -> bool:
        return self._ending is None

    @property
    def by_energy(self) -> bool:
        return self._passes.returns_to_best

    def has_passes(self) -> bool:
        # passes of the checkpoint are loaded
        return bool(self._passes.passes) or self._resumed()

    def _resumed(self) -> bool:
        for record in self._checkpoint.passes(self._adaptation.movable) if self._checkpoint else ():
            self._record(self._adaptation.unsolved(record))
            if not self.running:
                return True
        last = self._passes.last
        if last is None:
            return False
        self._steps.begin(last.record.number, "solve again")
        self._passes = self._passes.with_solution(last, self._adaptation.assess_again(last.record))
        self._steps.has_solved = True
        return True

    def start(self) -> Solved:
        # The movable mesh is set to the mesh of the returned pass.
        last = self._passes.last
        if last is None:
            raise RuntimeError("the history has no pass.")
        if not self.by_energy:
            return last
        best = self._passes.best
        self._adaptation.movable.restore(best.movable.state())
        if best.solution is UNSOLVED:
            with self._steps("solve again", number=best.record.number):
                solved = self._adaptation.assess_again(best.record)
            self._passes = self._passes.with_solution(best, solved)
        return self._passes.best

    def add(self, solved: Solved) -> None:
        self._passes = self._passes.with_pass(solved)
        self._steps.has_solved = True
        if self._interim:
            self._solve_best()
            self.report(self._result(interim_ending(self._passes.passes, self._passes.best.record)))
        if self._checkpoint:
            number = solved.record.number
            with self._steps("checkpoint", f"checkpoint of pass {number}", number):
                self._checkpoint.write(solved.record, self._adaptation.movable)
        self._test()

    def _record(self, solved: Solved) -> None:
        self._passes = self._passes.with_pass(solved)
        self._test()

    def _test(self) -> None:
        passes = self._passes.passes
        self._steps.next_pass(len(passes))
        stalled = self._adaptation.method.stalls(passes)
        owes_pass = self._passes.owes_pass
        if self._stop.prefers_last(passes, self._passes.best.record):
            self._passes = replace(self._passes, chosen=self._passes.last)
        self._ending = self._stop(passes, self._passes.best.record, self.growing, stalled, owes_pass)

    @property
    def best_curved(self) -> MovableMesh | None:
        # the movable mesh if sides are curved
        return self._passes.best.curved

    def reopen(self) -> None:
        self._ending = None

    def report(self, result: AdaptResult) -> None:
        if self._interim:
            self._interim(result)

    def end_unmoved(self, work: Work) -> None:
        best = self._passes.best.record
        self._ending = stalled_ending(best) if self.by_energy else unmoved_ending(work, best)

    @contextmanager
    def catching_failures(self) -> Iterator[None]:
        """Convert Ctrl-C and a failed step into an ending after the first solve."""
        try:
            yield
        except KeyboardInterrupt:
            if not self._steps.has_solved:
                raise
            self._ending = interrupted_ending(self._passes.passes, self._passes.best.record)
        except StepFailed as failure:
            self._ending = failed_ending(failure, self._passes.best.record)

    def result(self) -> AdaptResult:
        # The last pass replaces the best pass of a resumed run if the best pass cannot be solved again.
        with self.catching_failures():
            self._solve_best()
        with self.catching_failures():
            return self._with_worse_outputs(self._with_output_errors(self._with_goal_error(self._ended())))
        return self._ended()

    def _ended(self) -> AdaptResult:
        if self._ending is None:
            raise RuntimeError("the loop has not ended.")
        adaptation, passes = self._adaptation, self._passes
        norm = adaptation.problem.norm
        best, functional = passes.best.record, passes.best.functional
        ending = with_remarks(self._ending, passes.passes, best, adaptation.settings, norm)
        remark = corner_remark(ending.status, adaptation.problem, best.mesh, functional.ritz if functional else None)
        return self._result(replace(ending, message=f"{ending.message} {remark}".rstrip()))

    def _with_worse_outputs(self, result: AdaptResult) -> AdaptResult:
        if result.status is not Status.STALLED:
            return result
        better, trouble = self._adaptation.better_outputs(self._sides(result))
        remark = unimproved_remark("" if result.best.unimproved else trouble)
        remark = remark or outputs_remark(result.history[0], result.best, better)
        return replace(result, message=f"{result.message} {remark}".rstrip())

    def _with_goal_error(self, result: AdaptResult) -> AdaptResult:
        best = result.best
        if best.goal is None or best.goal_error is not None:
            return result
        self._steps.begin(best.number, "estimate the error of the goal")
        error, trouble = self._adaptation.goal_error(self._passes.best)
        if trouble:
            return replace(result, message=f"{result.message} The error of the goal could not be estimated: {trouble}.")
        return with_best(result, replace(best, goal_error=error, doubts=best.doubts | doubts_of({"goal": error})))

    def _with_output_errors(self, result: AdaptResult) -> AdaptResult:
        # With a tolerance of outputs every pass has these errors.
        best = result.best
        if best.goal is None or not best.outputs or best.output_errors:
            return result
        self._steps.begin(best.number, "estimate the errors of outputs")
        found = self._adaptation.output_errors(self._sides(result), best.outputs, best.unknowns, None)
        known = replace(best, output_errors=found[0], unimproved=found[1], doubts=best.doubts | doubts_of(found[0]))
        remarks = filter(None, [result.message, unimproved_remark(found[1]), beside_goal_remark(known)])
        return replace(with_best(result, known), message=" ".join(remarks))

    def _sides(self, result: AdaptResult) -> Sides:
        return Sides(self._adaptation.problem, result.mesh, result.solution, self._passes.best.curved)

    def _solve_best(self) -> None:
        passes = self._passes
        best, last = passes.best, passes.last
        if best.solution is not UNSOLVED or last is None:
            return
        self._passes = passes.with_solution(best, last)  # the result if the solver fails
        record = best.record
        with self._steps("solve again", number=record.number):
            solution = solve_again(self._adaptation.problem, record.mesh, record.indicators)
        self._steps.has_solved = True
        self._passes = passes.with_solution(best, replace(best, solution=solution))

    def _result(self, ending: Ending) -> AdaptResult:
        best = self._passes.best
        return AdaptResult(
            mesh=best.record.mesh,
            solution=best.solution,
            indicators=best.record.indicators,
            estimate=best.record.estimate,
            history=self._passes.passes,
            status=ending.status,
            message=ending.message,
            nodes=best.record.nodes,
            error=ending.error,
        )


def run_loop(adaptation: Adaptation, history: History) -> AdaptResult:
    movable = adaptation.movable
    with history.catching_failures():
        if not history.has_passes():
            history.add(adaptation.assess())
        while history.running:
            start = history.start()
            moved = adaptation.relocate(start, history.by_energy)
            moved, gain = adaptation.polish(start, moved)
            if moved.changed(movable) or history.growing:
                history.add(adaptation.assess(start, moved, gain))
            else:
                history.end_unmoved(moved.work(movable, gain))
    return history.result()
