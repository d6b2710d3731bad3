"""Read Gmsh's post-processing views: data on the mesh of an MSH file, and lists of triangles as GetDP writes them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.io.content import TRIANGLE, Content, Field, Sampled, found_in, parsed, refusing
from kohonen_adapt.io.gmsh_numbers import Numbers
from kohonen_adapt.io.gmsh_reader import header_of, read_msh

__all__ = ["read_views"]

SECTION = re.compile(rb"\n\$(NodeData|ElementData|ElementNodeData)[ \t\r]*\n")
VIEW = re.compile(rb'\bView\s*"([^"\n]*)"\s*\{')
TRIANGLES = re.compile(rb"\bST\s*\(([^(){}]*)\)\s*\{([^(){}]*)\}")
CORNERS, VALUES = 9, 3  # numbers of a triangle of a list, and of its scalar


@dataclass(frozen=True)
class View:
    """Rows of data that name a node or an element by its number in the file.

    Attributes
    ----------
    kind
        "NodeData", "ElementData" or "ElementNodeData".
    name
        Of the view.
    number
        (m,).
    values
        (m, components); means over the nodes of an element where there is one for each.
    """

    kind: str
    name: str
    number: Ints
    values: Floats


def read_views(path: Path) -> Sampled:
    """The triangles of a file and the fields on them.

    Parameters
    ----------
    path
        MSH 2.2 or 4.1 with ``$NodeData``, ``$ElementData`` or ``$ElementNodeData``, or a list of triangles
        (``View "name" {ST(...){...}; };``).

    Raises
    ------
    ValueError
        If it is neither, or damaged.
    """
    with refusing(path, f"read_field cannot read '{path}': {{}}."):
        data = path.read_bytes()
    if data[:80].lstrip()[:4] == b"View":
        return _listed(data, path)
    binary = header_of(data, path)[1]
    content = read_msh(path)
    with refusing(path, f"'{path}' is not a complete Gmsh file: {{}}. Write it again."):
        return _on_mesh(content, list(_views(data, binary)))


def _listed(data: bytes, path: Path) -> Sampled:
    """Every view of a list has triangles of its own; those of the first count, and others must be the same."""
    fields: list[Field] = []
    corners = np.empty((0, CORNERS))
    found = list(VIEW.finditer(data))
    if not found:
        raise ValueError(f"read_field expected lists of triangles; '{path}' begins like one and has none.")
    ends = [*(view.start() for view in found[1:]), len(data)]
    for view, end in zip(found, ends, strict=True):
        name, rows = view[1], TRIANGLES.findall(data, view.end(), end)
        try:
            places = _numbers([place for place, _ in rows]).reshape(len(rows), CORNERS)
            table = _numbers([value for _, value in rows]).reshape(len(rows), VALUES)
        except ValueError:
            raise ValueError(
                f"'{path}' must have triangles of nine coordinates and three values, one step; write one step only."
            ) from None
        if len(fields) and not np.array_equal(places, corners):
            raise ValueError(f"'{path}' has views on other triangles; write each to a file of its own.")
        corners = places
        fields.append(Field(name.decode("utf-8", "replace"), False, table.mean(axis=1)[:, None]))
    points, node = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Sampled(points, node.reshape(-1, 3), fields)


def _numbers(lists: list[bytes]) -> Floats:
    return parsed(b",".join(lists).replace(b",", b" "))


def _views(data: bytes, binary: bool) -> Iterator[View]:
    for found in SECTION.finditer(data):
        kind = found[1].decode()
        (name, components, count), start = _tags(data, found.end())
        numbers = Numbers(data, start, binary)
        rows = numbers.means if kind == "ElementNodeData" else numbers.rows
        yield View(kind, name, *rows(count, components))


def _tags(data: bytes, start: int) -> tuple[tuple[str, int, int], int]:
    """Name, components and rows of a section, and where its rows begin."""

    def line() -> bytes:
        nonlocal start
        end = data.index(b"\n", start)
        text, start = data[start:end].strip(), end + 1
        return text

    words, _, integers = ([line() for _ in range(_size(line()))] for _ in range(3))
    if not words or len(integers) < 3:
        raise ValueError("a view lacks its name, components or size")
    return (words[0].strip(b'"').decode("utf-8", "replace"), _size(integers[1]), _size(integers[2])), start


def _size(text: bytes) -> int:
    number = int(text[:20])
    if number < 0:
        raise ValueError(f"a view has the size {number}")
    return number


def _on_mesh(content: Content, views: list[View]) -> Sampled:
    rows = content.of_shape(TRIANGLE)
    # An element of several groups is listed again, in MSH 2.2 under another number: any of them has its data.
    triangles, element = np.unique(np.sort(rows.nodes, axis=1), axis=0, return_inverse=True)
    fields = []
    for view in views:
        nodal = view.kind == "NodeData"
        values = np.full((len(content.points) if nodal else len(triangles), view.values.shape[1]), np.nan)
        owner, known = (np.arange(len(content.points)), content.numbers) if nodal else (element.ravel(), rows.number)
        place = found_in(known, view.number)
        values[owner[place[place >= 0]]] = view.values[place >= 0]
        fields.append(Field(view.name, nodal, values))
    return Sampled(content.points, triangles, fields)
