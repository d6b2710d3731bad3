"""Stop test of the adaptive loop, and the messages of the result."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kohonen_adapt.checks import check_count, check_hook, listed
from kohonen_adapt.display import counted
from kohonen_adapt.loop.corners import LIMITED, corner_remark
from kohonen_adapt.loop.figures import error_text
from kohonen_adapt.loop.grading import GradingTolerance
from kohonen_adapt.loop.growth import Growth, NodeCounts, drift_of_nodes
from kohonen_adapt.loop.passes import Ending, Pass, Passes, Status, StepFailed, Work, text_of
from kohonen_adapt.loop.settings import Settings, Tolerance, percent
from kohonen_adapt.loop.state import STALL_GAIN, STALL_PASSES, State, underrating
from kohonen_adapt.loop.step import Adaptation
from kohonen_adapt.problem.uncertain import doubts_of

# Ratio of the errors of an output on the result and on the input above which a remark is made. The errors are
# differences from a better value, whose own error is up to a fifth of them (see test_goal_error.py).
WORSE = 1.25

# Ratio of the estimate of the pass with the lowest functional to the least estimate above which a warning is given. An
# inaccurately integrated functional once selected a pass with 30 times the least estimate; scatter is a few per cent.
DISAGREEMENT = 3.0

FULL = 0.98  # fraction of the largest number of nodes from which a mesh is full

CONTINUE = "Adapt the result to continue."


@dataclass(frozen=True)
class StopTest:
    passes: int
    asked: Tolerance
    callback: Callable[[Pass], Any] | None
    max_nodes: int | None = None
    grading: GradingTolerance | None = None  # looser tolerance of passes before a higher order

    def __post_init__(self) -> None:
        check_count("passes", self.passes)
        check_hook("callback", self.callback, "the pass")

    def __call__(self, state: State, growing: bool, stalled: bool) -> State:
        """Return the state after the test of its last pass, ended or not.

        While the mesh is `growing`, unmoved nodes or a stall do not end the loop. A loop that owes a pass has not tried
        the polish alone after a worse pass: it is not stalled, and has one more pass if the input is the best.
        """
        last = state.passes[-1]
        whole = replace(self, grading=None)
        if whole._is_met(state.passes, last) and self.asked.missed(state.best.record):
            # the last pass meets tolerances that the best one misses, as of a goal beside a smaller estimate
            state = replace(state, chosen=state.last)
        returned = self.callback(last) if self.callback else None
        # Only True stops the loop, because many callbacks return a path or a list by accident.
        is_stopped = isinstance(returned, bool | np.bool_) and bool(returned)
        return replace(state, ending=self._ending(state, is_stopped, growing, stalled))

    def _ending(self, state: State, is_stopped: bool, growing: bool, stalled: bool) -> Ending | None:
        passes, best = state.passes, state.best.record
        last, after = passes[-1], f"after {count_text(passes)}"
        missed = f"{after}{self.asked.missed_text(last)}."
        if converged := self.converged(state):
            return converged
        if is_stopped:
            return stopped_ending(Status.STOPPED, f"by the callback {after}.", best, CONTINUE)
        if last.number > 0 and last.moved == 0 and not growing:
            return unmoved_ending(last, best)
        if unreachable := self.asked.unreachable_text(passes):
            return stopped_ending(Status.STALLED, f"{after}: {unreachable}", best)
        if self.max_nodes is not None and last.mesh.nvertices >= FULL * self.max_nodes:
            at = f"at {last.mesh.nvertices} nodes (`max_nodes` {self.max_nodes}) {missed}"
            return stopped_ending(Status.MAX_NODES, at, best, self._remedy_of_nodes(last))
        if stalled and not growing and not state.owes_pass:
            return stalled_ending(best)
        if last.number < self.passes or (state.owes_pass and best.number == 0):
            return None
        if last.number == 0:
            text = "Stopped after 0 passes: the input was only solved and estimated. Increase `passes` to adapt it."
            return Ending(Status.MAX_PASSES, text)
        return stopped_ending(Status.MAX_PASSES, missed, best, "Increase `passes` to continue.")

    def converged(self, state: State) -> Ending | None:
        last, best = state.passes[-1], state.best.record
        text = f"Converged after {count_text(state.passes)}"
        if last.estimate == 0.0 and not self.asked.missed_values(last):
            reasons = " and ".join(["all indicators are zero", *self.asked.errors_text(last)])
            return Ending(Status.CONVERGED, f"{text}: {reasons}.")
        # the tolerances are met by the last pass, and by the result if that is another pass
        is_result = self.grading is not None or best is last or not self.asked.missed(best)
        if is_result and self._is_met(state.passes, best):
            return Ending(Status.CONVERGED, f"{text}: {self.asked.reached_text(last)}. {best_pass_text(best)}")
        return None

    def at_order(self, state: State) -> State:
        """Return the state with the reason for the end after a solve of a higher order."""
        last, before = state.passes[-1], state.ending
        if self.callback:
            self.callback(last)
        status = before.status if before and self.asked.estimate(last) is None else Status.MAX_PASSES
        missed = f"after {count_text(state.passes)}{self.asked.missed_text(last)}."
        converged = replace(self, grading=None).converged(state)
        return state.ended(converged or stopped_ending(status, missed, last))

    def wants_order(self, state: State) -> bool:
        """Return True if the next step is a solve of a higher order."""
        ending, best = state.ending, state.best.record
        if ending is None or self.grading is None or state.raised or ending.status in (Status.STOPPED, Status.FAILED):
            return False
        if self.asked.unreachable_text(state.passes):
            return False
        allowed = self.asked.estimate(best)
        return len(self.grading.orders) == 1 or allowed is None or best.estimate > allowed

    def _remedy_of_nodes(self, last: Pass) -> str:
        if not (tolerance := self.tolerance(last)):
            return ""
        return f"The tolerance takes an estimate {last.estimate / tolerance:.2g} times smaller: increase `max_nodes`."

    def _is_met(self, passes: Passes, best: Pass) -> bool:
        tolerance, last = self.tolerance(passes[-1]), passes[-1]
        if tolerance is None or last.estimate == 0.0 or last.estimate * underrated(passes, best) > tolerance:
            return False
        if self.grading is None:
            return self.asked.knows_errors(last)
        # the first pass grades the mesh, and removes nodes
        return last.number > 0 or last.estimate <= (self.asked.estimate(last) or 0.0)

    def tolerance(self, last: Pass) -> float | None:
        return self.asked.estimate(last) if self.grading is None else self.grading(last)


def remarks_on_passes(state: State, settings: Settings, norm: str) -> Iterator[str]:
    passes, best = state.passes, state.best.record
    yield _choice_remark(passes, best)
    yield _resolution_remark(passes, best)
    status = state.ending and state.ending.status
    if len(passes) > 1 or status is not Status.CONVERGED:  # else nothing was polished or compared
        yield _polish_remark(passes, settings, norm)
    if status in LIMITED:
        yield _shortfall_remark(passes, settings.growth)


def _shortfall_remark(passes: Passes, growth: NodeCounts) -> str:
    first, last = passes[0], passes[-1]
    drift, nodes = drift_of_nodes(last.mesh.dim(), last.order), last.mesh.nvertices
    if drift:  # recycling by energy keeps the unknowns, not the nodes
        nodes = max(nodes, round(first.mesh.nvertices * last.unknowns / first.unknowns))
    if not isinstance(growth, Growth) or nodes >= (1.0 - drift) * growth.target:
        return ""
    return (
        f"The mesh has {nodes} of {growth.target} nodes, because further splits would break the quality rule or the "
        "passes ended too early. Decrease `min_quality`, improve the input mesh or increase `passes`."
    )


def beside_goal_remark(best: Pass) -> str:
    unknown = [] if best.goal is None else [name for name in best.outputs if name not in best.output_errors]
    return f"The mesh is not adapted for {listed(unknown)}, and the error there is unknown." if unknown else ""


def unimproved_remark(trouble: str) -> str:
    return f"`improved` of the problem failed: {trouble}. Errors of outputs may be unknown." if trouble else ""


def _choice_remark(passes: Passes, best: Pass) -> str:
    least = min(passes, key=lambda step: step.worth)
    if best.worth <= least.worth or not all(step.comparable for step in passes):
        return ""
    if best.functional != min(step.functional for step in passes if step.functional is not None):
        return ""
    if best.worth < DISAGREEMENT * least.worth:
        smaller = f"{_named(least)} has the least estimate ({least.estimate_text})"
        return f"The functional is lowest in {_named(best)}, although {smaller}."
    times = f"{best.worth / least.worth:.2g} times the estimate of {_named(least)} ({least.estimate_text})"
    return (
        f"Functional and estimate disagree: {_named(best)} has the lowest functional, but {times}. "
        "Compare both passes with a solution on a finer mesh."
    )


def _resolution_remark(passes: Passes, best: Pass) -> str:
    factor = underrated(passes, best)
    if factor == 1.0:
        return ""
    return (
        f"The mesh does not resolve the solution: the error of the pass before was {factor:.2g} times its estimate, "
        "and this error may exceed its estimate as much. Increase `passes` or `target_nodes`."
    )


def underrated(passes: Passes, best: Pass) -> float:
    # of the pass before the best, or 1
    before = next((step for step in passes if step.number == best.number - 1), None)
    return 1.0 if before is None else underrating(before, best)


def _polish_remark(passes: Passes, settings: Settings, norm: str) -> str:
    unpolished = next((step.unpolished for step in passes if step.unpolished), "")
    if not settings.polish or (all(step.comparable for step in passes) and not unpolished):
        return ""
    if unpolished:
        without = [str(step.number + 1) for step in passes[:-1] if step.unpolished]
        some = f" in pass {', '.join(without)}" if any(not step.unpolished for step in passes) and without else ""
        return f"No polish{some}: {unpolished}."
    if passes[0].functional is None:
        return "The polish only improved the shapes of elements, and passes were compared by the estimate."
    if norm != "energy":
        return f"The polish lowered the energy, and passes were compared by the estimate in the {norm} norm."
    reason = next((step.incomparable for step in reversed(passes) if step.incomparable), "")
    return f"Passes were compared by the estimate, because {reason}."


def stopped_ending(status: Status, text: str, best: Pass, remedy: str = "") -> Ending:
    return Ending(status, f"Stopped {text} {best_pass_text(best)} {remedy}".rstrip())


def stalled_ending(best: Pass) -> Ending:
    stall = f"Stalled: the last {STALL_PASSES} passes improved the result by less than {percent(STALL_GAIN)}."
    remedy = "Use more nodes (`target_nodes`) for a smaller error."
    return Ending(Status.STALLED, f"{stall} {best_pass_text(best)} {remedy}")


def unmoved_ending(work: Work, best: Pass) -> Ending:
    why = work.why_still.rstrip(".")
    return Ending(Status.NOT_MOVED, f"No node moved: {why}. {best_pass_text(best)}")


def stay_ending(state: State, work: Work) -> Ending:
    best = state.best.record
    return stalled_ending(best) if state.returns_to_best else unmoved_ending(work, best)


def ending_so_far(what: str, state: State) -> Ending:
    text = f"{what} after {count_text(state.passes)}. {best_pass_text(state.best.record)} {CONTINUE}"
    return Ending(Status.STOPPED, text)


def failed_ending(failure: StepFailed, state: State) -> Ending:
    error, best = failure.__cause__, best_pass_text(state.best.record)
    message = f"Failed in pass {failure.number}, {failure.step}: {text_of(error)}. {best} See `error`."
    return Ending(Status.FAILED, message, error if isinstance(error, Exception) else None)


def best_pass_text(best: Pass) -> str:
    return f"Best: {_named(best)}, {error_text(best)}."


def count_text(passes: Passes) -> str:
    last = passes[-1]
    raised = last.order > passes[0].order  # the last entry then is a solve without a pass
    return counted(last.number - raised, "pass") + f" and a solve of order {last.order}" * raised


def _named(step: Pass) -> str:
    return f"pass {step.number}" if step.number else "the input"


def with_errors(adaptation: Adaptation, state: State) -> State:
    """Return the state with the errors of goal and outputs of its best pass.

    With a tolerance of the goal or of outputs, and at a higher order, every pass has these errors.
    """
    best, steps = state.best.record, adaptation.steps
    if best.goal is None or state.raised:
        return state
    if best.goal_error is None:
        steps.begin(best.number, "estimate the error of the goal")
        error, trouble = adaptation.goal_error(state.best)
        best = replace(best, goal_error=error, doubts=best.doubts | doubts_of({"goal": error}))
        state = state.with_note(trouble and f"The error of the goal could not be estimated: {trouble}.")
    if best.outputs and not best.output_errors:
        steps.begin(best.number, "estimate the errors of outputs")
        sides = adaptation.sides(state.best)
        errors, unimproved = adaptation.output_errors(sides, best.outputs, best.unknowns, None)
        best = replace(best, output_errors=errors, unimproved=unimproved, doubts=best.doubts | doubts_of(errors))
    return state.with_record(best)


def with_worse_outputs(adaptation: Adaptation, state: State) -> State:
    """Return the state with a note on outputs that a stalled run made worse."""
    best = state.best.record
    if state.ending is None or state.ending.status is not Status.STALLED or state.raised:
        return state
    better, trouble = adaptation.better_outputs(adaptation.sides(state.best))
    if trouble and not best.unimproved:
        return state.with_note(unimproved_remark(trouble))
    # Outputs smaller than their errors, such as a force across a symmetry, are left out.
    steps = (state.passes[0], best)
    errors = {name: [abs(step.outputs[name] - value) for step in steps] for name, value in better.items()}
    worse = [
        f"error of {name!r} about {now:.2g} (input {before:.2g})"
        for name, (before, now) in errors.items()
        if WORSE * before < now < abs(better[name])
    ]
    note = (
        f"The mesh is better for the energy, but worse for outputs: {', '.join(worse)}. "
        "To reduce the error of an output, use it as the goal of the problem."
    )
    return state.with_note(note if worse else "")


def outcome(adaptation: Adaptation, state: State) -> Ending:
    """Return the ending with all remarks on the passes and the result."""
    ending, best = state.ending, state.best
    if ending is None:
        raise RuntimeError("the loop has not ended.")
    problem, settings = adaptation.problem, adaptation.settings
    ritz = best.functional.ritz if best.functional else None
    remarks = [
        *([state.raised] if state.raised else remarks_on_passes(state, settings, problem.norm)),
        corner_remark(ending.status, problem, best.record.mesh, ritz),
        unimproved_remark(next((step.unimproved for step in state.passes if step.unimproved), "")),
        beside_goal_remark(best.record),
        *state.notes,
    ]
    return replace(ending, message=" ".join(filter(None, [ending.message, *remarks])))
