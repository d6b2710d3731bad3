"""Write the lines of the command and, on a terminal, one line for the step that is under way."""

import logging
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO, TypeVar

PROGRESS = "kohonen_adapt.compiling"  # the logger of `kernels/ahead.py`

__all__ = ["Terminal", "drawn", "let_signals_end_the_process"]

Drawn = TypeVar("Drawn")

REMEDY = 'For the picture: pip install "kohonen-adapt[plot]" and run this again.'


def let_signals_end_the_process() -> None:
    """Let Ctrl-C end the process at once, even in a long compiled loop, as SIGTERM does; every file is whole by then.

    Where Ctrl-C is ignored, as in the background of a shell script, it stays so.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


class Terminal(logging.Handler):
    """Standard output and standard error of one command; as a handler it writes remarks of the package."""

    def __init__(self, quiet: bool = False) -> None:
        super().__init__()
        self._quiet = quiet
        self._shown = 0  # columns that the step takes
        self.warnings = list[str]()

    def say(self, said: object) -> None:
        """A line on standard output, unless the command is to be quiet."""
        if not self._quiet:
            self._write_line(said, sys.stdout)

    def complain(self, said: object) -> None:
        """A line on standard error, always."""
        self._write_line(f"kohonen-adapt: {said}", sys.stderr)

    def warn(self, message: Warning | str, *where: Any, **stream: Any) -> None:
        """A warning in one line, in place of `warnings.showwarning`: where in the code it arose helps nobody here."""
        if str(message) not in self.warnings:
            self.warnings.append(str(message))
        self.complain(f"warning: {message}")

    def repeat_warnings(self) -> None:
        """Write every warning again, where the last lines of a long run are read."""
        for message in self.warnings:
            self.complain(f"warning: {message}")

    def emit(self, record: logging.LogRecord) -> None:
        """A remark of the package, on standard error; how far the compilation is, in place of the step."""
        if record.name == PROGRESS:
            self.show(self.format(record))
        else:
            self._write_line(self.format(record), sys.stderr)

    def show(self, step: str) -> None:
        """Show a step in place of the one before, where standard error is a terminal; "" shows none."""
        if not self._quiet and sys.stderr.isatty():
            columns = os.get_terminal_size(sys.stderr.fileno()).columns or 80
            step = step[: columns - 1]
            sys.stderr.write(f"\r{step.ljust(self._shown)}" if step else f"\r{' ' * self._shown}\r")
            sys.stderr.flush()
            self._shown = len(step)

    def _write_line(self, said: object, stream: TextIO) -> None:
        if self._shown:
            self.show("")
        stream.write(f"{said}\n")
        stream.flush()


def drawn(
    terminal: Terminal, folder: Path, draw: Callable[[], Drawn], what: str = "pictures and the report"
) -> Drawn | None:
    """Draw, when everything else is written, and return what that gives; None without matplotlib."""
    terminal.say(f"Results are in {folder}; now {what}, which Ctrl-C leaves out.")
    terminal.show("draw")
    try:
        return draw()
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        terminal.say(REMEDY)
        return None
