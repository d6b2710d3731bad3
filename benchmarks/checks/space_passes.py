"""Measure densities with and without directions on tetrahedra, in how many passes, and what 10^5 nodes reach."""

from collections.abc import Sequence

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET, Solid
from benchmarks.table import aligned

CASES = ((EDGE, 6), (FICHERA, 5), (MAGNET, 4), (CUBE, 10), (EDGE, 10), (FICHERA, 8))  # cells per unit
QUICK = 2
LARGE = ((EDGE, (14, 31)), (FICHERA, (10, 24)))  # cells per unit with about 10^4 and 10^5 nodes
PASSES, PASSES_LARGE = 4, 3
STEPS = ("solve", "estimate", "relocate", "polish")


def report(seeds: Sequence[int], quick: bool) -> str:
    """The least error after so many passes, either way, and microseconds per node of the steps of a pass."""
    ka.adapt(EDGE.mesh(2), EDGE, passes=2)  # compiles all that is needed
    rows = [row for case in CASES[: QUICK if quick else None] for row in compared(*case)]
    errors = [f"after {number}" for number in range(1, PASSES + 1)]
    few = aligned(["space: density", "of", "N", "error", *errors, *STEPS], rows)
    if quick:
        return few
    header = [f"space: {PASSES_LARGE} passes", "N", "uniform", "error", "error N^(1/3)", *STEPS]
    return f"{few}\n\n{aligned(header, [rated(problem, cells) for problem, sizes in LARGE for cells in sizes])}"


def compared(problem: Solid, cells: int) -> list[list[str | int | float]]:
    """Rows of a run and of runs of one pass each, which begin with a density every time, round and with directions."""
    rows = []
    for anisotropic, kind in ((False, "round"), (True, "directions")):
        run = ka.adapt(problem.mesh(cells), problem, passes=PASSES, anisotropic=anisotropic).history
        every = [run[0]]
        for _ in range(PASSES):
            every.append(ka.adapt(every[-1].mesh, problem, passes=1, anisotropic=anisotropic).history[-1])
        rows += [row(problem, f"{kind}, two passes", run), row(problem, f"{kind}, every pass", every)]
    return rows


def row(problem: Solid, word: str, steps: Sequence[ka.Pass]) -> list[str | int | float]:
    """Errors of the best pass so far, by the functional, and mean times."""
    nodes = steps[0].mesh.nvertices
    start, *found = (np.sqrt(2.0 * (step.functional - problem.energy)) for step in steps)
    spent = [1e6 * np.mean([step.seconds[name] for step in steps[1:]]) / nodes for name in STEPS]
    return [word, problem.name, nodes, start, *np.minimum.accumulate(found), *spent]


def rated(problem: Solid, cells: int) -> list[str | int | float]:
    """A row of a run: its error, also times N^(1/3), which is the same for all N where the order is kept."""
    run = ka.adapt(problem.mesh(cells), problem, passes=PASSES_LARGE).history
    _, name, nodes, uniform, *rest = row(problem, "", run)
    reached, *spent = rest[PASSES_LARGE - 1 :]
    return [name, nodes, uniform, reached, reached * nodes ** (1 / 3), *spent]
