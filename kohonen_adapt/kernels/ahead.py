"""Compilation of loops in a second process, with a report of the progress.

numba stores machine code on disk and loads it at the first call of a loop. This process compiles `ENTRIES` in the order
of use, the second process in the opposite order, until they meet.
"""

import gc
import logging
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from numba.core import event

from kohonen_adapt.kernels.compilation import expected, is_kept, may_be_kept, number_of_threads
from kohonen_adapt.kernels.entries import ENTRIES
from kohonen_adapt.kernels.entry import Entry, name_of

__all__ = ["compile_ahead", "compile_each"]

logger = logging.getLogger("kohonen_adapt")
progress = logging.getLogger("kohonen_adapt.compiling")

SECONDS = 0.6  # per entry on one core, for the first message

# Program of the second process. A package without `__init__` makes the import of the kernels fast, from the folder of
# the running package. The process ends with this process, when its standard input is closed.
RUN = """
import os, sys, threading, types
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
sys.path[:] = {path!r}
sys.modules["kohonen_adapt"] = types.ModuleType("kohonen_adapt")
sys.modules["kohonen_adapt"].__path__ = [{package!r}]
from kohonen_adapt.kernels.ahead import compile_each
compile_each({names!r})
"""


def compile_ahead() -> None:
    """Register a second process, which compiles `expected` groups ahead of use."""
    event.register("numba:compile", _compiling)


def compile_each(names: Iterable[str]) -> None:
    gc.disable()
    entries = {entry.name: entry for chapter in ENTRIES.values() for entry in chapter}
    for name in names:
        entries[name].loop.compile(entries[name].types)
        sys.stdout.write(f"{name}\n")
        sys.stdout.flush()


class _Compiling(event.Listener):
    """Listener to the compilations of numba, which occur only without code on disk."""

    def __init__(self) -> None:
        self._waiting: set[str] = set()
        self._number = 0
        self._since = 0.0
        self._depth = 0
        self._collects = True

    def on_start(self, event: Any) -> None:
        if not self._depth:
            self._collects = gc.isenabled()
            gc.disable()  # numba's objects are not freed, and the collector takes 5 % of the time
        self._depth += 1
        function = event.data["dispatcher"].py_func
        if self._depth == 1 and function.__module__.startswith(__package__) and name_of(function) not in self._waiting:
            self._begin(name_of(function), may_be_kept(event.data["dispatcher"]))

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            if self._collects:
                _count_as_old()
                gc.enable()
            self._finish(name_of(event.data["dispatcher"].py_func))

    def _begin(self, name: str, once: bool) -> None:
        """Start the second process on all `expected` groups and the group of this loop.

        `once` is True if code can be stored on disk, without which a second process is useless.
        """
        expected.update(chapter for chapter in ENTRIES if any(name == entry.name for entry in ENTRIES[chapter]))
        entries = [entry for chapter in ENTRIES if chapter in expected for entry in ENTRIES[chapter]]
        missing = [entry for entry in entries if not is_kept(entry.loop, entry.types)]
        self._waiting = {name, *(entry.name for entry in missing)}
        self._number, self._since = len(self._waiting), time.perf_counter()
        helped = len(missing) > 1 and number_of_threads() > 1 and once and self._help(missing)
        seconds = max(1.0, SECONDS * self._number / (2 if helped else 1))
        logger.warning("compiling loops of kohonen_adapt%s (%d, about %.0f s)", ", once" * once, self._number, seconds)

    def _help(self, missing: list[Entry]) -> bool:
        names, package = [entry.name for entry in reversed(missing)], str(Path(__file__).parents[1])
        code = RUN.format(path=sys.path, package=package, names=names)
        hidden = getattr(subprocess, "CREATE_NO_WINDOW", 0)
        pipe, nowhere = subprocess.PIPE, subprocess.DEVNULL
        try:
            helper = subprocess.Popen(
                [sys.executable, "-c", code], stdin=pipe, stdout=pipe, stderr=nowhere, text=True, creationflags=hidden
            )
        except OSError:
            return False
        threading.Thread(target=self._listen, args=(helper,), daemon=True).start()
        return True

    def _listen(self, helper: "subprocess.Popen[str]") -> None:
        for line in helper.stdout or ():
            self._finish(line.strip())
        helper.wait()

    def _finish(self, name: str) -> None:
        if name in self._waiting:
            self._waiting.discard(name)
            done, left = self._number - len(self._waiting), len(self._waiting)
            seconds = (time.perf_counter() - self._since) / done * left
            progress.info("compiled %d of %d loops, about %.0f s to go", done, self._number, seconds)


def _count_as_old() -> None:
    """Move all objects to the oldest generation, which is collected less often."""
    if not gc.get_freeze_count():  # unfreezing would undo the freezing by a user
        gc.freeze()
        gc.unfreeze()


_compiling = _Compiling()
