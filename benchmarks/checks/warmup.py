"""Time the first compile, a start from the cache, and the import, each in a process of its own."""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence

from benchmarks.table import aligned

_COMPILE = (
    "import time, kohonen_adapt as ka; start = time.perf_counter(); ka.warmup(); print(time.perf_counter() - start)"
)
_IMPORT = (
    "import time, skfem, numba; start = time.perf_counter(); import kohonen_adapt; print(time.perf_counter() - start)"
)
# Seconds of processor time of every function, what it calls left out, when one process compiles them all.
_EACH = """
import json, time
from numba.core import event

spent, open_ = {}, []

class Timed(event.Listener):
    def on_start(self, event):
        open_.append([time.process_time(), 0.0])
    def on_end(self, event):
        begun, inside = open_.pop()
        seconds, function = time.process_time() - begun, event.data["dispatcher"].py_func
        name = f"{function.__module__.removeprefix('kohonen_adapt.kernels.')}.{function.__name__}"
        spent[name] = spent.get(name, 0.0) + seconds - inside
        if open_:
            open_[-1][1] += seconds

event.register("numba:compile", Timed())
import kohonen_adapt as ka
ka.warmup()
print(json.dumps(spent))
"""
DEAREST = 15


def report(seeds: Sequence[int], quick: bool) -> str:
    """Seconds beside their targets."""
    with tempfile.TemporaryDirectory() as cache:
        first, _, said = _seconds(_COMPILE, cache)
        warm, whole, _ = _seconds(_COMPILE, cache)
        extra = min(_seconds(_IMPORT, cache)[0] for _ in range(3))
    rows = [
        ["every kernel, empty cache", first, 20.0],
        ["as announced", sum(map(float, re.findall(r"about (\d+) s", said))), None],
        ["every kernel, next process", warm, 2.0],
        ["that process as a whole, imports included", whole, None],
        ["import beyond scikit-fem and numba", extra, 1.0],
    ]
    table = aligned(["warmup", "seconds", "target", ""], [[*row, _verdict(*row[1:])] for row in rows])
    return f"{table}\n\n{_dearest()}"


def _dearest() -> str:
    """The functions that take longest to compile, by one process, and the files."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "NUMBA_NUM_THREADS": "1"}
        command = [sys.executable, "-c", _EACH]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    spent = json.loads(done.stdout)
    order = sorted(spent, key=spent.__getitem__, reverse=True)
    rows = [[name, spent[name]] for name in order[:DEAREST]]
    rows.append([f"all {len(order)}", sum(spent.values())])
    return f"{aligned(['the dearest functions', 'seconds'], rows)}\n\n{_files(spent)}"


def _files(spent: dict[str, float]) -> str:
    """Seconds by the file that functions stand in, the dearest first."""
    files: dict[str, float] = {}
    for name, seconds in spent.items():
        file = name.rpartition(".")[0]
        files[file] = files.get(file, 0.0) + seconds
    order = sorted(files, key=files.__getitem__, reverse=True)
    return aligned(["file", "seconds"], [[file, files[file]] for file in order])


def seconds_of_first_use() -> float:
    """Seconds to compile every kernel."""
    with tempfile.TemporaryDirectory() as cache:
        return _seconds(_COMPILE, cache)[0]


def _seconds(code: str, cache: str) -> tuple[float, float, str]:
    """What the code prints, the wall time of its process, and what it says on standard error."""
    start = time.perf_counter()
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    return float(done.stdout), time.perf_counter() - start, done.stderr


def _verdict(seconds: float, target: float | None) -> str:
    if target is None:
        return ""
    return "met" if seconds <= target else "missed"
