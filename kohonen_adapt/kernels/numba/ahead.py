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
from kohonen_adapt.kernels.numba.clock import OutermostCompilation
from kohonen_adapt.kernels.numba.compilation import expected, number_of_threads
from kohonen_adapt.kernels.numba.entry import Entry, name_of

__all__ = ["compile_ahead", "compile_each"]

logger = logging.getLogger("kohonen_adapt")
progress = logging.getLogger("kohonen_adapt.compiling")

KERNELS = "kohonen_adapt.kernels."
Key = tuple[str, Any]  # name of a loop and types
EACH = [entry for chapter in ENTRIES.values() for entry in chapter]
# Work per loop beside the instructions of its bytecode and of the loops inside, found by timing every entry.
INSTRUCTIONS = 200

# Program of the second process. A package without `__init__` makes the import of the kernels fast, from the folder of
# the running package. The process ends with this process, when its standard input is closed.
RUN = """
import os, sys, threading, types
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
sys.path[:] = {path!r}
sys.modules["kohonen_adapt"] = types.ModuleType("kohonen_adapt")
sys.modules["kohonen_adapt"].__path__ = [{package!r}]
from kohonen_adapt.kernels.numba.ahead import compile_each
compile_each({numbers!r})
"""


def compile_ahead() -> None:
    """Register a second process, which compiles `expected` groups ahead of use."""
    event.register("numba:compile", _compiling)


def compile_each(numbers: Iterable[int]) -> None:
    gc.disable()
    for number in numbers:
        EACH[number].loop.compile(EACH[number].types)
        sys.stdout.write(f"{number}\n")
        sys.stdout.flush()


class _Compiling(OutermostCompilation):
    def __init__(self) -> None:
        super().__init__()
        self._work: dict[Key, int] = {}  # of loops to be compiled, in instructions
        self._count = 0
        self._total = self._first = 0
        self._begun = 0.0
        self._announcement = ""
        self._processes = 1
        self._collects = True

    def begin(self, loop: Any, types: Any) -> None:
        self._collects = gc.isenabled()
        gc.disable()  # numba's objects are not freed, and the collector takes 5 % of the time
        if loop.py_func.__module__.startswith(KERNELS) and (name_of(loop.py_func), types) not in self._work:
            self._plan(loop, types)

    def end(self, loop: Any, types: Any, seconds: float) -> None:
        if self._collects:
            _count_as_old()
            gc.enable()
        self._announce(seconds)
        self._finish((name_of(loop.py_func), types))

    def _plan(self, loop: Any, types: Any) -> None:
        # A second process compiles all `expected` groups, unless code cannot be stored. The first group of `loop` is
        # expected if no other is.
        key = (name_of(loop.py_func), types)
        once = is_cacheable(loop)
        holding = [chapter for chapter in ENTRIES if any(key == entry.key for entry in ENTRIES[chapter])]
        if not expected.intersection(holding):
            expected.update(holding[:1])
        entries = [entry for chapter in ENTRIES if chapter in expected for entry in ENTRIES[chapter]]
        missing = [entry for entry in entries if not is_cached(entry.loop, entry.types)]
        self._work = _instructions({key: loop} | {entry.key: entry.loop for entry in missing})
        self._count = len(self._work)
        self._total = sum(self._work.values())
        self._first = self._work[key]  # kept, because the second process may finish the same loop before
        self._begun = time.perf_counter()
        in_parallel = len(missing) > 1 and number_of_threads() > 1 and once and self._start_second_process(missing)
        self._processes = 2 if in_parallel else 1
        self._announcement = f"compiling loops of kohonen_adapt{', once' * once} ({self._count}, about %.0f s)"

    def _start_second_process(self, missing: list[Entry]) -> bool:
        numbers = [EACH.index(entry) for entry in reversed(missing)]
        package = str(Path(__file__).parents[2])
        code = RUN.format(path=sys.path, package=package, numbers=numbers)
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
            self._finish(EACH[int(line)].key)
        process.wait()

    def _announce(self, seconds: float) -> None:
        if self._announcement:
            # the first loop shows the speed of this machine
            times = max(1.0, self._total / self._first / self._processes)
            logger.warning(self._announcement, max(1.0, seconds * times))
            self._announcement = ""

    def _finish(self, key: Key) -> None:
        if self._work.pop(key, None) is not None:
            done = self._count - len(self._work)
            left = sum(self._work.values())
            seconds = (time.perf_counter() - self._begun) / (self._total - left) * left
            progress.info("compiled %d of %d loops, about %.0f s left", done, self._count, seconds)


def _instructions(loops: dict[Key, Any]) -> dict[Key, int]:
    # of every loop, and of the inner loops at their first caller
    counted: set[Any] = set()
    return {key: INSTRUCTIONS + _instructions_of(loop.py_func, counted) for key, loop in loops.items()}


def _instructions_of(function: Any, counted: set[Any]) -> int:
    if function in counted:
        return 0
    counted.add(function)
    called = (function.__globals__.get(name) for name in function.__code__.co_names)
    inner = sum(_instructions_of(loop.py_func, counted) for loop in called if hasattr(loop, "py_func"))
    return len(function.__code__.co_code) // 2 + inner


def _count_as_old() -> None:
    if not gc.get_freeze_count():  # unfreezing would undo the freezing by a user
        gc.freeze()
        gc.unfreeze()


_compiling = _Compiling()
