"""Time `adapt` to a tolerance on tetrahedra beside scikit-fem's adaptive refinement from the same coarse mesh."""

import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, MAGNET, Solid
from benchmarks.table import Cell, markdown

SOLIDS = (EDGE, FICHERA, CUBE, MAGNET)
TOLERANCES = {1: (0.1,), 2: (0.02, 0.005)}  # of the energy norm, by order
SCALES = {1: 1.0 / 3.6, 2: 1.0 / 5.5}  # error over residual, by order
BULK = 0.5  # of the squared estimate: what refinement marks, after Doerfler


class Stated:
    """A problem of `Solid` with a calibrated estimate, for tolerances."""

    calibrated = True

    def __init__(self, solid: Solid, order: int) -> None:
        self.solid, self.order = solid, order
        self.problem = Quadratic(solid) if order == 2 else solid
        self.solve, self.ritz = self.problem.solve, self.problem.ritz

    def indicators(self, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
        return SCALES[self.order] * self.problem.indicators(mesh, u)

    def energy_norm(self, mesh: MeshTet, u: np.ndarray) -> float:
        return float(np.sqrt(self.problem.work(mesh, u)))

    def error(self, mesh: MeshTet, u: np.ndarray) -> float:
        """Of a solution, relative to the energy norm."""
        return self.problem.error(mesh, u) / np.sqrt(-2.0 * self.solid.energy)


class Run(NamedTuple):
    seconds: float
    unknowns: int
    error: float  # relative


def report(seeds: Sequence[int], quick: bool) -> str:
    """Seconds, unknowns and errors over tolerance of both, and their ratios; refinement stops at the true error."""
    rows = []
    for order in (2,) if quick else (1, 2):
        ka.adapt(EDGE.mesh(2), Stated(EDGE, order), passes=2)  # compiles
        for solid in SOLIDS[: 2 if quick else None]:
            rows += list(_rows(Stated(solid, order), TOLERANCES[order][: 1 if quick else None]))
    header = ["to an error in space", "order", "rtol", "refined, s", "unknowns", "error / tol"]
    header += ["adapt, s", "unknowns", "error / tol", "time ratio", "of the unknowns"]
    return markdown(header, rows)


def _rows(problem: Stated, tolerances: Sequence[float]) -> Iterator[list[Cell]]:
    for rtol in tolerances:
        both = refined(problem, rtol), adapted(problem, rtol)
        row: list[Cell] = [problem.solid.name, problem.order, rtol]
        for run in both:
            row += [run.seconds, str(run.unknowns), run.error / rtol]
        yield [*row, both[1].seconds / both[0].seconds, both[1].unknowns / both[0].unknowns]


def refined(problem: Stated, rtol: float) -> Run:
    """Refine until the true error is within the tolerance; only solutions, estimates and refinement are timed."""
    mesh, seconds = problem.solid.coarsest(), 0.0
    while True:
        began = time.process_time()
        named = problem.solid.named(mesh)
        u = problem.solve(named)
        seconds += time.process_time() - began
        error = problem.error(named, u)
        if error <= rtol:
            return Run(seconds, u.size, error)
        began = time.process_time()
        squares = problem.indicators(named, u) ** 2
        order = np.argsort(-squares)
        last = np.searchsorted(np.cumsum(squares[order]), BULK * squares.sum())
        mesh = mesh.refined(np.sort(order[: last + 1]))
        seconds += time.process_time() - began


def adapted(problem: Stated, rtol: float) -> Run:
    began = time.process_time()
    result = ka.adapt(problem.solid.coarsest(), problem, rtol=rtol)
    seconds = time.process_time() - began
    return Run(seconds, result.best.unknowns, problem.error(result.mesh, result.solution))
