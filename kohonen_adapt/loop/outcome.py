"""Errors of the best pass, and the message of the result."""

from dataclasses import replace

from kohonen_adapt.loop.corners import corner_remark
from kohonen_adapt.loop.passes import Ending, Status
from kohonen_adapt.loop.state import State
from kohonen_adapt.loop.step import Adaptation
from kohonen_adapt.loop.stopping import beside_goal_remark, outputs_remark, remarks_on_passes, unimproved_remark
from kohonen_adapt.problem.uncertain import doubts_of


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
    remark = unimproved_remark("" if best.unimproved else trouble)
    return state.with_note(remark or outputs_remark(state.passes[0], best, better))


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
