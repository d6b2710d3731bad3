"""Assembly of element matrices, with eliminated interiors."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import SuperLU, splu
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.host import number_edges, number_facets, summed

__all__ = [
    "Interiors",
    "Pattern",
    "Reduced",
    "Skeleton",
    "Subspaces",
    "assembled",
    "symmetric_factors",
    "without_interiors",
]


@dataclass(frozen=True)
class Interiors:
    """Unknowns inside elements, eliminated from the equations of all others."""

    inner: Ints  # (nelements, i): indices among the free unknowns
    outer: Ints  # (nelements, o): rows of the matrix of the unknowns on the sides, -1 for prescribed ones
    inverse: Floats  # (nelements, i, i): inverse of the matrix of the inner unknowns
    coupling: Floats  # (nelements, i, o): the inverse times the coupling of inner and outer unknowns


class Subspaces(NamedTuple):
    """Subspaces of a space of high order, for a preconditioner."""

    prolongation: csr_array  # (nrows, ncoarse): functions of order 1
    stars: Sequence[Ints]  # rows of the unknowns around each node, above order 2


@dataclass(frozen=True)
class Reduced:
    matrix: csc_array
    interiors: Interiors | None = None
    rows: Ints | None = None  # of the matrix among the free unknowns, None for all
    subspaces: Subspaces | None = None

    @property
    def in_order(self) -> bool:
        """True if the rows are in an order of elimination."""
        return self.rows is not None and self.subspaces is None

    def eliminated(self, right: Floats) -> Floats:
        if self.interiors is None or self.rows is None:
            return right
        inner, outer = self.interiors.inner, self.interiors.outer
        moved = np.einsum("mio,mi->mo", self.interiors.coupling, right[inner])
        count = self.rows.size
        return right[self.rows] - summed(np.where(outer < 0, count, outer), moved, count + 1)[:-1]

    def completed(self, solution: Floats, right: Floats) -> Floats:
        if self.interiors is None or self.rows is None:
            return solution
        inner, outer = self.interiors.inner, self.interiors.outer
        values, outer_values = np.empty_like(right), np.append(solution, 0.0)[outer]
        values[self.rows] = solution
        values[inner] = np.einsum("mij,mj->mi", self.interiors.inverse, right[inner])
        values[inner] -= np.einsum("mio,mo->mi", self.interiors.coupling, outer_values)
        return values


def symmetric_factors(matrix: csc_array, order: str = "MMD_AT_PLUS_A") -> SuperLU:
    # Pivots on the diagonal halve the time of the defaults. Relaxed supernodes and panels of several columns never save
    # time, and relaxed supernodes multiply the time on some meshes.
    return splu(
        matrix,
        permc_spec=order,
        diag_pivot_thresh=0.0,
        relax=1,
        panel_size=1,
        options={"SymmetricMode": True, "Equil": False},
    )


def assembled(unknowns: Ints, products: Floats, index: Ints, nfree: int) -> csc_array:
    """Return a symmetric matrix of the free unknowns.

    `products` has the entries of the upper triangles of the element matrices, by rows, (k (k + 1) / 2, nelements), and
    `index` (nunknowns,) the rows of the matrix, -1 for prescribed unknowns.
    """
    i, j = np.triu_indices(len(unknowns))
    # Diagonal terms are summed before the assembly.
    on_diagonal, upper = np.flatnonzero(i == j), np.flatnonzero(i != j)
    free = np.flatnonzero(index >= 0)
    diagonal = summed(unknowns, products[on_diagonal], index.size)[free]
    rows = index[unknowns]
    start, end = rows[i[upper]], rows[j[upper]]
    inner = (start >= 0) & (end >= 0)
    values, start, end = products[upper][inner], start[inner], end[inner]
    entries = np.concatenate((values, values, diagonal))
    places = np.concatenate((start, end, index[free])), np.concatenate((end, start, index[free]))
    return coo_array((entries, places), shape=(nfree, nfree)).tocsc()


def without_interiors(matrices: Floats, outside: int) -> tuple[Floats, Floats, Floats]:
    """Return element matrices (m, k, k) without all but the first `outside` unknowns.

    With them are returned the inverse of the eliminated block and its product with the coupling.
    """
    inverse = np.asarray(np.linalg.inv(matrices[:, outside:, outside:]), np.float64)
    coupling = inverse @ matrices[:, outside:, :outside]
    return matrices[:, :outside, :outside] - matrices[:, :outside, outside:] @ coupling, inverse, coupling


@dataclass(frozen=True)
class Pattern:
    rows: Ints  # (n,): numbers of the free unknowns that the rows of the matrix belong to
    outer: Ints  # (nelements, k): rows of the unknowns on the facets of elements, -1 for prescribed ones
    places: Ints  # (nelements, k^2): indices of the data, beyond the last for prescribed unknowns
    indices: Ints
    starts: Ints

    def matrix(self, products: Floats) -> csc_array:
        data = summed(self.places, products)[: self.indices.size]
        return csc_array((data, self.indices, self.starts), shape=(self.rows.size,) * 2)


class Skeleton:
    """Nodes, edges and faces of a mesh, here called parts, with their neighbours.

    In the plane the order of elimination is that of one unknown per part. It serves all orders of the elements, and
    fills factors less than an order of all unknowns.
    """

    def __init__(self, mesh: Mesh) -> None:
        number_facets(mesh)
        number_edges(mesh)
        kinds = [(mesh.t, mesh.nvertices), (mesh.t2f, mesh.nfacets)]
        if len(mesh.p) == 3:
            kinds.insert(1, (mesh.t2e, mesh.nedges))
        self.each = [number for _, number in kinds]  # numbers of nodes, edges and faces
        self.local = [len(index) for index, _ in kinds]  # their numbers in an element
        first = np.cumsum([0, *self.each])
        self.count = int(first[-1])
        self.parts: Ints = np.vstack([index + start for (index, _), start in zip(kinds, first, strict=False)]).T
        self._dim = len(mesh.p)

    @cached_property
    def _position(self) -> Ints:
        # of every part in the order of elimination; in space, where factors fill too much, as they are
        if self._dim == 3:
            return np.arange(self.count)
        row, column = np.broadcast_arrays(self.parts[:, :, None], self.parts[:, None])
        values = np.broadcast_to(6.0 * np.eye(6) - 0.9, row.shape)  # positive definite
        graph = coo_array((values.ravel(), (row.ravel(), column.ravel())), shape=(self.count,) * 2)
        return np.asarray(symmetric_factors(graph.tocsc()).perm_c, np.int64)

    @cached_property
    def _blocks(self) -> tuple[Ints, Ints, Ints]:
        # pairs of parts in a common element by columns, as positions, and their numbers, (nelements, parts^2)
        own = self._position[self.parts]
        key, number = np.unique(own[:, None] * self.count + own[:, :, None], return_inverse=True)
        return key % self.count, key // self.count, number.reshape(len(own), -1)

    def pattern(self, order: int, unknowns: Ints, number: Ints) -> Pattern:
        """Return the pattern of the matrix of the unknowns (k, nelements) on facets.

        `number` (nunknowns,) numbers the free unknowns, -1 for prescribed ones. Inside a part all are free, or none.
        """
        inner = [comb(order - 1, k) for k in range(len(self.each))]
        of_part = np.repeat(inner, self.each)
        first = np.cumsum(of_part) - of_part
        sorted_parts = np.argsort(self._position)
        size = of_part[sorted_parts] * (number[first[sorted_parts]] >= 0)  # by position
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

        part = np.repeat(np.arange(self.parts.shape[1]), np.repeat(inner, self.local))
        inside = unknowns.T - first[self.parts][:, part]
        base = np.append(starts, starts[-1])[start[column]] + above - before[column]
        stride, absent = height[column], size[row] * size[column] == 0
        base[absent], stride[absent] = starts[-1], 0
        pair = (self.parts.shape[1] * part[:, None] + part).ravel()
        places = np.take(stride[block], pair, axis=1).reshape(*inside.shape, -1)
        places *= inside[:, None]
        places += np.take(base[block], pair, axis=1).reshape(places.shape)
        places += inside[:, :, None]
        every = places.reshape(len(inside), -1)
        return Pattern(number[rows], index[unknowns.T], every, indices.astype(np.int32), starts.astype(np.int32))
