"""Conjugate gradients for edge elements by an auxiliary space of vectors."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix, diags_array

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.edges import EdgeElements
from kohonen_adapt.magnetostatics.equations.system import Solver

__all__ = ["EdgeSolver"]

SHIFT = 1e-8  # of the diagonal of the auxiliary matrix, which is singular without prescribed values
DAMPING = 0.5  # of Jacobi's method on the levels of the auxiliary matrix

logger = logging.getLogger("kohonen_adapt")


@dataclass(frozen=True)
class EdgeSolver(Solver):
    """Conjugate gradients for the singular equations of a vector potential.

    No gauge is imposed, because the equations are consistent: the load has no component along gradients. Above `large`
    unknowns the preconditioner solves an auxiliary problem for vectors at the nodes by algebraic multigrid, between two
    sweeps of Gauss and Seidel (Hiptmair and Xu, SIAM J. Numer. Anal. 45, 2007). Its number of steps hardly grows with
    the mesh. Below, or without pyamg, the preconditioner is the diagonal.
    """

    # Steps with Jacobi's preconditioner against the auxiliary space on adapted meshes (`benchmarks coils --bracket`):
    # 22 236 edges 629 against 108, 99 402 edges 1101 against 98, 779 645 edges 59. Below 60 000 edges Jacobi is faster.
    large: int = 60_000
    most_iterations: int = 10_000
    rtol: float = 1e-7  # of the residual; the error of the energy is of second order
    floor: float = 0.0  # residual that is rounding error
    edges: EdgeElements | None = None
    conditions: Conditions | None = None

    def solve(self, matrix: csc_array, right: Floats, prolongation: csr_array | None = None) -> Floats:
        symmetric = csr_matrix(matrix.T)
        inverse = 1.0 / np.where(symmetric.diagonal() > 0.0, symmetric.diagonal(), 1.0)
        auxiliary = self._auxiliary(symmetric) if right.size > self.large else None
        precondition = auxiliary or (lambda residual: inverse * residual)
        bound = max(self.rtol * float(np.linalg.norm(right)), self.floor)
        solution, steps = _conjugate_gradients(symmetric, right, precondition, bound, self.most_iterations)
        logger.debug("Conjugate gradients: %d steps for %d unknowns", steps, right.size)
        if steps >= self.most_iterations:
            raise np.linalg.LinAlgError(
                f"conjugate gradients have not converged in {steps} steps; check for extreme permeabilities or "
                "elements that are almost flat."
            )
        return solution

    def _auxiliary(self, matrix: csr_matrix) -> Callable[[Floats], Floats] | None:
        if find_spec("pyamg") is None or self.edges is None or self.conditions is None:
            return None
        import pyamg
        from pyamg.relaxation.relaxation import gauss_seidel

        conditions, edges = self.conditions, self.edges
        inner = np.ones(edges.mesh.p.shape[1], dtype=bool)
        inner[edges.nodes[:, conditions.fixed]] = False
        if not inner.any():
            return None
        averages = csr_matrix(abs(edges.gradient)[conditions.free][:, np.flatnonzero(inner)])
        half = 0.5 * edges.directions[:, conditions.free].T  # circulation of a vector at one end of an edge
        nodal = _nodal_matrix(matrix, averages, half, conditions)
        levels = pyamg.smoothed_aggregation_solver(
            nodal, symmetry="symmetric", strength=("symmetric", {"theta": 0.1}), max_coarse=200
        ).levels
        lowest, back = np.linalg.pinv(levels[-1].A.toarray(), hermitian=True), csr_matrix(averages.T)

        def precondition(residual: Floats) -> Floats:
            result = np.zeros_like(residual)
            gauss_seidel(matrix, result, residual, 1, "forward")
            rest = conditions.from_classes(residual - matrix @ result)
            vectors = _cycle(levels, lowest, back @ (half * rest[:, None]))
            result += conditions.to_classes(np.sum(half * (averages @ vectors), axis=1))
            gauss_seidel(matrix, result, residual, 1, "backward")
            return result

        return precondition


def _nodal_matrix(matrix: csr_matrix, averages: csr_matrix, half: Floats, conditions: Conditions) -> csr_matrix:
    """Return the matrix of nodal vectors, the same for x, y and z.

    Half the sum over the components is the matrix of ``int nu grad phi . grad phi``, because ``|curl(phi e)|`` is the
    part of grad phi across e.
    """
    total: Any = 0.0
    for component in half.T:
        vectors = diags_array(component) @ averages
        vectors = csr_matrix(vectors if conditions.join is None else conditions.join.T @ vectors)
        total = total + 0.5 * (vectors.T @ (matrix @ vectors))
    nodal = csr_matrix(total)
    diagonal = nodal.diagonal()
    shift = SHIFT * np.where(diagonal > 0.0, diagonal, diagonal.max(initial=1.0))
    nodal = csr_matrix(nodal + diags_array(shift))
    nodal.indices, nodal.indptr = nodal.indices.astype(np.int32), nodal.indptr.astype(np.int32)
    return nodal


def _cycle(levels: list[Any], lowest: Floats, right: Floats) -> Floats:
    if len(levels) == 1:
        return lowest @ right
    matrix = levels[0].A
    step = DAMPING / matrix.diagonal()[:, None]
    result = step * right
    result += levels[0].P @ _cycle(levels[1:], lowest, levels[0].R @ (right - matrix @ result))
    return result + step * (right - matrix @ result)


def _conjugate_gradients(
    matrix: csr_matrix, right: Floats, precondition: Callable[[Floats], Floats], bound: float, most_steps: int
) -> tuple[Floats, int]:
    solution, residual = np.zeros_like(right), right.copy()
    direction, product, steps = np.zeros_like(right), 1.0, 0
    while np.linalg.norm(residual) > bound and steps < most_steps:
        corrected = precondition(residual)
        last, product = product, float(residual @ corrected)
        direction = corrected + (product / last if steps else 0.0) * direction
        image = matrix @ direction
        length = product / float(direction @ image)
        solution += length * direction
        residual -= length * image
        steps += 1
    return solution, steps
