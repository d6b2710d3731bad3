"""Time a relocation of tetrahedra with recycling and a pass of `adapt` on one thread and on two, in own processes."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from zlib import crc32

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.solids import FICHERA
from benchmarks.table import aligned

THREADS = (1, 2)
CELLS = {"relocate": 16, "pass": 8}  # per unit: 31 841 and 4401 nodes
PASSES = 3
REPEATS = 3
SCRIPT = "from benchmarks.checks.space_threads import told; print(told({quick}))"


def report(seeds: Sequence[int], quick: bool) -> str:
    """Microseconds per node, of the clock and of the processor in the calling thread, and whether meshes are the same.

    The clock counts on an idle machine only. Nothing depends on seeds.
    """
    found = [in_own_process(threads, quick) for threads in THREADS]
    rows = []
    for k, what in enumerate(CELLS):
        (clock, cpu, of_one), (shared, own, of_two) = (row[3 * k : 3 * k + 3] for row in found)
        times = [float(each) for each in (clock, shared, cpu, own)]
        rows.append([what, *times, times[3] / times[2], "yes" if of_one == of_two else "NO"])
    header = ["space: us/node", "clock, 1 thread", "2 threads", "CPU, 1 thread", "first of 2", "ratio", "same mesh"]
    return aligned(header, rows)


def in_own_process(threads: int, quick: bool) -> list[str]:
    """What `told` says where there are so many threads."""
    command = [sys.executable, "-c", SCRIPT.format(quick=quick)]
    environment = {**os.environ, "NUMBA_NUM_THREADS": str(threads)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()


def told(quick: bool) -> str:
    """Microseconds per node, and the mesh as a number, of a relocation and of a pass."""
    large = FICHERA.mesh(CELLS["relocate"] // (2 if quick else 1))
    density, small = FICHERA.density(large, FICHERA.solve(large)), FICHERA.mesh(CELLS["pass"])
    found = (
        *timed(lambda: ka.relocate(large, density, topology="recycle"), large.nvertices),
        *timed(lambda: ka.adapt(small, FICHERA, passes=PASSES).mesh, PASSES * small.nvertices),
    )
    return " ".join(map(str, found))


def timed(make: Callable[[], MeshTet], nodes: int) -> tuple[float, float, int]:
    """Medians of both times by node, a run before them that compiles not counted; and the mesh as a number."""
    mesh, times = make(), list[tuple[float, float]]()
    for _ in range(REPEATS):
        began = time.perf_counter(), time.thread_time()
        mesh = make()
        times.append((time.perf_counter() - began[0], time.thread_time() - began[1]))
    clock, own = 1e6 * np.median(times, axis=0) / nodes
    return clock, own, crc32(mesh.t.tobytes(), crc32(mesh.p.tobytes()))
