"""Measure how the cost of one relocation, the dearest of a loop, grows with the number of nodes."""

import resource
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numba
import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.l_shape import l_shaped_mesh
from benchmarks.table import Cell, markdown

SQUARES = (64, 182, 577)  # per unit: 12 545, 99 008 and about a million nodes; the last takes a minute
GROWTH = 2.0  # time per node at a million nodes over that of the smallest mesh
MEMORY = 1000  # bytes per node beyond the mesh, at the peak
KINDS = ("by element", "callable", "scattered")
RUNS = 5  # of the smallest mesh, fewer of larger ones, two at least: the first finds its memory untouched


def report(seeds: Sequence[int], quick: bool) -> str:
    """Microseconds per node, also relative to the smallest mesh, and peak memory of the first relocation of L.

    The second time is the processor time of the thread that calls, beside which others work: what else runs on the
    machine counts in the first. Every relocation has a process of its own, for peaks of memory only rise. What is
    scattered has a density by element, and nodes and elements are numbered in any order.
    """
    ka.warmup()
    header = ["scale: first relocation of L", "N", "density", "us per node", "relative", "limit", "", "of caller"]
    header += ["relative", "peak bytes per node", "limit", ""]
    threads, rows, least = f"{numba.config.NUMBA_NUM_THREADS} threads", list[list[Cell]](), dict[str, np.ndarray]()
    for squares in (16, 32) if quick else SQUARES:
        for kind in KINDS:
            with ProcessPoolExecutor(1, get_context("spawn")) as process:
                nodes, micros, memory = process.submit(_cost, squares, kind, seeds[0]).result()
            relative = micros / least.setdefault(kind, micros)
            rows.append([threads, nodes, kind, micros[0], relative[0], GROWTH, _verdict(relative[0] <= GROWTH)])
            rows[-1] += [micros[1], relative[1], memory, MEMORY, _verdict(memory <= MEMORY)]
    return markdown(header, rows)


def _verdict(met: bool) -> str:
    return "met" if met else "missed"


def _cost(squares: int, kind: str, seed: int) -> tuple[int, np.ndarray, float]:
    """Nodes, microseconds per node by both clocks, peak bytes per node; the density is the exact solution's: nothing is
    solved. The least of a few runs counts."""
    ka.relocate(l_shaped_mesh(8), _density)
    mesh = l_shaped_mesh(squares)
    if kind == KINDS[2]:
        mesh = _scattered(mesh, np.random.default_rng(seed))
    density = _density if kind == KINDS[1] else _density(mesh.p[:, mesh.t].mean(axis=1))
    nodes, before, seconds = mesh.p.shape[1], _peak_memory(), []
    for _ in range(max(2, RUNS * SQUARES[0] ** 2 // squares**2)):
        start = np.array([time.perf_counter(), time.thread_time()])
        ka.relocate(mesh, density, seed=seed)
        seconds.append(np.array([time.perf_counter(), time.thread_time()]) - start)
    return nodes, 1e6 * np.min(seconds, axis=0) / nodes, (_peak_memory() - before) / nodes


def _scattered(mesh: MeshTri, rng: np.random.Generator) -> MeshTri:
    """The same mesh with nodes and elements in any order."""
    nodes, elements = rng.permutation(mesh.p.shape[1]), rng.permutation(mesh.t.shape[1])
    return MeshTri(np.ascontiguousarray(mesh.p[:, nodes]), np.ascontiguousarray(np.argsort(nodes)[mesh.t][:, elements]))


def _density(x: np.ndarray) -> np.ndarray:
    return np.maximum(np.hypot(*x), 1e-9) ** (-4 / 3)


def _peak_memory() -> int:
    """Largest memory of the process so far, bytes (Linux counts in kilobytes)."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
