"""Sequential reader of the numbers in a Gmsh file, text or binary."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from kohonen_adapt.arrays import Array, Floats, Ints
from kohonen_adapt.io.content import EXACT_INTEGERS, nodes_per_element, parse_numbers

__all__ = ["INT", "SIZE", "Numbers"]

INT, SIZE, REAL = "i4", "u8", "f8"  # types in binary files, in the byte order of the machine


class Numbers:
    """Numbers of a file section, taken one after another from `start`.

    Text is parsed at once, up to ``$End``. The end of a binary section is found by reading only, because its bytes may
    look like text.
    """

    def __init__(self, data: bytes, start: int, binary: bool) -> None:
        self._data: Any = data if binary else parse_numbers(data[start : data.index(b"$End", start)])
        self._position, self._binary = start if binary else 0, binary
        self._per_real = 2 if binary else 1  # words

    def take(self, count: int, kind: DTypeLike = REAL) -> Array:
        start, size = self._position, np.dtype(kind).itemsize if self._binary else 1
        _require(0 <= count <= (len(self._data) - start) // size)
        self._position += int(count) * size
        data = self._data
        return np.frombuffer(data, kind, int(count), start) if self._binary else data[start : self._position]

    def ints(self, count: int, kind: str = INT) -> Ints:
        return _as_integers(self.take(count, kind))

    def integer(self, kind: str = INT) -> int:
        return int(self.ints(1, kind)[0])

    def count(self) -> int:
        if not self._binary:
            return self.integer()
        start, end = self._position, self._data.index(b"\n", self._position)
        self._position = end + 1
        return int(self._data[start:end])

    def rows(self, count: int, components: int) -> tuple[Ints, Floats]:
        width = 1 + components * self._per_real
        table = self.take(width * count, INT).reshape(count, width)
        return _as_integers(table[:, 0]), _reals(table[:, 1:])

    def parametric_rows(self, count: int) -> tuple[Ints, Floats]:
        # A row has the number, position, dimension and tag of the entity, and a parameter on curves, two on surfaces.
        size = self._per_real
        end = 1 + 3 * size
        parts: list[tuple[Ints, Floats]] = [(np.empty(0, int), np.empty((0, 3)))]
        width = {1: 2 + size, 2: 2 + 2 * size}
        for _, table in self._rows_by_head(count, slice(end, end + 1), lambda kind: (end + width.get(kind, 2), 1)):
            parts.append((_as_integers(table[:, 0]), _reals(table[:, 1:end])))
        numbers, points = zip(*parts, strict=True)
        return np.concatenate(numbers), np.concatenate(points)

    def nodal_rows(self, count: int, components: int) -> Iterator[tuple[Ints, Floats]]:
        """Yield element numbers (n,) and nodal values (n, nodes, components)."""
        words = components * self._per_real
        for (nodes,), table in self._rows_by_head(count, slice(1, 2), lambda nodes: (2 + nodes * words, 1)):
            yield _as_integers(table[:, 0]), _reals(table[:, 2:]).reshape(-1, nodes, components)

    def elements(self, count: int) -> Iterator[tuple[int, int, Ints]]:
        """Yield type, number of tags, and rows (number, tags, nodes) of MSH 2 elements."""
        # Type, number of elements (binary only), number of tags.
        header = slice(0, 3) if self._binary else slice(1, 3)

        def row(kind: int, *rest: int) -> tuple[int, int]:
            many, tags = (1, *rest)[-2:]
            return header.stop - header.start + many * (1 + tags + nodes_per_element(kind)), many

        for (kind, *_, tags), table in self._rows_by_head(count, header, row):
            rows = np.delete(table, header, axis=1).reshape(-1, 1 + tags + nodes_per_element(kind))
            yield kind, tags, _as_integers(rows)

    def _rows_by_head(self, count: int, header: slice, row: Any) -> Iterator[tuple[tuple[int, ...], Array]]:
        """Yield heads and rows of the rest of the section, grouped by equal heads.

        All rows have `count` items. `header` is the slice of a row with its head, and `row` returns the numbers of
        words and items of a row from its head.
        """
        words = self.take((len(self._data) - self._position) // (4 if self._binary else 1), INT)
        tables: dict[tuple[int, ...], list[Array]] = {}
        window = 1  # doubled after every run of equal heads, so that the cost is linear in the rows
        while count > 0:
            _require(len(words) >= header.stop)
            head = tuple(_as_integers(words[header]).tolist())
            width, items = row(*head)
            if min(head) < 0 or width <= header.stop:
                raise ValueError(f"a row begins with {head}")
            window = min(window, -(-count // items), len(words) // width)
            _require(window > 0)
            rows = words[: window * width].reshape(window, width)
            run = int(np.argmin(np.append(np.all(rows[:, header] == head, axis=1), False)))
            tables.setdefault(head, []).append(rows[:run])
            words, count, window = words[run * width :], count - run * items, 2 * window if run == window else 1
        for head, parts in tables.items():
            yield head, np.concatenate(parts)


def _require(there: bool) -> None:
    if not there:
        raise ValueError("a section ends before its last number")


def _reals(words: Array) -> Floats:
    return np.ascontiguousarray(words).view(REAL)


def _as_integers(values: Array) -> Ints:
    if not np.all(np.abs(values) < EXACT_INTEGERS):
        raise ValueError("an integer is too large, or not finite")
    if np.any(np.trunc(values) != values):
        raise ValueError(f"{values[np.trunc(values) != values][0]} is not an integer")
    return values.astype(int)
