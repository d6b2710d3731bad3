"""A second process that ends the first when Ctrl-C comes while some loop of C does not even let Python hear of it.

Most loops release Python's lock, and then the main thread answers. Where one does not (matplotlib drawing 10^5
elements), only the part of Python's handler that is written in C still runs: it writes the number of the signal to the
guard's pipe. This file is also what the guard runs, without the package, so that it is small and there at once.
"""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

__all__ = ["INTERRUPTIONS", "Guard", "farewell", "guarded"]

INTERRUPTIONS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

GRACE = 0.8  # s from the signal on, in which the process may end by itself


class Guard:
    """The way to the process that is the guard."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe

    def tell(self, hint: str) -> None:
        """What to say beside that the command was interrupted."""
        with suppress(OSError):  # a guard that is gone needs no hint
            os.write(self._pipe, f"{hint}\n".encode())


@contextmanager
def guarded() -> Iterator[Guard | None]:
    """Start a guard of this process, from its main thread; None where there can be none.

    Ctrl-C must be followed by the end of the process, which the guard then sees to.
    """
    read, write = os.pipe()
    os.set_blocking(write, False)
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", __file__, str(os.getpid())], stdin=read, start_new_session=True
        )
    except OSError:
        os.close(write)
        yield None
        return
    finally:
        os.close(read)
    before, needed = signal.set_wakeup_fd(write, warn_on_full_buffer=False), False
    try:
        yield Guard(write)
    except KeyboardInterrupt:
        needed = True  # until the process is gone: a loop may take the lock even now
        raise
    finally:
        if not needed:
            signal.set_wakeup_fd(before)
            os.close(write)
            process.wait()


def farewell(number: int, hint: str) -> str:
    """The last line of a command that a signal ended."""
    word = INTERRUPTIONS[signal.Signals(number)]
    return f"kohonen-adapt: {'; '.join([word, hint] if hint else [word])}.\n"


def _keep_watch(process: int) -> None:
    """Read hints and signals until the process is gone, or must go because a signal came and nothing happened."""
    signals, heard = bytes(INTERRUPTIONS), b""
    while not any(number in heard for number in signals):
        piece = os.read(0, 4096)
        if not piece:
            return
        heard += piece
    until = time.monotonic() + GRACE
    while (left := until - time.monotonic()) > 0.0:
        if select.select([0], [], [], left)[0] and not os.read(0, 4096):
            return
    os.kill(process, signal.SIGKILL)
    number = next(each for each in heard if each in signals)
    hints = heard.translate(None, signals).decode(errors="replace").splitlines()
    sys.stderr.write(farewell(number, hints[-1] if hints else ""))


if __name__ == "__main__":
    _keep_watch(int(sys.argv[1]))
