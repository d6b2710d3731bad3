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

from kohonen_adapt.kernels.entries import ENTRIES
from kohonen_adapt.kernels.numba.cache import is_cacheable, is_cached
from kohonen_adapt.kernels.numba.compilation import expected, number_of_threads
from kohonen_adapt.kernels.numba.entry import Entry, name_of

__all__ = ["compile_ahead", "compile_each"]

logger = logging.getLogger("kohonen_adapt")
progress = logging.getLogger("kohonen_adapt.compiling")

KERNELS = "kohonen_adapt.kernels."
SECONDS = 0.6  # per entry on one core, for the first message

# Program of the second process. A package without `__init__` makes the import of the kernels fast, from the folder of
# the running package. The process ends with this process, when its standard input is closed.
RUN = """
import os, sys, threading, types
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
sys.path[:] = {path!r}
sys.modules["kohonen_adapt"] = types.ModuleType("kohonen_adapt")
sys.modules["kohonen_adapt"].__path__ = [{package!r}]
from kohonen_adapt.kernels.numba.ahead import compile_each
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
    def __init__(self) -> None:
        self._remaining: set[str] = set()
        self._total = 0
        self._start = 0.0
        self._depth = 0
        self._collects = True

    def on_start(self, event: Any) -> None:
        if not self._depth:
            self._collects = gc.isenabled()
            gc.disable()  # numba's objects are not freed, and the collector takes 5 % of the time
        self._depth += 1
        function = event.data["dispatcher"].py_func
        if self._depth == 1 and function.__module__.startswith(KERNELS) and name_of(function) not in self._remaining:
            self._begin(name_of(function), is_cacheable(event.data["dispatcher"]))

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
        missing = [entry for entry in entries if not is_cached(entry.loop, entry.types)]
        self._remaining = {name, *(entry.name for entry in missing)}
        self._total, self._start = len(self._remaining), time.perf_counter()
        in_parallel = len(missing) > 1 and number_of_threads() > 1 and once and self._start_second_process(missing)
        seconds = max(1.0, SECONDS * self._total / (2 if in_parallel else 1))
        logger.warning("compiling loops of kohonen_adapt%s (%d, about %.0f s)", ", once" * once, self._total, seconds)

    def _start_second_process(self, missing: list[Entry]) -> bool:
        names, package = [entry.name for entry in reversed(missing)], str(Path(__file__).parents[2])
        code = RUN.format(path=sys.path, package=package, names=names)
        flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)
        pipe, devnull = subprocess.PIPE, subprocess.DEVNULL
        try:
            process = subprocess.Popen(
                [sys.executable, "-c", code], stdin=pipe, stdout=pipe, stderr=devnull, text=True, creationflags=flags
            )
        except OSError:
            return False
        threading.Thread(target=self._read_progress, args=(process,), daemon=True).start()
        return True

    def _read_progress(self, process: "subprocess.Popen[str]") -> None:
        for line in process.stdout or ():
            self._finish(line.strip())
        process.wait()

    def _finish(self, name: str) -> None:
        if name in self._remaining:
            self._remaining.discard(name)
            done, left = self._total - len(self._remaining), len(self._remaining)
            seconds = (time.perf_counter() - self._start) / done * left
            progress.info("compiled %d of %d loops, about %.0f s left", done, self._total, seconds)


def _count_as_old() -> None:
    if not gc.get_freeze_count():  # unfreezing would undo the freezing by a user
        gc.freeze()
        gc.unfreeze()


_compiling = _Compiling()
