"""Direct and multigrid solvers of linear systems."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, csr_matrix
from scipy.sparse.linalg import LinearOperator, SuperLU, cg, splu
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.host import number_facets

__all__ = ["IN_SPACE", "Interiors", "Pattern", "Reduced", "Skeleton", "Solver"]

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


@dataclass(frozen=True)
class Pattern:
    rows: Ints  # (n,): numbers of the free unknowns that the rows of the matrix belong to
    outer: Ints  # (nelements, 3 p): rows of the unknowns on the sides of elements, -1 for prescribed ones
    places: Ints  # (nelements, 9 p^2): indices of the data, beyond the last for prescribed unknowns
    indices: Ints
    starts: Ints

    def matrix(self, products: Floats) -> csc_array:
        data = np.bincount(self.places.ravel(), products.ravel())[: self.indices.size]
        return csc_array((data, self.indices, self.starts), shape=(self.rows.size,) * 2)


class Skeleton:
    """Nodes and facets of a mesh, here called parts, with their neighbours.

    The order of elimination is that of one unknown per part. It serves all orders of the elements, and fills factors
    less than an order of all unknowns.
    """

    def __init__(self, mesh: MeshTri) -> None:
        number_facets(mesh)
        self.nodes, self.count = mesh.p.shape[1], mesh.p.shape[1] + mesh.facets.shape[1]
        self.parts = np.vstack([mesh.t, self.nodes + mesh.t2f]).T  # (nelements, 6)

    @cached_property
    def _position(self) -> Ints:
        # of every part in the order of elimination
        row, column = np.broadcast_arrays(self.parts[:, :, None], self.parts[:, None])
        values = np.broadcast_to(6.0 * np.eye(6) - 0.9, row.shape)  # positive definite
        graph = coo_array((values.ravel(), (row.ravel(), column.ravel())), shape=(self.count,) * 2)
        return np.asarray(factorised(graph.tocsc()).perm_c, dtype=np.int64)

    @cached_property
    def _blocks(self) -> tuple[Ints, Ints, Ints]:
        # pairs of parts in a common element by columns, as positions, and their numbers, (nelements, 36)
        own = self._position[self.parts]
        key, number = np.unique(own[:, None] * self.count + own[:, :, None], return_inverse=True)
        return key % self.count, key // self.count, number.reshape(-1, 36)

    def pattern(self, order: int, number: Ints) -> Pattern:
        # `number` (nunknowns,) numbers the free unknowns, -1 for prescribed ones; inside a facet all are free, or none
        facet = np.arange(self.count - self.nodes)
        first = np.append(np.arange(self.nodes), self.nodes + (order - 1) * facet)
        sorted_parts = np.argsort(self._position)
        size = np.where(sorted_parts < self.nodes, 1, order - 1) * (number[first[sorted_parts]] >= 0)  # by position
        start = np.cumsum(size) - size
        rows = np.repeat(first[sorted_parts] - start, size) + np.arange(size.sum())
        index = np.full(number.size, -1)
        index[rows] = np.arange(rows.size)

        row, column, block = self._blocks
        height = np.bincount(column, size[row], self.count).astype(np.int64)  # of the columns of a part
        above, before = np.cumsum(size[row]) - size[row], np.cumsum(height) - height
        starts = np.cumsum(np.append(0, np.repeat(height, size)))
        stacked = np.repeat(start[row] - above, size[row]) + np.arange(size[row].sum())  # rows of the blocks in columns
        of_column = np.repeat(before, size) - starts[:-1]
        indices = stacked[np.repeat(of_column, np.diff(starts)) + np.arange(starts[-1])]

        part = np.append([0, 1, 2], np.repeat([3, 4, 5], order - 1))
        inside = np.append([0, 0, 0], np.tile(np.arange(order - 1), 3))
        base = np.append(starts, starts[-1])[start[column]] + above - before[column]
        stride, absent = height[column], size[row] * size[column] == 0
        base[absent], stride[absent] = starts[-1], 0
        pair = (6 * part[:, None] + part).ravel()
        places = np.take(stride[block], pair, axis=1)
        places *= np.tile(inside, inside.size)
        places += np.take(base[block], pair, axis=1)
        places += np.repeat(inside, inside.size)
        outer = index[first[self.parts][:, part] + inside]
        return Pattern(number[rows], outer, places, indices.astype(np.int32), starts.astype(np.int32))
