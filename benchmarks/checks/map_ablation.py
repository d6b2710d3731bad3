"""Measure what the Kohonen map and sweeps bring, in a metric and by density, beside recycling and energy descent."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.cases import CASES, Case
from benchmarks.table import Cell, markdown

NODES = {"C": (899, 2983), "M": (1681,), "L": (3201,), "F": (3201,), "H": (441,)}  # of the start meshes
QUICK = {"H": (441,)}
MAGNET = "mu_r = 1000"  # the magnet over iron, one of two of problem M
PASSES = (1, 3)
NOTHING = {"schedule": ka.Schedule(())}


def smoothed(sweeps: int) -> dict[str, Any]:
    """Sweeps alone, as many as the default schedule has after the map without a polish."""
    return {"schedule": ka.Schedule((), sweeps=sweeps)}


PLAIN, KEPT, BY_DENSITY = {"polish": False}, {"topology": "flip"}, {"anisotropic": False}
MOVERS: dict[str, dict[str, Any]] = {"map": {}, "sweeps": smoothed(2), "neither": NOTHING}
RECYCLED = {f"metric, {name}": mover for name, mover in MOVERS.items()} | {
    f"density, {name}": mover | BY_DENSITY for name, mover in MOVERS.items()
}
UNPOLISHED = {f"no polish, {name}": PLAIN | mover for name, mover in RECYCLED.items()}
NUMBERED = {
    f"numbers kept, {name}": KEPT | mover | (smoothed(6) if "sweeps" in name else {})
    for name, mover in RECYCLED.items()
}


def report(seeds: Sequence[int], quick: bool) -> str:
    """Table in Markdown of the errors after one and after three passes at equal nodes, medians over the seeds."""
    ka.warmup()
    chosen = list(_chosen(QUICK if quick else NODES))
    header = ["", *(f"{case.name.partition(',')[0]} {case.start().nvertices}" for case in chosen)]
    ways = RECYCLED | UNPOLISHED | NUMBERED
    return markdown(header, [[name, *(_cell(case, name, ways[name], seeds) for case in chosen)] for name in ways])


def _chosen(nodes: dict[str, tuple[int, ...]]) -> Iterator[Case]:
    for letter, counts in nodes.items():
        for case in CASES[letter]:
            if case.start().nvertices in counts and (letter != "M" or MAGNET in case.name):
                yield case


def _cell(case: Case, name: str, keywords: dict[str, Any], seeds: Sequence[int]) -> Cell:
    if name in UNPOLISHED and not hasattr(case.problem, "ritz"):
        return None  # never polished
    return " / ".join(f"{error(case, passes, keywords, seeds):#.4g}" for passes in PASSES)


def error(case: Case, passes: int, keywords: dict[str, Any], seeds: Sequence[int]) -> float:
    """Of the case after so many passes, median over the seeds."""
    mesh = case.start()
    results = [ka.adapt(mesh, case.problem, passes=passes, seed=seed, **keywords) for seed in seeds]
    return float(np.median([case.error(each.mesh, each.solution) for each in results]))
