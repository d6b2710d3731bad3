"""Direct and multigrid solvers of linear systems."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix
from scipy.sparse.linalg import LinearOperator, SuperLU, cg

from kohonen_adapt.arrays import Floats
from kohonen_adapt.mesh.elements.assembly import symmetric_factors

__all__ = ["IN_SPACE", "Solver"]

TOLERANCE = 1e-10  # residual of multigrid, relative to the right-hand side


@dataclass(frozen=True)
class Solver:
    """Solver of symmetric positive definite systems.

    Parameters
    ----------
    large
        Number of unknowns above which multigrid is used.
    most_iterations
        Maximum number of iterations of conjugate gradients; 20 to 30 are usual.
    rtol
        Largest residual of conjugate gradients, relative to the right-hand side.
    """

    # Direct against multigrid on square grids (`benchmarks large`): 101 761 unknowns 0.4 - 0.9 s against 1.1 - 3.1 s,
    # 408 321 unknowns 3.9 - 10.1 s against 3.7 - 5.1 s, 808 201 unknowns 28 s against 7 s.
    large: int = 300_000
    most_iterations: int = 200
    rtol: float = TOLERANCE

    def solve(self, matrix: csc_array, right: Floats, prolongation: csr_array | None = None) -> Floats:
        solution = self.by_multigrid(matrix, right, prolongation) if right.size > self.large else None
        return factorised(matrix).solve(right) if solution is None else solution

    def in_order(self, matrix: csc_array, right: Floats) -> Floats:
        solution = self.by_multigrid(matrix, right) if right.size > self.large else None
        return factorised(matrix, "NATURAL").solve(right) if solution is None else solution

    def by_multigrid(self, matrix: csc_array, right: Floats, prolongation: csr_array | None = None) -> Floats | None:
        """Return the solution, or None if pyamg is missing or does not converge.

        With a prolongation multigrid is for the coarse functions alone.
        """
        if find_spec("pyamg") is None or not np.isfinite(matrix.data).all():
            return None
        csr, iterations = as_csr(matrix), self.most_iterations
        if prolongation is None:
            solution = aggregated(csr).solve(right, tol=self.rtol, maxiter=iterations, accel="cg")
        else:
            cycle = LinearOperator(csr.shape, matvec=two_level_cycle(csr, prolongation), dtype=np.float64)
            solution, _ = cg(csr, right, rtol=self.rtol, maxiter=iterations, M=cycle)
        residual = np.linalg.norm(right - csr @ solution)
        return solution if residual <= 10.0 * self.rtol * np.linalg.norm(right) else None


def as_csr(matrix: csc_array) -> csr_matrix:
    # CSC of a symmetric matrix is CSR; pyamg requires indices of 32 bits.
    indices, starts = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
    return csr_matrix((matrix.data, indices, starts), shape=matrix.shape)


def aggregated(matrix: csr_matrix) -> Any:
    import pyamg

    # Interpolation of least energy uses no random numbers and a fifth of the time of the default. Without the threshold
    # of strength, elements of order 2 with an aspect ratio of 20 take ten times as many iterations.
    coupled = ("symmetric", {"theta": 0.1})
    return pyamg.smoothed_aggregation_solver(matrix, symmetry="symmetric", strength=coupled, smooth=("energy", {}))


def two_level_cycle(matrix: csr_matrix, prolongation: csr_array) -> Callable[[Floats], Floats]:
    # A symmetric V-cycle. Aggregation of all unknowns of order 2 takes three to five times the time
    # (`benchmarks space-order-2`).
    from pyamg.relaxation.relaxation import gauss_seidel

    coarse = aggregated(as_csr((prolongation.T @ matrix @ prolongation).tocsc())).aspreconditioner()

    def cycle(residual: Floats) -> Floats:
        change = np.zeros_like(residual)
        gauss_seidel(matrix, change, residual, sweep="forward")
        change += prolongation @ (coarse @ (prolongation.T @ (residual - matrix @ change)))
        gauss_seidel(matrix, change, residual, sweep="backward")
        return change

    return cycle


# Factors fill more in space. Direct against multigrid on boxes of magnets (`benchmarks magnets`): 8379 nodes 0.25 s
# against 0.18 s, 43 956 nodes 17 s against 3.9 s.
IN_SPACE = Solver(large=8_000)


def factorised(matrix: csc_array, order: str = "MMD_AT_PLUS_A") -> SuperLU:
    try:
        return symmetric_factors(matrix, order)
    except RuntimeError as error:
        raise np.linalg.LinAlgError(
            f"the equations of the potential are singular ({error}); check for extreme permeabilities or elements "
            "that are almost flat."
        ) from error
