"""Array types, arrays with spare rows, and sorted rows."""

from collections.abc import Callable
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Array",
    "DataFunction",
    "FilePath",
    "Floats",
    "FloatsPair",
    "Function",
    "Int8s",
    "Int32s",
    "Int64s",
    "Ints",
    "IntsPair",
    "Mask",
    "Texts",
    "copied",
    "counted",
    "free_rows",
    "grouped",
    "padded",
    "ranks",
    "sorted_below",
    "unique_pairs",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
Int8s = NDArray[np.int8]
Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]
Mask = NDArray[np.bool_]
FloatsPair = tuple[Floats, Floats]
IntsPair = tuple[Ints, Ints]
Function = Callable[[Floats], Floats]
DataFunction = Callable[[Floats], ArrayLike]
Texts = NDArray[np.str_]
Array = NDArray[Any]
FilePath = str | PathLike[str]


def padded(array: Array, rows: int, value: float) -> Array:
    longer = np.full((rows, *array.shape[1:]), value, array.dtype)
    longer[: len(array)] = array
    return longer


def free_rows(used: int, rows: int) -> Ints:
    stack = np.empty(rows, np.int32)
    stack[: rows - used] = np.arange(rows - 1, used - 1, -1)
    return stack


def ranks(order: Ints, rows: int) -> Int32s:
    """Return the index in `order` of every row, or -1, shape (rows,)."""
    places = np.full(rows, -1, np.int32)
    places[order] = np.arange(len(order))
    return places


def sorted_below(values: Floats, below: float) -> Ints:
    found = np.flatnonzero(values < below)
    return found[np.argsort(values[found], kind="stable")]


def grouped(label: Ints) -> list[Ints]:
    """Return the indices with each label, ascending, none without labels."""
    order = np.argsort(label, kind="stable")
    return [] if not label.size else np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def counted(count: Ints) -> Ints:
    """Return 0, 1, ..., k - 1 for each k of `count`."""
    return np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)


def unique_pairs(one: Ints, other: Ints) -> IntsPair:
    """Return the different pairs of indices in ascending order."""
    count = int(other.max(initial=0)) + 1
    return np.divmod(np.unique(one.astype(np.int64) * count + other), count)


def copied(arrays: Any) -> Any:
    return arrays._make(array.copy() for array in arrays)
