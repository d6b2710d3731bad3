"""Measure what the Kohonen map and the sweeps of smoothing bring beside recycling and energy descent."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.cases import Case, cases
from benchmarks.table import Cell, markdown

NODES = {"C": (899, 2983), "M": (1681,), "L": (3201,), "F": (3201,), "H": (441,)}  # of the start meshes
QUICK = {"C": (899,), "H": (441,)}
MAGNET = "mu_r = 1000"  # the magnet over iron, one of two of problem M
PASSES = (1, 3)
NOTHING = ka.Schedule(())
ONE_EPOCH = ka.Schedule((ka.Stage(1, 1, 0.45),))


def smoothed(sweeps: int) -> dict[str, Any]:
    """Sweeps alone, as many as the default schedule has after the map."""
    return {"schedule": ka.Schedule((), sweeps=sweeps)}


PLAIN, KEPT = {"polish": False}, {"topology": "flip"}
RECYCLED: dict[str, dict[str, Any]] = {
    "default: map, sweeps, recycling, polish": {},
    "without the map": smoothed(4),
    "one epoch of the map, no sweeps": {"schedule": ONE_EPOCH},
    "neither map nor sweeps": {"schedule": NOTHING},
}
UNPOLISHED: dict[str, dict[str, Any]] = {
    "no polish": PLAIN,
    "no polish, without the map": PLAIN | smoothed(4),
    "no polish, neither map nor sweeps": PLAIN | {"schedule": NOTHING},
}
NUMBERED: dict[str, dict[str, Any]] = {
    "numbers kept (`flip`)": KEPT,
    "numbers kept, without the map": KEPT | smoothed(6),
    "numbers kept, neither map nor sweeps": KEPT | {"schedule": NOTHING},
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
        for case in cases(letter):
            if case.start().nvertices in counts and (letter != "M" or MAGNET in case.name):
                yield case


def _cell(case: Case, name: str, keywords: dict[str, Any], seeds: Sequence[int]) -> Cell:
    if name in UNPOLISHED and not hasattr(case.problem, "ritz"):
        return None  # never polished
    return " / ".join(f"{error(case, passes, keywords, seeds):#.4g}" for passes in PASSES)


def error(case: Case, passes: int, keywords: dict[str, Any], seeds: Sequence[int]) -> float:
    """The first figure of the case after so many passes, median over the seeds."""
    mesh = case.start()
    results = [ka.adapt(mesh, case.problem, passes=passes, seed=seed, **keywords) for seed in seeds]
    return float(np.median([next(iter(case.figures(each.mesh, each.solution).values())) for each in results]))
