"""Time spent on compiling in this process."""

from time import perf_counter
from typing import Any

from numba.core import event

__all__ = ["seconds_compiling"]


class _Clock(event.Listener):
    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0
        self._start = 0.0

    def on_start(self, event: Any) -> None:
        if not self._depth:
            self._start = perf_counter()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if not self._depth:
            self.seconds += perf_counter() - self._start


_clock = _Clock()
event.register("numba:compile", _clock)


def seconds_compiling() -> float:
    return _clock.seconds
