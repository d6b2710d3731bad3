"""Measure how the cost of one relocation, the dearest of a loop, grows with the number of nodes."""

import resource
import time
from collections.abc import Sequence

import numba
import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.l_shape import l_shaped_mesh
from benchmarks.table import aligned

SQUARES = (64, 182, 577)  # per unit: 12 545, 99 008 and about a million nodes; the last takes some minutes
GROWTH = 2.0  # time per node at a million nodes over that of the smallest mesh
MEMORY = 1000  # bytes per node beyond the mesh, at the peak


def report(seeds: Sequence[int], quick: bool) -> str:
    """Microseconds per node, also relative to the smallest mesh, and peak memory of the first relocation of L."""
    ka.warmup()
    header = [
        "scale: first relocation of L",
        "N",
        "us per node",
        "relative",
        "limit",
        "",
        "peak bytes per node",
        "limit",
    ]
    costs = [_cost(squares, seeds[0]) for squares in ((16, 32) if quick else SQUARES)]
    rows, threads = [], f"{numba.config.NUMBA_NUM_THREADS} threads"
    for nodes, micros, memory in costs:
        relative = micros / costs[0][1]
        rows.append([threads, nodes, micros, relative, GROWTH, _verdict(relative <= GROWTH)])
        rows[-1] += [memory, MEMORY, _verdict(memory <= MEMORY)]
    return aligned([*header, ""], rows)


def _verdict(met: bool) -> str:
    return "met" if met else "missed"


def _cost(squares: int, seed: int) -> tuple[int, float, float]:
    """Nodes, microseconds per node, peak bytes per node; the density is the exact solution's: nothing is solved."""
    mesh = l_shaped_mesh(squares)
    density = np.hypot(*mesh.p[:, mesh.t].mean(axis=1)) ** (-4 / 3)
    nodes, before = mesh.p.shape[1], _peak_memory()
    start = time.perf_counter()
    ka.relocate(mesh, density, seed=seed)
    seconds = time.perf_counter() - start
    return nodes, 1e6 * seconds / nodes, (_peak_memory() - before) / nodes


def _peak_memory() -> int:
    """Largest memory of the process so far, bytes (Linux counts in kilobytes)."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
