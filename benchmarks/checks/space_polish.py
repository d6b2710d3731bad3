"""Measure what sweeps, swaps and exchanges of tetrahedra take off the error, and what each costs."""

import time
from collections.abc import Sequence

from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.solids import EDGE, FICHERA, MAGNET, Solid
from benchmarks.table import aligned
from kohonen_adapt import Rules
from kohonen_adapt.outline.movable_solid import MovableSolid
from kohonen_adapt.outline.surgery import unchanged
from kohonen_adapt.polishing.polish_in_space import descend_and_recycle_in_space
from kohonen_adapt.polishing.solid_functional import SolidFunctional

CASES = ((EDGE, 6), (FICHERA, 5), (MAGNET, 4), (EDGE, 10), (FICHERA, 8), (MAGNET, 8))  # cells per unit
QUICK = 3
PASSES = 3
# Topology of the polish, and sweeps with exchanges between the numbers.
WAYS = {
    "sweeps": ("fixed", (8,)),
    "and swaps": ("flip", (8,)),
    "4, 4": ("flip", (4, 4)),
    "4, 4, 4": ("flip", (4, 4, 4)),
    "2, 2, 2, 2": ("flip", (2, 2, 2, 2)),
}


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors over that of the graded start after three passes, and microseconds per node in the first and all passes.

    The start is the uniform mesh relocated once with "recycle". Nothing is random.
    """
    polished(EDGE, EDGE.mesh(2), *WAYS["4, 4"])  # compiles all that is needed
    errors, costs = [], []
    for problem, cells in CASES[: QUICK if quick else None]:
        mesh = graded(problem, problem.mesh(cells))
        start = problem.error(mesh, problem.solve(mesh))
        found = [polished(problem, mesh, *way) for way in WAYS.values()]
        errors.append([problem.name, mesh.nvertices, start, *(error / start for error, _ in found)])
        costs.append([problem.name, mesh.nvertices, *(f"{first:.0f}, {whole:.0f}" for _, (first, whole) in found)])
    after = aligned(["after 3 passes", "N", "graded", *WAYS], errors)
    return f"{after}\n\n{aligned(['us per node: first pass, all three', 'N', *WAYS], costs)}"


def graded(problem: Solid, mesh: MeshTet) -> MeshTet:
    """The mesh with its nodes where the residual of its solution wants them."""
    return ka.relocate(mesh, problem.density(mesh, problem.solve(mesh)), topology="recycle")


def polished(problem: Solid, mesh: MeshTet, topology: str, plan: tuple[int, ...]) -> tuple[float, tuple[float, float]]:
    """The error after passes, each with a solution, and processor time of the first polish and of all, per node."""
    movable, seconds = MovableSolid.of(mesh, Rules(topology)), []
    for _ in range(PASSES):
        ritz = problem.ritz(mesh, problem.solve(mesh))
        began = time.process_time()
        functional = SolidFunctional.of(ritz, movable, mesh)
        start = unchanged(movable.tetrahedralization)
        descend_and_recycle_in_space(movable, functional, functional.solution.copy(), start, plan)
        seconds.append(1e6 * (time.process_time() - began) / mesh.nvertices)
        mesh = movable.mesh()
    return problem.error(mesh, problem.solve(mesh)), (seconds[0], sum(seconds))
