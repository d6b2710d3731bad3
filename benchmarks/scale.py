"""How the cost of one relocation, the dearest of a loop, grows with the number of nodes."""

import resource
import time
from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.l_shape import l_shaped_mesh
from benchmarks.table import aligned

SQUARES = (18, 57, 182, 577)  # per unit: 10^3 to 10^6 nodes; the last takes some minutes


def report(seeds: Sequence[int], quick: bool) -> str:
    """Seconds, microseconds per node and peak memory of the first relocation of L, from small to large meshes."""
    ka.warmup()
    header = ["scale: first relocation of L", "N", "seconds", "us per node", "peak bytes per node"]
    return aligned(header, [_row(squares, seeds[0]) for squares in SQUARES[: 2 if quick else None]])


def _row(squares: int, seed: int) -> list[str | int | float]:
    """The density is that of the exact solution, so that nothing is solved."""
    mesh = l_shaped_mesh(squares)
    density = np.hypot(*mesh.p[:, mesh.t].mean(axis=1)) ** (-4 / 3)
    nodes, before = mesh.p.shape[1], _peak_memory()
    start = time.perf_counter()
    ka.relocate(mesh, density, seed=seed)
    seconds = time.perf_counter() - start
    return [f"{squares} squares per unit", nodes, seconds, 1e6 * seconds / nodes, (_peak_memory() - before) / nodes]


def _peak_memory() -> int:
    """Largest memory of the process so far, bytes (Linux counts in kilobytes)."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
