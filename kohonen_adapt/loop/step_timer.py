"""Timer of the steps of a pass."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

from kohonen_adapt.checks import check_hook

__all__ = ["StepFailed", "Steps"]

TIMED = ("solve", "estimate", "relocate", "polish")


class StepFailed(Exception):
    def __init__(self, step: str, number: int) -> None:
        super().__init__(step, number)
        self.step, self.number = step, number


class Steps:
    """Timer of the steps of the pass in progress.

    Attributes
    ----------
    number
        Index of the pass in progress.
    has_solved
        True after the first solve of this process, when a failure no longer leaves the loop without a result.
    """

    def __init__(self, progress: Callable[[int, str], Any] | None = None) -> None:
        check_hook("progress", progress, "number and step")
        self.number, self.has_solved = 0, False
        self._progress = progress
        self._seconds: dict[str, float] = {}

    @property
    def seconds(self) -> dict[str, float]:
        return {step: self._seconds.get(step, 0.0) for step in TIMED}

    def next_pass(self, number: int) -> None:
        self.number, self._seconds = number, {}

    def begin(self, number: int, step: str) -> None:
        if self._progress is not None:
            self._progress(number, step)

    @contextmanager
    def __call__(self, step: str, label: str = "", number: int | None = None) -> Iterator[None]:
        # Exceptions before the first solve pass unchanged, later exceptions are raised as `StepFailed`, which names
        # `label` instead of the step if given.
        number = self.number if number is None else number
        self.begin(number, step)
        start = perf_counter()
        try:
            yield
        except Exception as error:
            if not self.has_solved:
                raise
            raise StepFailed(label or step, number) from error
        self._seconds[step] = self._seconds.get(step, 0.0) + perf_counter() - start
