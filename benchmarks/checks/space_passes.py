"""Measure in how many passes over tetrahedra a density should place nodes before all is left to the energy."""

from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET, Solid
from benchmarks.table import aligned
from kohonen_adapt.loop.rooms import ROOMS
from kohonen_adapt.mesh.cells import TETRAHEDRON

CASES = ((EDGE, 6), (FICHERA, 5), (MAGNET, 4), (CUBE, 10), (EDGE, 10), (FICHERA, 8))  # cells per unit
QUICK = 2
COUNTS = (1, 2, 3)  # passes of a density
PASSES = 4
STEPS = ("solve", "estimate", "relocate", "polish")


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors after three and after four passes, and microseconds per node of the steps of the first four."""
    ka.adapt(EDGE.mesh(2), EDGE, passes=2)  # compiles all that is needed
    rows = [row for case in CASES[: QUICK if quick else None] for row in compared(*case)]
    errors = [f"error after {number}" for number in range(1, PASSES + 1)]
    return aligned(["space: passes by density", "of", "N", "start", *errors, *STEPS], rows)


def compared(problem: Solid, cells: int) -> list[list[str | int | float | None]]:
    """A row for every number of passes that a density places nodes in; errors are those of the best pass so far."""
    mesh = problem.mesh(cells)
    rows = []
    for count in COUNTS:
        history = passes(problem, cells, count).history
        start, *found = (np.sqrt(2.0 * (step.functional - problem.energy)) for step in history)
        best = [*np.minimum.accumulate(found), *[None] * (PASSES - len(found))]
        spent = [1e6 * np.mean([step.seconds[name] for step in history[1:]]) / mesh.nvertices for name in STEPS]
        rows.append([str(count), problem.name, mesh.nvertices, start, *best, *spent])
    return rows


def passes(problem: Solid, cells: int, count: int) -> ka.AdaptResult:
    """A run whose nodes a density places in so many passes."""
    room = ROOMS[TETRAHEDRON.dim]
    ROOMS[TETRAHEDRON.dim] = room._replace(by_density=count)
    try:
        return ka.adapt(problem.mesh(cells), problem, passes=PASSES)
    finally:
        ROOMS[TETRAHEDRON.dim] = room
