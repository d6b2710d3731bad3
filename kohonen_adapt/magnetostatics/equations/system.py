"""Direct and multigrid solvers of linear systems."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix
from scipy.sparse.linalg import LinearOperator, SuperLU, cg

from kohonen_adapt.arrays import Floats, Function, Ints
from kohonen_adapt.magnetostatics.equations.schwarz import added_corrections
from kohonen_adapt.mesh.elements.assembly import Subspaces, symmetric_factors

__all__ = ["IN_SPACE", "Solver"]

TOLERANCE = 1e-10  # residual of conjugate gradients, relative to the right-hand side
MOST_WITH_STARS = 1000  # iterations; 50 are usual, 200 with three layers at edges of iron
ENTRIES = 15  # per row of a matrix of order 1 in space


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

    # Direct against multigrid on square grids: 101 761 unknowns 0.4 - 0.9 s against 1.1 - 3.1 s,
    # 408 321 unknowns 3.9 - 10.1 s against 3.7 - 5.1 s, 808 201 unknowns 28 s against 7 s.
    large: int = 300_000
    most_iterations: int = 200
    rtol: float = TOLERANCE

    def solve(self, matrix: csc_array, right: Floats, subspaces: Subspaces | None = None) -> Floats:
        solution = None
        if subspaces and subspaces.stars and matrix.nnz > ENTRIES * self.large:
            solution = self.by_stars(matrix, right, *subspaces)
        elif right.size > self.large:
            solution = self.by_multigrid(matrix, right, subspaces and subspaces.prolongation)
        return factorised(matrix).solve(right) if solution is None else solution

    def by_stars(
        self, matrix: csc_array, right: Floats, prolongation: csr_array, stars: Sequence[Ints]
    ) -> Floats | None:
        """Return the solution of a high order in space, or None if not converged."""
        if not np.isfinite(matrix.data).all():
            return None
        csr, restricted = as_csr(matrix), prolongation.T @ matrix
        coarse, in_stars = self.preconditioner((restricted @ prolongation).tocsc()), added_corrections(csr, stars)

        def corrected(residual: Floats) -> Floats:
            change = in_stars(residual)
            return change + prolongation @ coarse(prolongation.T @ residual - restricted @ change)

        start = prolongation @ coarse(prolongation.T @ right)
        return self._iterated(csr, right, corrected, MOST_WITH_STARS, start)

    def preconditioner(self, matrix: csc_array) -> Function:
        """Return the inverse of a matrix, or a cycle of multigrid if large."""
        if matrix.shape[0] > self.large and find_spec("pyamg") is not None:
            cycle = aggregated(as_csr(matrix)).aspreconditioner()
            return lambda residual: np.asarray(cycle @ residual)
        return factorised(matrix).solve

    def _iterated(
        self, matrix: csr_matrix, right: Floats, preconditioner: Function, most: int, start: Floats | None = None
    ) -> Floats | None:
        cycle = LinearOperator(matrix.shape, matvec=preconditioner, dtype=np.float64)
        solution, _ = cg(matrix, right, start, rtol=self.rtol, maxiter=most, M=cycle)
        return solution if self._is_solved(matrix, right, solution) else None

    def _is_solved(self, matrix: csr_matrix, right: Floats, solution: Floats) -> bool:
        residual, wanted = np.linalg.norm(right - matrix @ solution), self.rtol * np.linalg.norm(right)
        if residual <= 10.0 * wanted:
            return True
        # Beside layers at edges of iron, products with the matrix have rounding errors of this size.
        rounding = np.finfo(np.float64).eps * np.linalg.norm(abs(matrix) @ abs(solution))
        return bool(residual <= 10.0 * (wanted + rounding))

    def in_order(self, matrix: csc_array, right: Floats) -> Floats:
        solution = self.by_multigrid(matrix, right) if right.size > self.large else None
        return factorised(matrix, "NATURAL").solve(right) if solution is None else solution

    def by_multigrid(self, matrix: csc_array, right: Floats, prolongation: csr_array | None = None) -> Floats | None:
        """Return the solution, or None if pyamg is missing or does not converge.

        With a prolongation multigrid is for the coarse functions alone.
        """
        if find_spec("pyamg") is None or not np.isfinite(matrix.data).all():
            return None
        csr = as_csr(matrix)
        if prolongation is not None:
            return self._iterated(csr, right, two_level_cycle(csr, prolongation), self.most_iterations)
        solution = aggregated(csr).solve(right, tol=self.rtol, maxiter=self.most_iterations, accel="cg")
        return solution if self._is_solved(csr, right, solution) else None


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


def two_level_cycle(matrix: csr_matrix, prolongation: csr_array) -> Function:
    # A symmetric V-cycle. Aggregation of all unknowns of order 2 takes three to five times the time.
    from pyamg.relaxation.relaxation import gauss_seidel

    coarse = aggregated(as_csr((prolongation.T @ matrix @ prolongation).tocsc())).aspreconditioner()

    def cycle(residual: Floats) -> Floats:
        change = np.zeros_like(residual)
        gauss_seidel(matrix, change, residual, sweep="forward")
        change += prolongation @ (coarse @ (prolongation.T @ (residual - matrix @ change)))
        gauss_seidel(matrix, change, residual, sweep="backward")
        return change

    return cycle


# Factors fill more in space. Direct against multigrid on boxes of magnets: 8379 nodes 0.25 s
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
