"""Take the numbers of one section of a Gmsh file from its front, text or binary."""

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.io.content import nodes_of

__all__ = ["BinaryNumbers", "Numbers", "TextNumbers"]

Table = tuple[int, int, Ints]
"""Element type, tags per element, and rows of number, tags (the first one the group) and nodes."""


SHORT = 4  # rows that plain Python compares

LARGEST = 2.0**53  # of whole numbers in a text, which are parsed as floats


class TextNumbers:
    """Numbers of a text file, all of them parsed at once.

    Parameters
    ----------
    text
        The section without its first and last line.
    """

    def __init__(self, text: bytes) -> None:
        with warnings.catch_warnings():
            # numpy warns of text that is no number, or raises, by its version.
            warnings.simplefilter("error", DeprecationWarning)
            try:
                self._numbers = np.fromstring(text, sep=" ")
            except (DeprecationWarning, ValueError):
                raise ValueError("a section of numbers holds something else") from None
        self._position = 0

    def floats(self, count: int) -> Floats:
        """Take `count` numbers."""
        start, self._position = self._position, self._position + int(count)
        if not start <= self._position <= len(self._numbers):
            raise ValueError("a section ends before its last number")
        return self._numbers[start : self._position]

    def rest(self) -> Floats:
        """Take all that is left."""
        return self.floats(len(self._numbers) - self._position)

    def ints(self, count: int) -> Ints:
        """Take `count` integers; they are below 2^53, so that nothing is lost."""
        return _whole(self.floats(count))

    sizes = ints

    def integer(self) -> int:
        """Take one integer."""
        value = float(self.floats(1)[0])
        if not value.is_integer():
            raise ValueError(f"{value} stands where a whole number must")
        return int(value)

    size = count = integer

    def numbered_values(self, count: int, components: int) -> tuple[Ints, Floats]:
        """Take `count` rows of an integer and some floats: numbers (count,) and values (count, components)."""
        rows = self.floats((1 + components) * count).reshape(count, 1 + components)
        return _whole(rows[:, 0]), rows[:, 1:]

    def numbered_lists(self, count: int, components: int) -> Iterator[tuple[Ints, Floats]]:
        """Take `count` rows of an integer, how many nodes, and floats for each: (m,) and (m, nodes, components).

        Rows of as many nodes come together.
        """

        def row(nodes: int) -> tuple[int, int]:
            return 2 + _counted(nodes) * components, 1

        taken, tables = _alike(self._numbers[self._position :], count, (1,), row)
        self._position += taken
        for (nodes,), table in tables:
            yield _whole(table[:, 0]), table[:, 2:].reshape(-1, nodes, components)

    def numbered_elements(self, count: int) -> Iterator[Table]:
        """Take `count` lines of number, type, how many tags, tags, nodes; lines of the same make come together."""

        def line(kind: int, tags: int) -> tuple[int, int]:
            return 2 + _width(kind, tags), 1

        taken, tables = _alike(self._numbers[self._position :], count, (1, 2), line)
        self._position += taken
        for (kind, tags), table in tables:
            yield kind, tags, _whole(np.delete(table, (1, 2), axis=1))


class BinaryNumbers:
    """Numbers of a binary file, in the byte order of this machine.

    Parameters
    ----------
    data
        The whole file.
    position
        Where the section begins, after its first line.
    """

    def __init__(self, data: bytes, position: int) -> None:
        self._data = data
        self._position = position

    def _take(self, kind: np.dtype, count: int) -> np.ndarray:
        if not 0 <= count <= (len(self._data) - self._position) // kind.itemsize:
            raise ValueError("a section ends before its last number")
        taken = np.frombuffer(self._data, kind, int(count), self._position)
        self._position += taken.nbytes
        return taken

    def count(self) -> int:
        """Take a line of text with one integer."""
        end = self._data.index(b"\n", self._position)
        start, self._position = self._position, end + 1
        return int(self._data[start:end])

    def integer(self) -> int:
        """Take a number of four bytes."""
        return int(self._take(np.dtype(np.int32), 1)[0])

    def size(self) -> int:
        """Take a number of eight bytes."""
        return int(self._take(np.dtype(np.uint64), 1)[0])

    def ints(self, count: int) -> Ints:
        """Take `count` numbers of four bytes."""
        return self._take(np.dtype(np.int32), count).astype(np.int64)

    def sizes(self, count: int) -> Ints:
        """Take `count` numbers of eight bytes."""
        return self._take(np.dtype(np.uint64), count).astype(np.int64)

    def floats(self, count: int) -> Floats:
        """Take `count` numbers of eight bytes."""
        return self._take(np.dtype(np.float64), count)

    def numbered_values(self, count: int, components: int) -> tuple[Ints, Floats]:
        """Take `count` rows of four bytes and some times eight: numbers (count,) and values (count, components)."""
        rows = self._take(np.dtype([("number", np.int32), ("values", np.float64, (components,))]), count)
        return rows["number"].astype(np.int64), rows["values"]

    def numbered_lists(self, count: int, components: int) -> Iterator[tuple[Ints, Floats]]:
        """Take `count` rows, as those of a text."""

        def row(nodes: int) -> tuple[int, int]:
            return 2 + 2 * _counted(nodes) * components, 1

        taken, tables = _alike(self._words(), count, (1,), row)
        self._position += 4 * taken
        for (nodes,), table in tables:
            values = np.ascontiguousarray(table[:, 2:]).view(np.float64)
            yield table[:, 0].astype(np.int64), values.reshape(-1, nodes, components)

    def numbered_elements(self, count: int) -> Iterator[Table]:
        """Take `count` elements, each table after a header of its type, how many, and how many tags.

        Gmsh writes a header for every element, so those of the same make come together.
        """

        def block(kind: int, number: int, tags: int) -> tuple[int, int]:
            if number < 1:
                raise ValueError(f"a block of elements has {number} of them")
            return 3 + number * _width(kind, tags), number

        taken, tables = _alike(self._words(), count, (0, 1, 2), block)
        self._position += 4 * taken
        for (kind, _, tags), table in tables:
            yield kind, tags, table[:, 3:].reshape(-1, _width(kind, tags)).astype(np.int64)

    def _words(self) -> NDArray[np.int32]:
        """All that is left, as numbers of four bytes."""
        return np.frombuffer(self._data, np.int32, (len(self._data) - self._position) // 4, self._position)


Numbers = TextNumbers | BinaryNumbers
"""Numbers that the readers of sections take one after another."""


def _alike(
    words: NDArray[Any], count: int, columns: tuple[int, ...], row_of: Callable[..., tuple[int, int]]
) -> tuple[int, list[tuple[tuple[int, ...], NDArray[Any]]]]:
    """Rows whose length depends on what they begin with, those of the same beginning together.

    Runs of like rows are sought in steps that double, so that every row is looked at a bounded number of times, however
    a file mixes them.

    Parameters
    ----------
    words
        The numbers from the first row on.
    count
        How many items there are in all rows.
    columns
        Where a row says what it is.
    row_of
        Words and items of such a row.

    Returns
    -------
    int
        Words of all rows.
    list
        What rows say in these columns, and a table of them.
    """
    places: dict[tuple[int, ...], list[NDArray[Any]]] = {}
    position, window = 0, 1
    while count > 0:
        head = tuple(int(words[position + column]) for column in columns)
        width, items = row_of(*head)
        limit = min(window, -(-count // items), (len(words) - position) // width)
        if limit < 1:
            raise ValueError("a section ends before its last number")
        rows = words[position : position + limit * width].reshape(limit, width)
        run = _run(rows, columns, head)
        if run < 1:
            raise ValueError("a number that is not whole stands where an element says what it is")
        places.setdefault(head, []).append(rows[:run])
        window = 2 * window if run == limit else 1
        position, count = position + run * width, count - run * items
    return position, [(head, np.concatenate(parts)) for head, parts in places.items()]


def _run(rows: NDArray[Any], columns: tuple[int, ...], head: tuple[int, ...]) -> int:
    """How many rows from the first on have this head; in plain Python where that is faster."""
    if len(rows) <= SHORT:
        alike = (all(row[column] == word for column, word in zip(columns, head, strict=True)) for row in rows)
        return next((number for number, same in enumerate(alike) if not same), len(rows))
    same = np.all(rows[:, columns] == head, axis=1)
    return len(rows) if same.all() else int(np.argmin(same))


def _whole(values: Floats) -> Ints:
    if not np.all(np.abs(values) < LARGEST):
        raise ValueError("a number that counts is too large, or none")
    whole = values.astype(np.int64)
    if np.any(whole != values):
        raise ValueError(f"{values[whole != values][0]} stands where a whole number must")
    return whole


def _counted(nodes: int) -> int:
    if nodes < 1:
        raise ValueError(f"an element has values at {nodes} nodes")
    return nodes


def _width(kind: int, tags: int) -> int:
    if tags < 0:
        raise ValueError(f"an element has {tags} tags")
    return 1 + tags + nodes_of(kind)
