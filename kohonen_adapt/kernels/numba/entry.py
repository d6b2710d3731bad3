"""Argument types of loops that Python calls, and of the records they share."""

from typing import Any

from numba.types import boolean, float64, int32, int64

from kohonen_adapt.kernels import arrays, functionals, grid, heap
from kohonen_adapt.kernels.numba.compilation import record_type

__all__ = [
    "B1",
    "GRID",
    "HEAP",
    "I1",
    "I2",
    "L1",
    "LAWS",
    "LESSON",
    "METRIC",
    "MODES",
    "POOL",
    "R1",
    "R2",
    "R3",
    "R4",
    "SEARCH_SCRATCH",
    "Entry",
    "name_of",
]

# Arrays by their number of axes.
R1, R2, R3, R4 = float64[::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, :, ::1]
I1, I2, L1, B1 = int32[::1], int32[:, ::1], int64[::1], boolean[::1]

# Records of loops over triangles and over tetrahedra.
METRIC = record_type(arrays.Metric, (R2, float64))
POOL = record_type(arrays.Pool, (I1, I1, I1, L1))
HEAP = record_type(heap.Heap, (R1, I2, L1))
SEARCH_SCRATCH = record_type(arrays.SearchScratch, (L1, L1, L1, I1, I1, R1, I2))
GRID = record_type(grid.Grid, (R1, R1, L1, L1, I1))
LAWS = record_type(functionals.Laws, (I1, int64, R3))
MODES = record_type(arrays.Modes, (R3, R1, boolean[:, ::1]))
LESSON = record_type(arrays.Lesson, (R2, I1, R1, I1, R1))


class Entry:
    """Loop with argument types for compilation.

    Only loops that Python calls have an entry; all other loops are compiled with their callers.
    """

    def __init__(self, loop: Any, *types: Any) -> None:
        self.loop, self.types = loop, types

    @property
    def name(self) -> str:
        return name_of(self.loop)

    @property
    def key(self) -> tuple[str, tuple[Any, ...]]:
        """Name and types, because a loop may be compiled for several types."""
        return self.name, self.types

    def compile(self) -> None:
        if hasattr(self.loop, "py_func"):
            self.loop.compile(self.types)


def name_of(loop: Any) -> str:
    return f"{loop.__module__.removeprefix('kohonen_adapt.kernels.')}.{loop.__name__}"
