"""Time the sweeps of the examples by one process with one thread and by two processes, each in a process of its own."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.table import aligned

EXAMPLES = Path(__file__).parents[2] / "examples"
TARGET = 0.6  # of the time of one process with one thread

# Seconds by the clock, and of the processor: of the one process, or of each of two that share the cases evenly.
_PLAIN = """
import time, kohonen_adapt as ka, {name} as example
(name, values), = example.CASES.items()
ka.warmup()
start, begun = time.perf_counter(), time.process_time()
table = [example.adapted(**{{name: value}}) for value in values]
print(time.perf_counter() - start, time.process_time() - begun)
"""
# The processes are begun after the clock.
_SWEPT = """
import resource, time, kohonen_adapt as ka, {name} as example
ka.warmup()
start = time.perf_counter()
result = ka.sweep(example.adapted, example.CASES)
seconds, used = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
print(seconds, 0.5 * (used.ru_utime + used.ru_stime))
"""

REMARK = (
    "By the clock it tells where two cores are idle; of the processor on a busy machine, too. Python finds its byte\n"
    "code, as that of an installed package."
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Seconds of both, and their ratio beside its target; `quick` leaves one of the examples out."""
    rows = []
    for name in ["actuator_sweep"] if quick else ["actuator_sweep", "motor_sweep"]:
        with tempfile.TemporaryDirectory() as byte_code:
            one, two = (_seconds(code, name, threads, byte_code) for code, threads in ((_PLAIN, 1), (_SWEPT, 2)))
        for how, first, second in zip(("by the clock", "of the processor"), one, two, strict=True):
            verdict = "met" if second <= TARGET * first else "missed"
            rows.append([f"{name}, {how}", first, second, second / first, TARGET, verdict])
    titles = ["30 cases", "one process, one thread (s)", "each of two processes (s)", "ratio", "target", ""]
    return f"{aligned(titles, rows)}\n\n{REMARK}"


def _seconds(code: str, name: str, threads: int, byte_code: str) -> tuple[float, float]:
    paths = os.pathsep.join([str(EXAMPLES), str(EXAMPLES.parent), os.environ.get("PYTHONPATH", "")])
    own = {"PYTHONPATH": paths, "NUMBA_NUM_THREADS": str(threads)}
    own |= {"PYTHONPYCACHEPREFIX": byte_code, "PYTHONDONTWRITEBYTECODE": ""}
    if threads == 1:
        own |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", code.format(name=name)]
    done = subprocess.run(command, env={**os.environ, **own}, capture_output=True, text=True, check=True)
    clock, processor = map(float, done.stdout.split())
    return clock, processor
