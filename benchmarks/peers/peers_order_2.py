"""Compare polished tetrahedra of order 2 with refinement, Mmg3d and limits, at equal numbers of unknowns."""

import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.peers import wheels
from benchmarks.peers.mmg_space import mmg_in_space
from benchmarks.peers.space_remeshing import adapted, sizes
from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET
from benchmarks.table import aligned

CASES = (
    (EDGE, 8, 13_949, 0.0030), (CUBE, 12, 14_929, 0.00110), (FICHERA, 6, 13_565, 0.0114), (MAGNET, 4, 9_997, 0.0053),
    (EDGE, 10, 26_447, 0.00205), (CUBE, 15, 28_447, 0.00070),
)  # cells per unit, unknowns that errors are scaled to, and the limit of the error there  # fmt: skip
QUICK = 2
PASSES = 4
BULK = 0.5  # of the squared estimate: what refinement marks, after Doerfler
TARGET_OF_TIME = 0.6  # of Mmg3d's
RATE = 2.0 / 3.0  # of the error over unknowns
FLOORS = (0.2, 0.1)
MMG = "Mmg3d"
Solved = tuple[MeshTet, np.ndarray]
Method = Callable[[int], Solved]  # by seed
HEADER = ("unknowns", "error", "of the limit", "least quality", "CPU s")


def report(seeds: Sequence[int], quick: bool) -> str:
    """A table for every problem: errors scaled to the same unknowns, medians over seeds."""
    ka.adapt(EDGE.mesh(2), Quadratic(EDGE), passes=2)  # compiles all that is needed
    missing = [line for line in [wheels.missing("mmgpy")] if line]
    tables = [table(Quadratic(solid), *case, seeds) for solid, *case in CASES[: QUICK if quick else None]]
    return "\n\n".join([*tables, *missing])


def table(problem: Quadratic, cells: int, unknowns: int, limit: float, seeds: Sequence[int]) -> str:
    """All methods on one problem, and how long this package takes to the limit."""
    rows, start = [], problem.solid.mesh(cells)
    for name, method in methods(problem, start, unknowns).items():
        runs = [described(problem, method, seed, unknowns) for seed in (seeds if name.startswith("this") else [0])]
        count, error, worst, seconds = np.median(runs, axis=0)
        rows.append([name, str(round(count)), error, error / limit, worst, seconds])
    compared = aligned([f"{problem.solid.name}, at {unknowns} unknowns, limit {limit}", *HEADER], rows)
    mmg = next((row[-1] for row in rows if row[0] == MMG), None)
    return f"{compared}\n\n{to_limit(problem, start, unknowns, limit, mmg, seeds)}"


def to_limit(
    problem: Quadratic, start: MeshTet, unknowns: int, limit: float, mmg: float | None, seeds: Sequence[int]
) -> str:
    """For every floor the fewest passes that come to the limit of the error, and their time over Mmg3d's loop."""
    rows = []
    for floor in FLOORS:
        for passes in range(1, PASSES + 1):
            method = partial(ours, problem, start, passes, True, floor)
            _, error, _, seconds = np.median([described(problem, method, seed, unknowns) for seed in seeds], axis=0)
            if error <= limit:
                break
        rows.append([floor, passes, error, limit, seconds, mmg, mmg and seconds / mmg, TARGET_OF_TIME])
    return aligned(["to the limit: floor", "passes", "error", "limit", "CPU s", "Mmg3d's", "ratio", "target"], rows)


def methods(problem: Quadratic, start: MeshTet, unknowns: int) -> dict[str, Method]:
    """Refinement and Mmg3d, and this package without a polish and with floors of the quality."""
    found: dict[str, Method] = {"refined by scikit-fem": lambda _: refined(problem, unknowns)}
    if not wheels.missing("mmgpy"):
        found[MMG] = lambda _: remeshed(problem, start)
    found["this package, graded"] = partial(ours, problem, start, PASSES, False, FLOORS[0])
    for floor in FLOORS:
        found[f"this package, floor {floor}"] = partial(ours, problem, start, PASSES, True, floor)
    return found


def ours(problem: Quadratic, start: MeshTet, passes: int, polish: bool, floor: float, seed: int) -> Solved:
    """What this package makes of the start."""
    result = ka.adapt(start, problem, passes=passes, polish=polish, min_quality=floor, seed=seed)
    return result.mesh, result.solution


def remeshed(problem: Quadratic, start: MeshTet) -> Solved:
    """What Mmg3d's loop makes of the start, which ends with a mesh that is not solved yet."""
    mesh = problem.solid.named(adapted(problem, start, sizes, mmg_in_space))
    return mesh, problem.solve(mesh)


def described(problem: Quadratic, method: Method, seed: int, unknowns: int) -> tuple[float, ...]:
    """Unknowns, error scaled to `unknowns`, least quality, and processor time with all solves."""
    began = time.process_time()
    mesh, u = method(seed)
    seconds, count = time.process_time() - began, u.size
    return count, problem.error(mesh, u) * (count / unknowns) ** RATE, float(ka.quality(mesh).min()), seconds


def refined(problem: Quadratic, unknowns: int) -> Solved:
    """scikit-fem's adaptive refinement of the coarsest mesh, where it comes nearest to a number of unknowns.

    Names are asked of the problem again for every solution, as in `peers_in_space`.
    """
    mesh, meshes = problem.solid.coarsest(), list[Solved]()
    while True:
        named = problem.solid.named(mesh)
        u = problem.solve(named)
        meshes.append((named, u))
        if u.size >= unknowns:
            return min(meshes, key=lambda each: abs(np.log(each[1].size / unknowns)))
        eta = problem.indicators(named, u) ** 2
        order = np.argsort(-eta)
        last = np.searchsorted(np.cumsum(eta[order]), BULK * eta.sum())
        mesh = mesh.refined(np.sort(order[: last + 1]))
