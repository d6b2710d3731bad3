"""Output of the command, with a line for the current step on a terminal."""

import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO, TypeVar

PROGRESS = "kohonen_adapt.compiling"  # the logger of `kernels/numba/ahead.py`

__all__ = ["Terminal", "drawn", "let_signals_end_the_process", "without_broken_pipes"]

Drawn = TypeVar("Drawn")

REMEDY = 'Pictures need matplotlib: pip install "kohonen-adapt[plot]", then run the command again.'


def let_signals_end_the_process() -> None:
    # An ignored Ctrl-C, as in the background of a shell script, stays ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


class Terminal(logging.Handler):
    def __init__(self, quiet: bool = False) -> None:
        super().__init__()
        self._quiet = quiet
        self._shown = 0  # columns of the step
        self.warnings = list[str]()

    def say(self, *texts: object) -> None:
        for text in texts:
            if text and not self._quiet:
                self._write_line(text, sys.stdout)

    def complain(self, text: object) -> None:
        self._write_line(f"kohonen-adapt: {text}", sys.stderr)

    def warn(self, message: Warning | str, *where: Any, **stream: Any) -> None:
        if str(message) not in self.warnings:
            self.warnings.append(str(message))
        self.complain(f"warning: {message}")

    def repeat_warnings(self) -> None:
        for message in self.warnings:
            self.complain(f"warning: {message}")

    def emit(self, record: logging.LogRecord) -> None:
        if record.name == PROGRESS:
            self.show(self.format(record))
        else:
            self._write_line(self.format(record), sys.stderr)

    def show(self, step: str) -> None:
        if not self._quiet and sys.stderr.isatty():
            columns = os.get_terminal_size(sys.stderr.fileno()).columns or 80
            step = step[: columns - 1]
            sys.stderr.write(f"\r{step.ljust(self._shown)}" if step else f"\r{' ' * self._shown}\r")
            sys.stderr.flush()
            self._shown = len(step)

    def _write_line(self, text: object, stream: TextIO) -> None:
        if self._shown:
            self.show("")
        try:
            stream.write(f"{text}\n")
            stream.flush()
        except BrokenPipeError:
            discard(stream)


def discard(stream: TextIO) -> None:
    # The reader of a pipe, such as `head`, has ended. Results are written all the same.
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@contextmanager
def without_broken_pipes() -> Iterator[None]:
    try:
        yield
    finally:  # argparse leaves its text to the end of the process
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except BrokenPipeError:
                discard(stream)


def drawn(
    terminal: Terminal, folder: Path, draw: Callable[[], Drawn], what: str = "pictures and the report"
) -> Drawn | None:
    terminal.say(f"Results are in {folder}. Drawing {what}; Ctrl-C skips this step.")
    terminal.show("draw")
    try:
        return draw()
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        terminal.say(REMEDY)
        return None
