"""Measure what the polish of tetrahedra at order 2 takes off the error, at equal unknowns."""

import time
from collections.abc import Sequence

from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET
from benchmarks.table import aligned

CASES = ((EDGE, 8), (CUBE, 12), (FICHERA, 6), (MAGNET, 4))  # cells per unit
QUICK = 2
GRADING, ROUNDS, SWEEPS, PASSES = 4, 3, 4, 4
RATE = 2.0 / 3.0  # of the error over unknowns
STEPS, MOST_STEPS = 1.0 / 3.0, 1.45  # rate of steps of conjugate gradients over unknowns, and limit of their ratio


def report(seeds: Sequence[int], quick: bool) -> str:
    """Unknowns and errors of graded meshes, and the factors by which a polish lowers these at equal unknowns.

    The graded mesh is that of `adapt` by the density alone. Three calls of the polish follow, without and with swaps,
    each with its solution, and `adapt` from the same uniform mesh. Processor time is that of `adapt`, warm. Last are
    the steps of conjugate gradients after `adapt` over those of the graded mesh, at equal unknowns.
    """
    rows = []
    for solid, cells in CASES[: QUICK if quick else None]:
        problem, mesh = Quadratic(solid), solid.mesh(cells)
        for seed in seeds[:1]:
            graded = ka.adapt(mesh, problem, passes=GRADING, polish=False, seed=seed).history[-1].mesh
            start, factors = measured(problem, graded), []
            for topology in ("fixed", "flip"):
                factors.append(factor(start, measured(problem, polished(problem, graded, topology))))
            ka.adapt(mesh, problem, passes=1, seed=seed)  # compiles
            begin = time.process_time()
            result = ka.adapt(mesh, problem, passes=PASSES, seed=seed)
            end = measured(problem, result.mesh)
            seconds = time.process_time() - begin
            steps = end[2] / start[2] * (start[0] / end[0]) ** STEPS
            rows.append([solid.name, *start[:2], *factors, factor(start, end), *end[:2], seconds, steps])
    head = ["", "N", "graded", "sweeps", "and swaps", "adapt", "N", "error", "s", f"CG (limit {MOST_STEPS})"]
    return aligned(head, rows)


def measured(problem: Quadratic, mesh: MeshTet) -> tuple[int, float, int]:
    """Unknowns, error, and steps of conjugate gradients."""
    u, steps = problem.solve_and_count(mesh)
    return mesh.nvertices + mesh.nedges, problem.error(mesh, u), steps


def factor(before: tuple[int, float, int], after: tuple[int, float, int]) -> float:
    """Of the errors, at equal unknowns."""
    return before[1] / after[1] * (before[0] / after[0]) ** RATE


def polished(problem: Quadratic, mesh: MeshTet, topology: str) -> MeshTet:
    """The mesh after so many calls of the polish."""
    for _ in range(ROUNDS):
        mesh = ka.polish(mesh, problem, topology=topology, sweeps=SWEEPS)
    return mesh
