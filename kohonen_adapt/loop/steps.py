"""Time the steps of a pass, tell who listens, and name the step that failed."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

from kohonen_adapt.checks import check_hook

__all__ = ["StepFailed", "Steps"]

TIMED = ("solve", "estimate", "relocate", "polish")


class StepFailed(Exception):
    """The failure of a step of pass `number`, with the exception as its cause."""

    def __init__(self, step: str, number: int) -> None:
        super().__init__(step, number)
        self.step, self.number = step, number


class Steps:
    """The steps of the pass in the making.

    Attributes
    ----------
    number
        Of that pass.
    begun
        Whether a mesh was solved in this process, so that there is something to give back if a step fails.
    """

    def __init__(self, progress: Callable[[int, str], Any] | None = None) -> None:
        check_hook("progress", progress, "number and step")
        self.number, self.begun = 0, False
        self._progress = progress
        self._seconds: dict[str, float] = {}

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of the steps so far."""
        return {step: self._seconds.get(step, 0.0) for step in TIMED}

    def next_pass(self, number: int) -> None:
        """Begin to count the seconds of pass `number`."""
        self.number, self._seconds = number, {}

    def begin(self, number: int, step: str) -> None:
        """Tell who listens that a step of pass `number` begins."""
        if self._progress is not None:
            self._progress(number, step)

    @contextmanager
    def __call__(self, step: str, failing: str = "", number: int | None = None) -> Iterator[None]:
        """Time one step; what goes wrong before a mesh was solved stays as it is, later it is a `StepFailed`.

        That says what was `failing`, where it is not the step as a whole. The pass is the one in the making, if no
        `number` of another is given.
        """
        number = self.number if number is None else number
        self.begin(number, step)
        start = perf_counter()
        try:
            yield
        except Exception as error:
            if not self.begun:
                raise
            raise StepFailed(failing or step, number) from error
        self._seconds[step] = self._seconds.get(step, 0.0) + perf_counter() - start
