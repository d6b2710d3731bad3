"""Content of mesh files, independent of their format."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kohonen_adapt.arrays import Array, Floats, Ints
from kohonen_adapt.mesh.host import keys_of

__all__ = [
    "CORNERS",
    "DIMENSION",
    "EXACT_INTEGERS",
    "GMSH_TETRAHEDRON",
    "LARGEST_TAG",
    "LINE",
    "MSH_VERSION",
    "POINT",
    "TETRAHEDRON",
    "TRIANGLE",
    "Block",
    "CellFields",
    "Content",
    "Field",
    "GroupNames",
    "Named",
    "Rows",
    "as_value_error",
    "check_finite",
    "check_flat",
    "check_nodes",
    "content_of_sets",
    "in_space",
    "indices_in",
    "nodes_per_element",
    "parse_numbers",
    "placed",
    "rows_by_type",
    "rows_in",
    "shape_of",
    "suffix_of",
    "union",
]

MSH_VERSION = {".msh": "4.1", ".msh2": "2.2"}
"""Suffix to version of MSH; Gmsh uses `.msh2` for 2.2, too."""

GMSH_TETRAHEDRON = [*range(8), 9, 8]  # ten nodes of VTK and Elmer in Gmsh's order, and back
LARGEST_TAG = 2**31 - 1  # of a physical group: Gmsh stores tags as int
EXACT_INTEGERS = 2.0**53  # smaller integers are exact as floats, to which text is parsed
MAX_REASON = 160  # characters of a reason, which may quote the file

ROTATE = {
    0: "The drawing is in the yz-plane; rotate it (Gmsh: Rotate {{0, 1, 0}, {0, 0, 0}, Pi/2} {Surface{:};}).",
    1: "The drawing is in the xz-plane; rotate it (Gmsh: Rotate {{1, 0, 0}, {0, 0, 0}, -Pi/2} {Surface{:};}).",
}
"""Index of the constant coordinate of a plane drawing to the remedy."""

SOLID = (
    "For a solid, mesh the volume (gmsh -3) and give the volume a physical group, too, if there are groups: Gmsh saves "
    "only elements in groups."
)

FLAT = 1e-9
"""Tolerance for a plane z = constant, relative to the size of the mesh."""

POINT, LINE, TRIANGLE, TETRAHEDRON = "point", "line", "triangle", "tetrahedron"
CORNERS = {POINT: 1, LINE: 2, TRIANGLE: 3, TETRAHEDRON: 4}
OTHERS = {"quadrilateral": 2, "hexahedron": 3, "prism": 3, "pyramid": 3}
DIMENSION = {**{shape: corners - 1 for shape, corners in CORNERS.items()}, **OTHERS}
"""Shape to dimension."""

# Nodes per element by Gmsh's numbers for element types; the corners are always first.
_SHAPES = {
    POINT: {15: 1},
    LINE: {1: 2, 8: 3, 26: 4, 27: 5, 28: 6},
    TRIANGLE: {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21},
    "quadrilateral": {3: 4, 10: 9, 16: 8, 36: 16, 37: 25},
    TETRAHEDRON: {4: 4, 11: 10, 29: 20, 30: 35},
    "hexahedron": {5: 8, 12: 27, 17: 20},
    "prism": {6: 6, 13: 18, 18: 15},
    "pyramid": {7: 5, 14: 14, 19: 13},
}
_TYPES = {number: (shape, nodes) for shape, types in _SHAPES.items() for number, nodes in types.items()}


GroupNames = dict[tuple[int, int], str]
"""Dimension and tag of physical groups to their names."""


@dataclass(frozen=True)
class Rows:
    """Elements of one type as a file lists them.

    There is one row per element and group, so an element may have several rows.

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

    @classmethod
    def joined(cls, parts: Sequence["Rows"], nodes: int) -> "Rows":
        none = np.empty(0, int)
        return cls(
            np.concatenate([np.empty((0, nodes), int), *(part.nodes[:, :nodes] for part in parts)]),
            np.concatenate([none, *(part.group for part in parts)]),
            np.concatenate([none, *(part.number for part in parts)]),
        )


@dataclass(frozen=True)
class Content:
    """Content of a mesh file.

    Attributes
    ----------
    points
        (n, 3), in the order of the node numbers.
    rows
        Elements by Gmsh's number of their type.
    names
        Names of physical groups by (dimension, tag), because a tag may occur once per dimension.
    missing
        Tags of the surfaces of the geometry without triangles in the file; of a solid, volumes without tetrahedra.
    numbers
        (n,): numbers of the nodes in the file, if any.
    version
        Version of MSH, empty for another format.
    """

    points: Floats
    rows: dict[int, Rows]
    names: GroupNames
    missing: tuple[int, ...] = ()
    numbers: Ints = field(default_factory=lambda: np.empty(0, int))
    version: str = ""

    @property
    def dimension(self) -> int:
        return max([2, *(DIMENSION[shape_of(kind)] for kind, rows in self.rows.items() if len(rows.number))])

    def of_shape(self, shape: str) -> Rows:
        parts = [rows for kind, rows in sorted(self.rows.items()) if shape_of(kind) == shape]
        return Rows.joined(parts, CORNERS[shape])


@dataclass(frozen=True)
class Field:
    """Field on the nodes or cells of a file.

    Attributes
    ----------
    name
        Name in the file.
    nodal
        True for a field on nodes, False on cells.
    values
        (nodes, components), or (cells, corners, components) with one corner for a constant, of any type.
    """

    name: str
    nodal: bool
    values: Array


@dataclass(frozen=True)
class CellFields:
    """Triangles or tetrahedra with fields.

    Attributes
    ----------
    points
        (n, 3).
    cells
        (m, 3 or 4): rows of `points`.
    fields
        All fields of the file; a name may occur twice.
    """

    points: Floats
    cells: Ints
    fields: list[Field]


Block = tuple[int, Rows]
"""Type and elements."""

Named = tuple[int, str, Ints, Ints]
"""Type, name, nodes and numbers of the elements of a set."""


def check_nodes(nodes: Ints, count: int) -> None:
    if np.any((nodes < 0) | (nodes >= count)):
        raise ValueError("an element has a node that does not exist")


def content_of_sets(points: Floats, sets: Iterable[Named]) -> Content:
    # An empty name stands for elements without a group.
    tags: dict[tuple[int, str], int] = {}
    blocks = list[Block]()
    for kind, name, nodes, number in sets:
        check_nodes(nodes, len(points))
        tag = tags.setdefault((DIMENSION[shape_of(kind)], name), 1 + len(tags)) if name else 0
        blocks.append((kind, Rows(nodes, np.full(len(nodes), tag), number)))
    return Content(points, rows_by_type(blocks), {(dimension, tag): name for (dimension, name), tag in tags.items()})


def rows_by_type(blocks: Iterable[Block]) -> dict[int, Rows]:
    found: dict[int, list[Rows]] = {}
    for kind, rows in blocks:
        found.setdefault(kind, []).append(rows)
    return {kind: Rows.joined(parts, nodes_per_element(kind)) for kind, parts in found.items()}


def shape_of(kind: int) -> str:
    return _TYPES[kind][0]


def nodes_per_element(kind: int) -> int:
    if kind not in _TYPES:
        raise ValueError(f"element type {kind} is unknown: mesh with an order (Mesh.ElementOrder) of at most 5")
    return _TYPES[kind][1]


def union(sets: Iterable[Ints]) -> Ints:
    return np.unique(np.concatenate([np.empty(0, int), *sets]))


def in_space(points: Floats) -> Floats:
    """Return points or vectors (n, d) with three coordinates."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def indices_in(known: Ints, wanted: Ints) -> Ints:
    """Return the index in `known` (k,) of every entry of `wanted`, or -1."""
    if len(known) == 0:
        return np.full(wanted.shape, -1)
    order = np.argsort(known, kind="stable")
    place = order[np.searchsorted(known, wanted, sorter=order).clip(max=len(known) - 1)]
    return np.where(known[place] == wanted, place, -1)


def placed(rows: Rows, numbers: Ints) -> Rows:
    """Return rows with the index of every node in the node numbers of a file."""
    if rows.nodes.size and not len(numbers):
        raise ValueError("it has elements and no nodes")
    place = indices_in(numbers, rows.nodes)
    if np.any(place < 0):
        raise ValueError(f"an element has node {rows.nodes[place < 0][0]}, which does not exist")
    return replace(rows, nodes=place)


def rows_in(known: Ints, wanted: Ints) -> Ints:
    """Return the row of `known` with the nodes of each row of `wanted`, or -1."""
    nodes = np.sort(np.vstack([known, wanted]), axis=1).T
    key = keys_of(nodes, 1 + int(nodes.max(initial=0)))
    return indices_in(key[: len(known)], key[len(known) :])


def parse_numbers(text: str | bytes) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy only warns about some invalid text
        try:
            return np.fromstring(text.strip(), sep=" ")
        except (DeprecationWarning, RuntimeWarning, ValueError):
            raise ValueError("a section of numbers has other text") from None


def suffix_of(path: Path, caller: str, known: tuple[str, ...], remedy: str = "") -> str:
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(f"{caller} expected a file name that ends in {', '.join(known)}; got '{path.name}'.{remedy}")
    return suffix


def check_finite(points: Floats, path: Path, caller: str, what: str) -> None:
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        raise ValueError(
            f"{caller} expected finite coordinates; '{path}' has a {what} at {points[first]}, number {first + 1} of "
            f"{len(points)} in the file. Mesh again."
        )


def check_flat(points: Floats, path: Path, what: str = "node") -> None:
    check_finite(points, path, "read_mesh", what)
    extent = np.ptp(points, axis=0)
    if extent[2] > FLAT * extent.max():
        low, high = points[:, 2].min(), points[:, 2].max()
        flat = np.flatnonzero(extent <= FLAT * extent.max())
        remedy = ROTATE.get(int(flat[0])) if len(flat) == 1 else None
        raise ValueError(
            f"read_mesh expected a drawing in the xy-plane; z runs from {low:g} to {high:g} in '{path}'. "
            f"{remedy or SOLID}"
        )


@contextmanager
def as_value_error(path: Path, message: str) -> Iterator[None]:
    """Raise errors of a reader as a ValueError of one line.

    Parameters
    ----------
    path
        File being read.
    message
        Line of the error, with ``{}`` for the reason.
    """
    try:
        yield
    except MemoryError:
        raise ValueError(f"'{path}' does not fit into memory.") from None
    except (ArithmeticError, LookupError, SyntaxError, TypeError, ValueError) as error:
        reason = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        line = "".join(sign if sign.isprintable() else " " for sign in reason[: 2 * MAX_REASON])
        raise ValueError(message.format(line if len(reason) <= MAX_REASON else f"{line[:MAX_REASON]}...")) from error
