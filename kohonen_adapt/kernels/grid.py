"""Lists of items in the cells of a regular grid of any dimension.

All lists are in one array, filled in two passes: the first counts the items of each cell, the second fills each list
from its end, so that the items are in the opposite order of the second pass.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Array
from kohonen_adapt.kernels.numba.array_types import I1, L1, R1
from kohonen_adapt.kernels.numba.compilation import inner_kernel, record

__all__ = ["Grid", "cell_index", "cells_between", "enter"]


@record
class Grid(NamedTuple):
    """Regular grid of g cells in d dimensions, in C order, with items in the cells.

    The items of cell c are ``content[start[c] : start[c + 1]]``.
    """

    origin: R1  # (d,): lower corner of the first cell
    size: R1  # (d,): of a cell
    shape: L1  # (d,): number of cells
    start: L1  # (g + 1,)
    content: I1  # (start[g],)

    @classmethod
    def over(cls, position: Array, wanted: float) -> "Grid":
        """Return an empty grid over points (n, d) with about `wanted` almost cubic cells."""
        origin = position.min(axis=0)
        extent = position.max(axis=0) - origin
        count = np.clip(np.ceil(extent / (extent.prod() / wanted) ** (1.0 / len(extent))), 1, 4096)
        while count.prod() > 8.0 * wanted + 8.0:  # a thin mesh has at least one cell across
            count = np.ceil(count / 2.0)
        start = np.zeros(int(count.prod()) + 1, np.int64)
        return cls(origin, extent / count, count.astype(np.int64), start, np.empty(0, np.int32))


@inner_kernel
def cells_between(position, node, e, axis, grid):
    low = high = position[node[e, 0], axis]
    for k in range(1, node.shape[1]):
        low, high = min(low, position[node[e, k], axis]), max(high, position[node[e, k], axis])
    return cell_index(grid, low, axis), cell_index(grid, high, axis)


@inner_kernel
def cell_index(grid, value, axis):
    return int(min(grid.shape[axis] - 1.0, max(0.0, (value - grid.origin[axis]) / grid.size[axis])))


@inner_kernel
def enter(grid, c, item):
    """Add an item before the items of cell c, and decrease ``start[c]``."""
    grid.start[c] -= 1
    grid.content[grid.start[c]] = item
