"""Keep lists of what meets the cells of a regular grid, in any number of dimensions.

The lists stand one after the other in one array. They are made in two passes: the first counts what will be in each,
the second fills them from their ends, so that each has its entries in the order opposite to that of the second pass.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel
from kohonen_adapt.kernels.records import record

__all__ = ["Grid", "cell_index", "clear_counts", "enter", "sum_up_counts"]


@record
class Grid(NamedTuple):
    """The cells of a regular grid of d dimensions, g in all, the last one running fastest, and what meets each.

    That of cell c stands in ``content[start[c]]`` to ``content[start[c + 1]]``.
    """

    origin: np.ndarray  # (d,) float64: where the first cell begins
    size: np.ndarray  # (d,) float64: of a cell
    shape: np.ndarray  # (d,) int64: how many cells
    start: np.ndarray  # (g + 1,) int64
    content: np.ndarray  # (start[g],) int32

    @classmethod
    def over(cls, position: np.ndarray, wanted: float) -> "Grid":
        """About the `wanted` number of cells around points (n, d), as near to cubes as that allows; nothing in them."""
        origin = position.min(axis=0)
        extent = position.max(axis=0) - origin
        count = np.clip(np.ceil(extent / (extent.prod() / wanted) ** (1.0 / len(extent))), 1, 4096)
        while count.prod() > 8.0 * wanted + 8.0:  # across a thin mesh one cell is more than its share
            count = np.ceil(count / 2.0)
        start = np.empty(int(count.prod()) + 1, dtype=np.int64)
        return cls(origin, extent / count, count.astype(np.int64), start, np.empty(0, dtype=np.int32))


@inner_kernel
def cell_index(grid, value, axis):
    """Index along an axis of the cell that holds a coordinate, clipped to the grid."""
    return int(min(grid.shape[axis] - 1.0, max(0.0, (value - grid.origin[axis]) / grid.size[axis])))


@inner_kernel
def clear_counts(grid):
    """Begin to count: ``start[c]`` is for what is in cell c."""
    for c in range(grid.start.shape[0]):
        grid.start[c] = 0


@inner_kernel
def sum_up_counts(grid):
    """From counts to where lists end."""
    for c in range(grid.start.shape[0] - 1):
        grid.start[c + 1] += grid.start[c]


@inner_kernel
def enter(grid, c, item):
    """Put an item before those that are in the list of cell c; when all are in, ``start[c]`` is where it begins."""
    grid.start[c] -= 1
    grid.content[grid.start[c]] = item
