"""Sparse matrices of condensed elements."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.system import factorised
from kohonen_adapt.mesh.host import number_facets

__all__ = ["Pattern", "Skeleton"]


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
