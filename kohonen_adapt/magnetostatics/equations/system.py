"""Direct and multigrid solvers of linear systems."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix
from scipy.sparse.linalg import LinearOperator, SuperLU, cg, splu

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["IN_SPACE", "Interiors", "Reduced", "Solver", "factorised"]

TOLERANCE = 1e-10  # residual of multigrid, relative to the right-hand side


@dataclass(frozen=True)
class Interiors:
    """Unknowns inside elements, eliminated from the equations of all others."""

    inner: Ints  # (nelements, i): indices among the free unknowns
    outer: Ints  # (nelements, o): rows of the matrix of the unknowns on the sides, -1 for prescribed ones
    inverse: Floats  # (nelements, i, i): inverse of the matrix of the inner unknowns
    coupling: Floats  # (nelements, i, o): the inverse times the coupling of inner and outer unknowns


@dataclass(frozen=True)
class Reduced:
    """Matrix of the free unknowns that are not eliminated."""

    matrix: csc_array
    interiors: Interiors | None = None
    rows: Ints | None = None  # of the matrix among the free unknowns, in an order of elimination; None for all
    prolongation: csr_array | None = None  # (nfree, ncoarse): functions of order 1 in elements of order 2

    def eliminated(self, right: Floats) -> Floats:
        if self.interiors is None or self.rows is None:
            return right
        inner, outer = self.interiors.inner, self.interiors.outer
        moved = np.einsum("mio,mi->mo", self.interiors.coupling, right[inner])
        count = self.rows.size
        return right[self.rows] - np.bincount(np.where(outer < 0, count, outer).ravel(), moved.ravel(), count + 1)[:-1]

    def completed(self, solution: Floats, right: Floats) -> Floats:
        if self.interiors is None or self.rows is None:
            return solution
        inner, outer = self.interiors.inner, self.interiors.outer
        values, outer_values = np.empty_like(right), np.append(solution, 0.0)[outer]
        values[self.rows] = solution
        values[inner] = np.einsum("mij,mj->mi", self.interiors.inverse, right[inner])
        values[inner] -= np.einsum("mio,mo->mi", self.interiors.coupling, outer_values)
        return values


@dataclass(frozen=True)
class Solver:
    """Solver of symmetric positive definite systems.

    Parameters
    ----------
    large
        Number of unknowns above which multigrid is used.
    most_iterations
        Maximum number of iterations of conjugate gradients; 20 to 30 are usual.
    """

    # Direct against multigrid on square grids (`benchmarks large`): 101 761 unknowns 0.4 - 0.9 s against 1.1 - 3.1 s,
    # 408 321 unknowns 3.9 - 10.1 s against 3.7 - 5.1 s, 808 201 unknowns 28 s against 7 s.
    large: int = 300_000
    most_iterations: int = 200

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
            solution = aggregated(csr).solve(right, tol=TOLERANCE, maxiter=iterations, accel="cg")
        else:
            cycle = LinearOperator(csr.shape, matvec=two_level_cycle(csr, prolongation), dtype=np.float64)
            solution, _ = cg(csr, right, rtol=TOLERANCE, maxiter=iterations, M=cycle)
        residual = np.linalg.norm(right - csr @ solution)
        return solution if residual <= 10.0 * TOLERANCE * np.linalg.norm(right) else None


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
    # Pivots on the diagonal halve the time of the defaults. Relaxed supernodes and panels of several columns never save
    # time, and relaxed supernodes multiply the time on some meshes (`benchmarks round`).
    try:
        return splu(
            matrix,
            permc_spec=order,
            diag_pivot_thresh=0.0,
            relax=1,
            panel_size=1,
            options={"SymmetricMode": True, "Equil": False},
        )
    except RuntimeError as error:
        raise np.linalg.LinAlgError(
            f"the equations of the potential are singular ({error}); check for extreme permeabilities or elements "
            "that are almost flat."
        ) from error
