"""The numbers of one section of a Gmsh file, taken from its front, text or binary."""

import warnings
from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .content import Floats, Ints, nodes_of

__all__ = ["BinaryNumbers", "Numbers", "TextNumbers"]

Table = tuple[int, int, Ints]
"""Element type, tags per element, and rows of number, tags (the first one the group) and nodes."""


LARGEST = 2.0**53  # of whole numbers in a text, which are parsed as floats


class Numbers(Protocol):
    """Where the readers of sections get their numbers from."""

    def count(self) -> int:
        """Take the count that MSH 2.2 writes as text, in binary files too."""

    def ints(self, count: int) -> Ints:
        """Take `count` numbers of C type int."""

    def sizes(self, count: int) -> Ints:
        """Take `count` numbers of C type size_t."""

    def floats(self, count: int) -> Floats:
        """Take `count` numbers of C type double."""

    def numbered_points(self, count: int) -> tuple[Ints, Floats]:
        """Take `count` rows of an int and three doubles: numbers (count,) and points (count, 3)."""

    def numbered_elements(self, count: int) -> Iterator[Table]:
        """Take `count` elements of MSH 2.2."""

    def numbered_values(self, count: int, components: int) -> tuple[Ints, Floats]:
        """Take `count` rows of an int and some doubles: numbers (count,) and values (count, components)."""

    def numbered_lists(self, count: int, components: int) -> Iterator[tuple[Ints, Floats]]:
        """Take `count` rows of an int, how many nodes, and doubles for each: (m,) and (m, nodes, components)."""


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

    def count(self) -> int:
        """Take one integer."""
        return int(self.ints(1)[0])

    def numbered_points(self, count: int) -> tuple[Ints, Floats]:
        """Take `count` rows of an integer and three floats."""
        rows = self.floats(4 * count).reshape(-1, 4)
        return _whole(rows[:, 0]), rows[:, 1:]

    def numbered_values(self, count: int, components: int) -> tuple[Ints, Floats]:
        """Take `count` rows of an integer and some floats."""
        rows = self.floats((1 + components) * count).reshape(count, 1 + components)
        return _whole(rows[:, 0]), rows[:, 1:]

    def numbered_lists(self, count: int, components: int) -> Iterator[tuple[Ints, Floats]]:
        """Take `count` rows; those of as many nodes come together."""
        window = 1
        while count > 0:
            start = self._position
            nodes = int(self.ints(2)[1])
            width = 2 + _counted(nodes) * components
            rows = self._ahead(start, min(count, window), width)
            run, window = _run(rows[:, 1] == nodes, window)
            self._position = start
            table = self.floats(run * width).reshape(run, width)
            yield _whole(table[:, 0]), table[:, 2:].reshape(run, nodes, components)
            count -= run

    def numbered_elements(self, count: int) -> Iterator[Table]:
        """Take `count` lines of number, type, how many tags, tags, nodes; lines of the same make come together."""
        window = 1
        while count > 0:
            start = self._position
            _, kind, tags = (int(number) for number in self.ints(3))
            width = 2 + _width(kind, tags)
            rows = self._ahead(start, min(count, window), width)
            run, window = _run((rows[:, 1] == kind) & (rows[:, 2] == tags), window)
            self._position = start
            table = self.ints(run * width).reshape(-1, width)
            yield kind, tags, np.delete(table, (1, 2), axis=1)
            count -= run

    def _ahead(self, start: int, count: int, width: int) -> Floats:
        """The next rows, at most `count` of them."""
        available = (len(self._numbers) - start) // width
        return self._numbers[start : start + min(available, count) * width].reshape(-1, width)


class BinaryNumbers:
    """Numbers of a binary file, in the byte order of this machine.

    Parameters
    ----------
    data
        The whole file.
    position
        Where the section begins, after its first line.
    """

    _POINT = np.dtype([("number", np.int32), ("point", np.float64, 3)])

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

    def ints(self, count: int) -> Ints:
        """Take `count` numbers of four bytes."""
        return self._take(np.dtype(np.int32), count).astype(np.int64)

    def sizes(self, count: int) -> Ints:
        """Take `count` numbers of eight bytes."""
        return self._take(np.dtype(np.uint64), count).astype(np.int64)

    def floats(self, count: int) -> Floats:
        """Take `count` numbers of eight bytes."""
        return self._take(np.dtype(np.float64), count)

    def numbered_points(self, count: int) -> tuple[Ints, Floats]:
        """Take `count` rows of 28 bytes."""
        rows = self._take(self._POINT, count)
        return rows["number"].astype(np.int64), rows["point"]

    def numbered_values(self, count: int, components: int) -> tuple[Ints, Floats]:
        """Take `count` rows of four bytes and some times eight."""
        rows = self._take(np.dtype([("number", np.int32), ("values", np.float64, (components,))]), count)
        return rows["number"].astype(np.int64), rows["values"]

    def numbered_lists(self, count: int, components: int) -> Iterator[tuple[Ints, Floats]]:
        """Take `count` rows; those of as many nodes come together."""
        window = 1
        while count > 0:
            nodes = int(self._ahead(np.dtype((np.int32, 2)), 1)[0, 1])
            row = np.dtype([("head", np.int32, 2), ("values", np.float64, (_counted(nodes), components))])
            run, window = _run(self._ahead(row, min(count, window))["head"][:, 1] == nodes, window)
            table = self._take(row, run)
            yield table["head"][:, 0].astype(np.int64), table["values"]
            count -= run

    def numbered_elements(self, count: int) -> Iterator[Table]:
        """Take `count` elements, each table after a header of its type, how many, and how many tags.

        Gmsh writes a header for every element, so those of the same make come together.
        """
        window = 1
        while count > 0:
            head = self._ahead(np.dtype((np.int32, 3)), 1)[0]
            kind, number, tags = (int(part) for part in head)
            if number < 1:
                raise ValueError(f"a block of elements has {number} of them")
            width = _width(kind, tags)
            row = np.dtype([("head", np.int32, 3), ("table", np.int32, (number, width))])
            run, window = _run(np.all(self._ahead(row, min(count, window))["head"] == head, axis=1), window)
            yield kind, tags, self._take(row, run)["table"].reshape(-1, width).astype(np.int64)
            count -= run * number

    def _ahead(self, kind: np.dtype, count: int) -> np.ndarray:
        """The next rows, at most `count` of them and at least one."""
        available = (len(self._data) - self._position) // kind.itemsize
        ahead = self._take(kind, max(1, min(count, available)))
        self._position -= ahead.nbytes
        return ahead


def _whole(values: Floats) -> Ints:
    if not np.all(np.abs(values) < LARGEST):
        raise ValueError("a number that counts is too large, or none")
    whole = values.astype(np.int64)
    if np.any(whole != values):
        raise ValueError(f"{values[whole != values][0]} stands where a whole number must")
    return whole


def _run(alike: NDArray[np.bool_], window: int) -> tuple[int, int]:
    """How many rows from the first on are alike, and how many to look at next: twice as many if all were.

    So every row is looked at a bounded number of times, however a file mixes them.
    """
    if len(alike) and alike.all():
        return len(alike), 2 * window
    return max(1, int(np.argmin(alike)) if len(alike) else 1), 1


def _counted(nodes: int) -> int:
    if nodes < 1:
        raise ValueError(f"an element has values at {nodes} nodes")
    return nodes


def _width(kind: int, tags: int) -> int:
    if tags < 0:
        raise ValueError(f"an element has {tags} tags")
    return 1 + tags + nodes_of(kind)
