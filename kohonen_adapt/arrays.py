"""Array types, arrays with spare rows, and sorted rows."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Floats", "Ints", "Mask", "free_rows", "padded", "ranks", "sorted_below"]

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
Mask = NDArray[np.bool_]


def padded(array: NDArray[Any], rows: int, value: float) -> NDArray[Any]:
    longer = np.full((rows, *array.shape[1:]), value, dtype=array.dtype)
    longer[: len(array)] = array
    return longer


def free_rows(used: int, rows: int) -> Ints:
    stack = np.empty(rows, dtype=np.int32)
    stack[: rows - used] = np.arange(rows - 1, used - 1, -1)
    return stack


def ranks(order: Ints, rows: int) -> NDArray[np.int32]:
    """Return the index in `order` of every row, or -1, shape (rows,)."""
    places = np.full(rows, -1, dtype=np.int32)
    places[order] = np.arange(len(order))
    return places


def sorted_below(values: Floats, below: float) -> Ints:
    found = np.flatnonzero(values < below)
    return found[np.argsort(values[found], kind="stable")]
