"""When the loop ends, and the sentence it then says."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from kohonen_adapt.loop.history import Ending, Journal, StepFailed
from kohonen_adapt.loop.result import Pass, Status
from kohonen_adapt.problem.outputs import have_settled
from kohonen_adapt.som.relocate import Relocation

__all__ = ["STALL_GAIN", "STALL_PASSES", "StopTest", "failed", "interrupted", "not_moved", "remarked", "under_way"]

# The estimate of a pass carries about one per cent of chance (other training points), so one pass without a gain says
# little: the next one often gains again. Over the L-shape, example 22 of scikit-fem and a square magnet, at 225 to 3201
# nodes, a loop that gave up after two ended 0.3 % above the best of ten passes on average, 1.6 % at worst; after one,
# 0.5 and 2.6 %; after three, 0.2 and 1.6 %. A thousandth is less than a pass is worth.
STALL_PASSES = 2
STALL_GAIN = 1e-3


class Targets(NamedTuple):
    """What a pass must come down to: the estimate to `tolerance`, the change of every output to `change`."""

    tolerance: float | None
    change: float | None


@dataclass(frozen=True)
class StopTest:
    """The stop test of the loop, asked once about every pass."""

    passes: int
    rtol: float | None
    atol: float | None
    output_rtol: float | None
    callback: Callable[[Pass], Any] | None

    def __call__(self, journal: Journal, move: Relocation | None, growing: bool) -> Ending | None:
        """The ending, or None to go on; `move` made the last pass. The callback hears of every pass, the last too.

        While the mesh is `growing`, that nothing moved or improved is no reason to end.
        """
        last = journal.history[-1]
        told = self.callback(last) if self.callback else None
        if last.estimate == 0.0:
            return _nothing_to_gain(last)
        if self._met(journal):
            return _converged(journal, self._targets(last))
        # Only a plain True stops: a callback that happens to return something (a path, a list) means nothing by it.
        if isinstance(told, bool | np.bool_) and told:
            return _stopped(journal)
        if move is not None and move.moved == 0 and not growing:
            return not_moved(journal, move)
        if _stalls(journal.worths) and not growing:
            return _stalled(journal)
        if last.number == self.passes:
            return _max_passes(journal, self._targets(last))
        return None

    @property
    def _tolerant(self) -> bool:
        return self.rtol is not None or self.atol is not None

    def _met(self, journal: Journal) -> bool:
        """Whether there are targets and the last pass meets them all."""
        *_, last = journal.history
        if self._tolerant and last.estimate > self._tolerance(last):
            return False
        return self._tolerant if self.output_rtol is None else self._settled(journal, self.output_rtol)

    def _settled(self, journal: Journal, tolerance: float) -> bool:
        if len(journal.history) < 2:
            return False
        before, last = journal.history[-2:]
        return have_settled(before.outputs, last.outputs, tolerance)

    def _targets(self, last: Pass) -> "Targets":
        return Targets(self._tolerance(last) if self._tolerant else None, self.output_rtol)

    def _tolerance(self, last: Pass) -> float:
        return (self.atol or 0.0) + (self.rtol or 0.0) * (last.energy_norm or 0.0)


def not_moved(journal: Journal, move: Relocation) -> Ending:
    """The map found nothing that could move."""
    return Ending(
        Status.NOT_MOVED, f"Nothing could move: {move.message.rstrip('.')}; {_best(journal)}, change that to go on."
    )


def remarked(ending: Ending, remark: str) -> Ending:
    """The ending with one thing more to say at the end of its sentence."""
    return replace(ending, message=f"{ending.message.removesuffix('.')}; {remark}.") if remark else ending


def under_way(journal: Journal) -> Ending:
    """A pass is done and there may be more."""
    return Ending(
        Status.STOPPED, f"Under way: pass {journal.history[-1].number} is done; {_best(journal)}, adapt it to go on."
    )


def interrupted(journal: Journal) -> Ending:
    """Ctrl-C, with something to give back."""
    return Ending(
        Status.STOPPED,
        f"Stopped by Ctrl-C after pass {journal.history[-1].number}; {_best(journal)}, adapt it again to go on.",
    )


def failed(journal: Journal, failure: StepFailed) -> Ending:
    """A step raised on the way to the next pass."""
    error = failure.__cause__
    return Ending(
        Status.FAILED,
        f"Failed in pass {journal.number}, {failure.step}: {_first_line(error)}; "
        f"{_best(journal)}, the exception is in error.",
        error if isinstance(error, Exception) else None,
    )


def _first_line(error: BaseException | None) -> str:
    """Type and first line of an exception, for the middle of a sentence."""
    return ": ".join([type(error).__name__, *str(error).splitlines()[:1]]).rstrip(".")


def _nothing_to_gain(last: Pass) -> Ending:
    return Ending(
        Status.CONVERGED,
        f"Converged: every indicator of pass {last.number} is zero, so the mesh can be used as it is.",
    )


def _converged(journal: Journal, targets: Targets) -> Ending:
    last = journal.history[-1]
    reached = []
    if targets.tolerance is not None:
        reached.append(
            f"the estimate {last.estimate:.4g} of pass {last.number} is within the tolerance {targets.tolerance:.4g}"
        )
    if targets.change is not None:
        reached.append(f"no output changed by more than {_percent(targets.change)} in pass {last.number}")
    return Ending(Status.CONVERGED, f"Converged: {' and '.join(reached)}; {_best(journal)}, use it as it is.")


def _stopped(journal: Journal) -> Ending:
    return Ending(
        Status.STOPPED,
        f"Stopped by the callback after pass {journal.history[-1].number}; {_best(journal)}, adapt it again to go on.",
    )


def _stalls(worths: tuple[float, ...]) -> bool:
    """Whether the last passes together have not lowered the best before them by more than a hair."""
    if len(worths) <= STALL_PASSES:
        return False
    return min(worths[-STALL_PASSES:]) > (1.0 - STALL_GAIN) * min(worths[:-STALL_PASSES])


def _stalled(journal: Journal) -> Ending:
    return Ending(
        Status.STALLED,
        f"Stalled: the last {STALL_PASSES} passes together gained no more than {100 * STALL_GAIN:g} %; "
        f"{_best(journal)}, start from a mesh of more nodes for a smaller error.",
    )


def _max_passes(journal: Journal, targets: Targets) -> Ending:
    number = journal.history[-1].number
    if number == 0:
        return Ending(
            Status.MAX_PASSES, "The input was solved and estimated and nothing moved; ask for passes >= 1 to adapt it."
        )
    return Ending(
        Status.MAX_PASSES,
        f"All passes asked for ({number}) are done{_missed(targets)}; {_best(journal)}, ask for more to go on.",
    )


def _missed(targets: Targets) -> str:
    wanted = []
    if targets.tolerance is not None:
        wanted.append(f"reaching the tolerance {targets.tolerance:.4g}")
    if targets.change is not None:
        wanted.append(f"all outputs settling within {_percent(targets.change)}")
    return f" without {' and '.join(wanted)}" if wanted else ""


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.4g} %"


def _best(journal: Journal) -> str:
    best = journal.history[journal.best_number]
    return f"the result is {f'pass {best.number}' if best.number else 'the input'} (estimate {best.estimate:.4g})"
