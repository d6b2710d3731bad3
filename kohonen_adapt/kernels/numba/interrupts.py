"""Delay of Ctrl-C while numba compiles."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["interrupts_held"]

Handler = Callable[[int, FrameType | None], object]


class _DelayedHandler:
    """Signal handler that stores signals for the original handler."""

    def __init__(self, handler: Handler) -> None:
        self._handler = handler
        self._signals: list[tuple[int, FrameType | None]] = []

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self._signals.append((number, frame))

    def deliver(self) -> None:
        while self._signals:
            self._handler(*self._signals.pop())


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back until the end of the outermost block.

    LLVM calls Python while it makes machine code. A KeyboardInterrupt in such a call would be lost, and numba would
    later raise a RuntimeError because of the incomplete call.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # Python runs handlers in the main thread only
        return
    before = signal.getsignal(signal.SIGINT)
    delayed = before if isinstance(before, _DelayedHandler) else _DelayedHandler(before) if callable(before) else None
    if delayed is None:  # Ctrl-C is ignored or ends the process
        yield
        return
    signal.signal(signal.SIGINT, delayed)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        delayed.deliver()
