"""Measure what sweeps, swaps and exchanges of tetrahedra take off the error."""

from collections.abc import Sequence

from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.solids import EDGE, FICHERA, MAGNET, Solid
from benchmarks.table import aligned

CASES = ((EDGE, 6), (FICHERA, 5), (MAGNET, 4), (EDGE, 10), (FICHERA, 8))  # cells per unit
QUICK = 3
PASSES = 3


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors over that of the graded start after three passes; nothing is random.

    The start is the uniform mesh relocated once with "recycle".
    """
    rows = []
    for problem, cells in CASES[: QUICK if quick else None]:
        mesh = graded(problem, problem.mesh(cells))
        result = ka.adapt(mesh, problem, passes=PASSES)
        ends = polished(problem, mesh, "fixed"), polished(problem, mesh, "flip"), result.mesh
        start, *errors = (problem.error(each, problem.solve(each)) for each in (mesh, *ends))
        rows.append([problem.name, mesh.nvertices, start, *(error / start for error in errors)])
    return aligned(["after 3 passes", "N", "graded", "sweeps", "and swaps", "and exchanges: adapt"], rows)


def graded(problem: Solid, mesh: MeshTet) -> MeshTet:
    """The mesh with its nodes where the residual of its solution wants them."""
    return ka.relocate(mesh, problem.density(mesh, problem.solve(mesh)), topology="recycle")


def polished(problem: Solid, mesh: MeshTet, topology: str) -> MeshTet:
    """The mesh after as many calls of the polish, each with a solution and 8 sweeps."""
    for _ in range(PASSES):
        mesh = ka.polish(mesh, problem, topology=topology)
    return mesh
