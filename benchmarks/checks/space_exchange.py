"""Measure the error of polished tetrahedra against how much a split is to be worth beside its collapse."""

from collections.abc import Sequence
from unittest.mock import patch

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET, Solid
from benchmarks.table import aligned
from kohonen_adapt.polishing import surgery_in_space

PASSES = 3
MARGINS = (1.2, 1.0, 0.5, 0.35, 0.2, 0.1)
STARTS = ((EDGE, 6), (FICHERA, 5), (MAGNET, 4), (CUBE, 10))
LARGE = ((EDGE, 10), (FICHERA, 8), (MAGNET, 8), (CUBE, 16))


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors in the energy norm after passes of `adapt`; no seed has a say, for nothing in them is random."""
    ka.warmup(space=True)
    header = [f"space-exchange: error after {PASSES} passes, with a margin of", "N", *map(str, MARGINS)]
    rows = [figures(problem, cells) for problem, cells in (STARTS if quick else STARTS + LARGE)]
    costs = ["microseconds per node and polish", *header[1:]]
    return "\n\n".join([aligned(header, [one for one, _ in rows]), aligned(costs, [other for _, other in rows])])


def figures(problem: Solid, cells: int) -> tuple[list[str | int | float], list[str | int | float]]:
    """The errors with every margin, and the microseconds of a polish."""
    mesh = problem.mesh(cells)
    found = [polished(problem, cells, margin) for margin in MARGINS]
    name = [problem.name, mesh.nvertices]
    return [*name, *(error for error, _ in found)], [*name, *(round(cost) for _, cost in found)]


def polished(problem: Solid, cells: int, margin: float) -> tuple[float, float]:
    """The error of the best pass, and microseconds per node and polish."""
    with patch.object(surgery_in_space, "MARGIN", margin):
        result = ka.adapt(problem.mesh(cells), problem, passes=PASSES)
    seconds = np.mean([each.seconds["polish"] for each in result.history[1:]])
    return problem.error(result.mesh, result.solution), 1e6 * float(seconds) / result.mesh.nvertices
