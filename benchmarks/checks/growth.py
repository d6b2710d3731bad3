"""Measure what one more pass over all nodes takes off the error of a mesh that was grown from a coarse one."""

import time
from collections.abc import Sequence

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.peers.methods import first_figure
from benchmarks.problems.cases import Case, cases
from benchmarks.table import aligned

NODES = {"L": (84, 800, 3100), "F": (84, 800, 3200), "M": (1800, 5150), "C": (844, 2532), "H": (972,)}
QUICK = 1
PASSES = (2, 3, 4)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Error and seconds after so many passes, and of one more over those of these; medians over the seeds."""
    ka.warmup()
    header = ["growth", "from", "to N", "passes", "last but one", "error", "seconds", "one more: error", "seconds"]
    rows = [
        row(cases(letter, quick=True)[0], nodes, passes, seeds)
        for letter, wanted in NODES.items()
        for nodes in wanted[: QUICK if quick else None]
        for passes in PASSES
    ]
    return aligned(header, rows)


def row(case: Case, nodes: int, passes: int, seeds: Sequence[int]) -> list[str | int | float]:
    """One number of nodes, one number of passes."""
    start = case.coarse()
    runs = [run(case, start, nodes, passes, seed) for seed in seeds]
    before, error, seconds, more, longer = np.median(runs, axis=0)
    return [case.name, int(start.nvertices), nodes, passes, int(before), error, seconds, more / error, longer / seconds]


def run(case: Case, start: MeshTri, nodes: int, passes: int, seed: int) -> tuple[int, float, float, float, float]:
    """Nodes of the last mesh but one, error and seconds, and both with one more pass over the mesh that came out."""
    begin = time.perf_counter()
    grown = ka.adapt(start, case.problem, passes=passes, target_nodes=nodes, seed=seed)
    middle = time.perf_counter()
    more = ka.adapt(grown.mesh, case.problem, passes=1, seed=seed)
    end, twice = time.perf_counter(), sum(more.history[0].seconds.values())  # it is solved already
    errors = [first_figure(case, result.mesh, result.solution) for result in (grown, more)]
    return grown.history[-2].mesh.nvertices, errors[0], middle - begin, errors[1], end - begin - twice
