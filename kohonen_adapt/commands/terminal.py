"""What the command shows while it works: lines, below them the step that is under way, and the way out by Ctrl-C."""

import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Event, RLock, Thread, current_thread, main_thread
from typing import Any, NamedTuple, NoReturn, TextIO, TypeVar

from tqdm import tqdm

from kohonen_adapt.files import remove_drafts

__all__ = ["Interrupted", "LineHandler", "Terminal"]

PERIOD = 0.1  # s between two looks at what is going on
DELAY = 0.5  # s: what ends sooner shows no progress
FORM = "{desc} {bar:12} {elapsed}{postfix}"
INTERRUPTIONS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

Result = TypeVar("Result")


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, or SIGTERM, while a thread that nobody can stop is still at work."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Terminated(KeyboardInterrupt):
    """SIGTERM, which ends the command as Ctrl-C does."""


class _Bar(tqdm):
    monitor_interval = 0  # no thread that redraws: who waits for the work does


class _Shown(NamedTuple):
    """A step, how many of how many came before it, and what is known."""

    step: str
    done: int
    total: int
    known: str


class Terminal:
    """Standard output and standard error of one command."""

    def __init__(self, quiet: bool = False) -> None:
        self._hint = ""
        self._quiet = quiet
        self._shown = _Shown("", 0, 1, "")
        self._folders: list[Path] = []
        self._to_be_left, self._left = Event(), Event()
        tqdm.set_lock(RLock())  # of threads alone: there is no other process to share the terminal with

    def say(self, said: object) -> None:
        """A line on standard output, unless the command is to be quiet."""
        if not self._quiet:
            _line(str(said), sys.stdout)

    def complain(self, said: object) -> None:
        """A line on standard error, always."""
        _line(f"kohonen-adapt: {said}", sys.stderr)

    def warn(
        self,
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        """A warning in one line, in place of `warnings.showwarning`: where in the code it arose helps nobody here."""
        self.complain(f"warning: {message}")

    def show(self, step: str, done: int, total: int, known: str = "") -> None:
        """Show a step from now on, where standard error is a terminal: the steps before it and in all, what is known.

        Callable from any thread.
        """
        self._shown = _Shown(step, done, total, known)

    def hint(self, hint: str) -> None:
        """Say that from now on beside that the command was interrupted."""
        self._hint = hint

    def writes_to(self, folder: Path) -> None:
        """Drafts of files in this folder are to go when the command is interrupted."""
        self._folders.append(folder)

    def leave_signals(self) -> None:
        """From now on to the end of the work Ctrl-C and SIGTERM end the process as the system does it, without a word.

        For the thread that works, when it has written all that must not be lost: it may then call loops of C that keep
        Python's lock, in which no handler could run.
        """
        self._to_be_left.set()
        self._left.wait()

    def wait_for(self, work: Callable[[], Result]) -> Result:
        """Do the work in a thread of its own, so that Ctrl-C gets through however long a loop of it runs.

        Raises
        ------
        Interrupted
            If Ctrl-C or SIGTERM came before it was done; the thread is then still at work.
        Exception
            What the work raises.
        """
        outcome: Future[Result] = Future()
        thread = Thread(target=_settle, args=(work, outcome), daemon=True)
        with _sigterm_interrupts():
            try:
                thread.start()
                self._watch(outcome)
            except KeyboardInterrupt as interrupt:
                signal.signal(signal.SIGINT, signal.SIG_IGN)  # once is enough
                number = signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT
                raise Interrupted(number) from None
        return outcome.result()

    def leave(self, interrupt: Interrupted) -> NoReturn:
        """End the process at once, for the thread may be in a compiled loop that runs for minutes."""
        for folder in self._folders:
            with suppress(OSError):  # the thread is still at work in it; a later run removes what is left
                remove_drafts(folder, os.getpid())
        word = INTERRUPTIONS[signal.Signals(interrupt.number)]
        sys.stderr.write(f"kohonen-adapt: {'; '.join([word, self._hint] if self._hint else [word])}.\n")
        sys.stderr.flush()
        os._exit(128 + interrupt.number)

    def _watch(self, outcome: Future[Result]) -> None:
        """Wait until the work is done, and show it if that takes long."""
        with ExitStack() as signals:
            for _ in range(round(DELAY / PERIOD)):
                if self._waited(outcome, signals):
                    return
            self._redraw(outcome, signals)

    def _waited(self, outcome: Future[Result], signals: ExitStack) -> bool:
        """Whether the work is done, after a while; signals are left to the system if it wants that."""
        done = bool(wait([outcome], PERIOD).done)
        if self._to_be_left.is_set() and not self._left.is_set():
            if current_thread() is main_thread():
                signals.enter_context(_signals_left())
            self._left.set()
        return done

    def _redraw(self, outcome: Future[Result], signals: ExitStack) -> None:
        hidden = True if self._quiet else None  # None: if it is no terminal
        with _Bar(
            bar_format=FORM, leave=False, disable=hidden, delay=DELAY, dynamic_ncols=True, file=sys.stderr
        ) as bar:
            if not bar.disable:
                bar.start_t -= DELAY  # it is as old as the work
            while not self._waited(outcome, signals):
                if not bar.disable:
                    _draw(bar, self._shown)


def _draw(bar: tqdm, shown: _Shown) -> None:
    bar.n, bar.total = shown.done, shown.total
    bar.set_description_str(shown.step, refresh=False)
    bar.set_postfix_str(shown.known, refresh=False)
    bar.refresh()


def _line(said: str, stream: TextIO) -> None:
    """A line, at once, with the step that is shown moved below it."""
    tqdm.write(said, file=stream)
    stream.flush()


def _settle(work: Callable[[], Result], outcome: Future[Result]) -> None:
    try:
        outcome.set_result(work())
    except BaseException as error:  # whatever it is, it is raised where the outcome is asked for
        outcome.set_exception(error)


@contextmanager
def _sigterm_interrupts() -> Iterator[None]:
    """Let SIGTERM do what Ctrl-C does; only the main thread hears of either."""

    def terminate(number: int, frame: Any) -> None:
        raise Terminated

    if current_thread() is not main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _signals_left() -> Iterator[None]:
    """Leave Ctrl-C and SIGTERM to the system, but what is ignored (in the background); only the main thread can."""
    heard = [number for number in INTERRUPTIONS if callable(signal.getsignal(number))]
    before = {number: signal.signal(number, signal.SIG_DFL) for number in heard}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class LineHandler(logging.Handler):
    """Remarks of the package as lines on standard error, above the step that is shown."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one."""
        _line(self.format(record), sys.stderr)
