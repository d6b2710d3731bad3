"""Time a relocation of tetrahedra with recycling and a pass of `adapt` on one thread and on two, in own processes."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from zlib import crc32

from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.solids import FICHERA
from benchmarks.table import aligned

THREADS = (1, 2)
CELLS = {"relocate": 16, "pass": 8}  # per unit: 31 841 and 4401 nodes
PASSES = 3
REPEATS = 5  # of which the quickest counts, as others may be at work on the machine
SCRIPT = "from benchmarks.checks.space_threads import told; print(told({quick}))"


def report(seeds: Sequence[int], quick: bool) -> str:
    """Microseconds per node, of the clock, and whether the meshes are the same; nothing depends on seeds."""
    found = [in_own_process(threads, quick) for threads in THREADS]
    rows = []
    for k, what in enumerate(CELLS):
        (one, of_one), (two, of_two) = (row[2 * k : 2 * k + 2] for row in found)
        rows.append([what, float(one), float(two), float(two) / float(one), "yes" if of_one == of_two else "NO"])
    return aligned(["space: us/node", "1 thread", "2 threads", "ratio", "same mesh"], rows)


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
        *least(lambda: ka.relocate(large, density, topology="recycle"), large.nvertices),
        *least(lambda: ka.adapt(small, FICHERA, passes=PASSES).mesh, PASSES * small.nvertices),
    )
    return " ".join(map(str, found))


def least(make: Callable[[], MeshTet], nodes: int) -> tuple[float, int]:
    """The time of the quickest run by node, one before them that compiles not counted; and its mesh as a number."""
    mesh, times = make(), list[float]()
    for _ in range(REPEATS):
        began = time.perf_counter()
        mesh = make()
        times.append(time.perf_counter() - began)
    return 1e6 * min(times) / nodes, crc32(mesh.t.tobytes(), crc32(mesh.p.tobytes()))
