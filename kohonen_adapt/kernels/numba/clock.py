"""Time spent on compiling in this process."""

from time import perf_counter
from typing import Any

from numba.core import event

__all__ = ["OutermostCompilation", "seconds_compiling"]


class OutermostCompilation(event.Listener):
    """Listener to the compilation of loops, without the loops inside."""

    def __init__(self) -> None:
        self._depth = 0
        self._start = 0.0

    def begin(self, loop: Any, types: Any) -> None: ...

    def end(self, loop: Any, types: Any, seconds: float) -> None: ...

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth == 1:
            self._start = perf_counter()
            self.begin(event.data["dispatcher"], event.data["args"])

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if not self._depth:
            self.end(event.data["dispatcher"], event.data["args"], perf_counter() - self._start)


class _Clock(OutermostCompilation):
    def __init__(self) -> None:
        super().__init__()
        self.seconds = 0.0

    def end(self, loop: Any, types: Any, seconds: float) -> None:
        self.seconds += seconds


_clock = _Clock()
event.register("numba:compile", _clock)


def seconds_compiling() -> float:
    return _clock.seconds
