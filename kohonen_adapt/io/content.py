"""What a mesh file holds, before anything is made of it."""

from dataclasses import dataclass, field

import numpy as np

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["LINE", "TRIANGLE", "Content", "Rows", "nodes_of", "shape_of"]


LINE, TRIANGLE = "line", "triangle"

# Nodes per element by Gmsh's numbers for element types; the corners always come first.
_SHAPES = {
    "point": {15: 1},
    LINE: {1: 2, 8: 3, 26: 4, 27: 5, 28: 6},
    TRIANGLE: {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21},
    "quadrilateral": {3: 4, 10: 9, 16: 8, 36: 16, 37: 25},
    "3D": {4: 4, 5: 8, 6: 6, 7: 5, 11: 10, 12: 27, 13: 18, 14: 14, 17: 20, 18: 15, 19: 13, 29: 20, 30: 35},
}
_TYPES = {number: (shape, nodes) for shape, types in _SHAPES.items() for number, nodes in types.items()}


@dataclass(frozen=True)
class Rows:
    """Elements of one type as a file lists them: one row per element and group, so an element may come again.

    Attributes
    ----------
    nodes
        (m, nodes per element): rows of `Content.points`.
    group
        (m,): tag of the physical group, 0 for none.
    number
        (m,): number of the element in the file.
    """

    nodes: Ints
    group: Ints
    number: Ints


@dataclass(frozen=True)
class Content:
    """A mesh file as it stands.

    Attributes
    ----------
    points
        (n, 3), in the order of the numbers of the nodes.
    rows
        The elements by Gmsh's number of their type.
    names
        Names of physical groups by (dimension, tag): the same tag may come once per dimension.
    missing
        Tags of surfaces of the geometry whose triangles are not in the file.
    numbers
        (n,): numbers of the nodes in the file, if it has any.
    """

    points: Floats
    rows: dict[int, Rows]
    names: dict[tuple[int, int], str]
    missing: tuple[int, ...] = ()
    numbers: Ints = field(default_factory=lambda: np.empty(0, np.int64))


def shape_of(kind: int) -> str:
    """Name of the shape of elements of Gmsh's type `kind`."""
    return _TYPES[kind][0]


def nodes_of(kind: int) -> int:
    """Nodes per element of Gmsh's type `kind`; an unknown one is a ValueError."""
    if kind not in _TYPES:
        raise ValueError(f"element type {kind} is unknown")
    return _TYPES[kind][1]
