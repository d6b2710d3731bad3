"""Find the quickest of many runs to an error, all repeated in turns."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

Call = Callable[[], "Run"]
MARGIN = 1.5  # a run is repeated if its first time is within this factor of the least


@dataclass(frozen=True)
class Run:
    """What a run came to, with its settings; the error in %."""

    settings: str
    unknowns: int
    error: float
    seconds: float


def best_of(sides: Sequence[Sequence[Call]], errors: Iterable[float], repeats: int) -> list[list[Run]]:
    """Return the runs of all sides with the least of their times, the quick ones run `repeats` times in turns.

    Every call is made once. Then those that may be the quickest to an error are repeated, a run of one side after a
    run of the other, so that what else the machine does slows both.
    """
    goals = list(errors)
    found = [[call() for call in calls] for calls in sides]
    close = [sorted({k for goal in goals for k in _candidates(runs, goal)}) for runs in found]
    for _ in range(repeats - 1):
        for turn in range(max(map(len, close), default=0)):
            for runs, calls, chosen in zip(found, sides, close, strict=True):
                if turn < len(chosen):
                    k = chosen[turn]
                    runs[k] = replace(runs[k], seconds=min(runs[k].seconds, calls[k]().seconds))
    return found


def quickest(runs: Sequence[Run], error: float) -> Run | None:
    """Return the run that takes the least time of those that reach the error."""
    return min(_reaching(runs, error), key=lambda run: run.seconds, default=None)


def fewest_unknowns(runs: Sequence[Run], error: float) -> int | None:
    """Return the least number of unknowns that reaches the error."""
    return min((run.unknowns for run in _reaching(runs, error)), default=None)


def _reaching(runs: Sequence[Run], error: float) -> list[Run]:
    return [run for run in runs if run.error <= error]


def _candidates(runs: Sequence[Run], error: float) -> list[int]:
    first = quickest(runs, error)
    if first is None:
        return []
    limit = MARGIN * first.seconds
    return [k for k, run in enumerate(runs) if run.error <= error and run.seconds <= limit]
