"""Loops that Python calls, with argument types."""

from typing import Any

from kohonen_adapt.kernels.numba.compilation import type_of

__all__ = ["Entry", "name_of"]


class Entry:
    """Loop with argument types for compilation.

    Only loops that Python calls have an entry; all other loops are compiled with their callers.
    """

    def __init__(self, loop: Any, *types: Any) -> None:
        self.loop, self.types = loop, tuple(map(type_of, types))

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
