"""Time the sweeps of the examples by one process with one thread and by two processes, each in a process of its own."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.table import aligned

EXAMPLES = Path(__file__).parents[2] / "examples"
TARGET = 0.6  # of the time of one process with one thread

_PLAIN = """
import time, kohonen_adapt as ka, {name} as example
(name, values), = example.CASES.items()
ka.warmup()
start = time.perf_counter()
table = [example.adapted(**{{name: value}}) for value in values]
print(time.perf_counter() - start)
"""
# The processes are begun after the clock.
_SWEPT = """
import time, kohonen_adapt as ka, {name} as example
ka.warmup()
start = time.perf_counter()
result = ka.sweep(example.adapted, example.CASES)
print(time.perf_counter() - start)
"""


def report(seeds: Sequence[int], quick: bool) -> str:
    """Seconds of both, and their ratio beside its target; `quick` leaves the longer one out."""
    rows = []
    for name in ["actuator_sweep"] if quick else ["actuator_sweep", "motor_sweep"]:
        one, two = _seconds(_PLAIN, name, threads=1), _seconds(_SWEPT, name, threads=2)
        rows.append([name, one, two, two / one, TARGET, "met" if two <= TARGET * one else "missed"])
    titles = ["30 cases", "one process, one thread (s)", "two processes (s)", "ratio", "target", ""]
    return aligned(titles, rows)


def _seconds(code: str, name: str, threads: int) -> float:
    paths = os.pathsep.join([str(EXAMPLES), str(EXAMPLES.parent), os.environ.get("PYTHONPATH", "")])
    own = {"PYTHONPATH": paths, "NUMBA_NUM_THREADS": str(threads)}
    if threads == 1:
        own |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", code.format(name=name)]
    done = subprocess.run(command, env={**os.environ, **own}, capture_output=True, text=True, check=True)
    return float(done.stdout)
