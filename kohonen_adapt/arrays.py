"""Name the types of arrays, give arrays rows to spare, and number the rows in use."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Floats", "Ints", "Mask", "free_rows", "padded", "ranks"]

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
Mask = NDArray[np.bool_]


def padded(array: NDArray[Any], rows: int, value: float) -> NDArray[Any]:
    """A copy with rows of a value added."""
    longer = np.full((rows, *array.shape[1:]), value, dtype=array.dtype)
    longer[: len(array)] = array
    return longer


def free_rows(used: int, rows: int) -> Ints:
    """A stack of the rows that are free, with room for all, the first of them on top."""
    stack = np.empty(rows, dtype=np.int32)
    stack[: rows - used] = np.arange(rows - 1, used - 1, -1)
    return stack


def ranks(order: Ints, rows: int) -> NDArray[np.int32]:
    """The place of every row in an order of some of them, -1 for the others, (rows,)."""
    places = np.full(rows, -1, dtype=np.int32)
    places[order] = np.arange(len(order))
    return places
