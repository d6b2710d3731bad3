"""Measure how the cost of one relocation, the dearest of a loop, grows with the number of nodes."""

import resource
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numba
import numpy as np
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from benchmarks.problems.l_shape import l_shaped_mesh
from benchmarks.table import Cell, markdown

SQUARES = (64, 182, 577)  # per unit of L: 12 545, 99 008 and about a million nodes; the last takes a minute
CUBES = (22, 46, 99)  # along the cube: 12 167, 103 823 and a million nodes
KINDS = ("by element", "callable", "scattered", "tetrahedra")
SMALL = 12_545  # nodes
RUNS = 5  # with at most so many nodes, fewer of larger ones, two at least: the first finds its memory untouched


def report(seeds: Sequence[int], quick: bool) -> str:
    """Microseconds per node, also relative to the smallest mesh, and peak memory of a first relocation.

    The second time is the processor time of the thread that calls, beside which others work: what else runs on the
    machine counts in the first. Every relocation has a process of its own, for peaks of memory only rise. What is
    scattered has a density by element, and nodes and elements are numbered in any order.
    """
    ka.warmup()
    header = ["first relocation", "N", "us per node", "relative", "of the caller", "relative", "peak bytes per node"]
    rows, least = list[list[Cell]](), dict[str, np.ndarray]()
    for kind in KINDS:
        for size in (8, 16) if quick else CUBES if kind == "tetrahedra" else SQUARES:
            with ProcessPoolExecutor(1, get_context("spawn")) as process:
                nodes, micros, memory = process.submit(_cost, size, kind, seeds[0]).result()
            relative = micros / least.setdefault(kind, micros)
            rows.append([kind, nodes, micros[0], relative[0], micros[1], relative[1], memory])
    return f"{markdown(header, rows)}\n\n{numba.config.NUMBA_NUM_THREADS} threads."


def _cost(size: int, kind: str, seed: int) -> tuple[int, np.ndarray, float]:
    """Nodes, microseconds per node by both clocks, peak bytes per node; the density is the exact solution's: nothing is
    solved. The least of a few runs counts."""
    small, mesh = (_mesh(each, kind) for each in (4, size))
    ka.relocate(small, _density)
    if kind == "scattered":
        mesh = _scattered(mesh, np.random.default_rng(seed))
    density = _density if kind == "callable" else _density(mesh.p[:, mesh.t].mean(axis=1))
    nodes, before, seconds = mesh.nvertices, _peak_memory(), []
    for _ in range(max(2, RUNS * SMALL // nodes)):
        start = np.array([time.perf_counter(), time.thread_time()])
        ka.relocate(mesh, density, seed=seed)
        seconds.append(np.array([time.perf_counter(), time.thread_time()]) - start)
    return nodes, 1e6 * np.min(seconds, axis=0) / nodes, (_peak_memory() - before) / nodes


def _mesh(size: int, kind: str) -> MeshTri | MeshTet:
    return MeshTet.init_tensor(*[np.linspace(-1.0, 1.0, size + 1)] * 3) if kind == "tetrahedra" else l_shaped_mesh(size)


def _scattered(mesh: MeshTri, rng: np.random.Generator) -> MeshTri:
    """The same mesh with nodes and elements in any order."""
    nodes, elements = rng.permutation(mesh.p.shape[1]), rng.permutation(mesh.t.shape[1])
    return MeshTri(np.ascontiguousarray(mesh.p[:, nodes]), np.ascontiguousarray(np.argsort(nodes)[mesh.t][:, elements]))


def _density(x: np.ndarray) -> np.ndarray:
    return np.maximum(np.linalg.norm(x, axis=0), 1e-9) ** (-4 / 3)


def _peak_memory() -> int:
    """Largest memory of the process so far, bytes (Linux counts in kilobytes)."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
