"""Reader of Gmsh files, MSH 2.2 and 4.1, text and binary.

meshio reads these files, too, but drops the numbers and order of nodes and elements, reversed groups, all groups of an
element except the first if groups have no names, and one of two groups with the same name. Files of version 4.1 with an
untagged entity are refused by meshio.
"""

import re
from pathlib import Path

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.display import plural
from kohonen_adapt.io.content import (
    CORNERS,
    LARGEST_TAG,
    LINE,
    TETRAHEDRON,
    TRIANGLE,
    Block,
    CellFields,
    Content,
    Field,
    GroupNames,
    Rows,
    as_value_error,
    indices_in,
    nodes_per_element,
    parse_numbers,
    placed,
    rows_by_type,
    shape_of,
)
from kohonen_adapt.io.gmsh_numbers import SIZE, Numbers
from kohonen_adapt.io.plain_text import is_freefem, read_freefem

__all__ = ["read_msh", "read_views"]

OfEntities = dict[tuple[int, int], Ints]
"""Dimension and tag of entities to their groups, with negative numbers if reversed."""

HEADER_BYTES = 2**16
"""Bytes that must contain the header, read before the rest."""

ALLOWED_ROWS = 10**6
"""Rows (one per element and group) allowed in any file; larger files may have two rows per byte."""

TRIANGLE3 = 2
"""Gmsh's number for triangles of three nodes, the only type of triangle with a direction."""

SECTION = re.compile(rb"\n\$(NodeData|ElementData|ElementNodeData)[ \t\r]*\n")
VIEW = re.compile(rb'\bView\s*"([^"\n]*)"\s*\{')
LIST_ITEM = re.compile(rb"\b([SVT][A-Z]2?)\s*\(([^(){}]*)\)\s*\{([^(){}]*)\}")
LETTER = {TRIANGLE: "T", TETRAHEDRON: "S"}
COMPONENTS = {"S": 1, "V": 3, "T": 9}  # values at a corner: scalar, vector, tensor


def read_msh(path: Path) -> Content:
    with path.open("rb") as stream:
        start = stream.read(HEADER_BYTES)
        if is_freefem(start):
            return read_freefem(path)
        version, binary = _header_of(start, path)
        with as_value_error(path, f"'{path}' is not a complete Gmsh file: {{}}. Write it again with Gmsh."):
            return _content(start + stream.read(), version, binary)


def _header_of(data: bytes, path: Path) -> tuple[str, bool]:
    start = data.find(b"$MeshFormat")
    words = data[start : start + 80].split()[1:4]
    if start < 0 or len(words) < 3:
        remedy = f" It is MSH 1: gmsh '{path.name}' -save -format msh41 -o NEW.msh" if data.startswith(b"$NOD") else ""
        raise ValueError(f"read_mesh expected a Gmsh file; '{path}' has no section $MeshFormat.{remedy}")
    version, kind, size = (word.decode("ascii", "replace") for word in words)
    if version not in ("2", "2.0", "2.1", "2.2", "4.1") or kind not in ("0", "1") or size != "8":
        raise ValueError(
            f"read_mesh expected MSH 2.2 or 4.1 with numbers of 8 bytes; '{path}' is MSH {version} with {size} bytes. "
            "Convert it: gmsh FILE -save -format msh41 -o NEW.msh"
        )
    return version, kind == "1"


def _content(data: bytes, version: str, binary: bool) -> Content:
    def section(name: str) -> Numbers:
        start = data.find(b"\n$" + name.encode()) + 1
        if start == 0:
            raise ValueError(f"section ${name} is missing")
        return Numbers(data, data.index(b"\n", start) + 1, binary)

    missing: tuple[int, ...] = ()
    if version == "4.1":
        groups = OfEntities()
        for name, of_parts in (("Entities", False), ("PartitionedEntities", True)):
            if f"\n${name}".encode() in data:
                _entities(section(name), groups, of_parts)
        numbers, points = _nodes_41(section("Nodes"))
        blocks, meshed = _elements_41(section("Elements"), groups, max(ALLOWED_ROWS, 2 * len(data)))
        highest = max((dimension for dimension, _ in meshed), default=0)
        missing = tuple(sorted(tag for dimension, tag in groups.keys() - meshed if dimension == highest > 1))
    else:
        parametric = b"\n$ParametricNodes" in data
        nodes = section("ParametricNodes" if parametric else "Nodes")
        numbers, points = nodes.parametric_rows(nodes.count()) if parametric else nodes.rows(nodes.count(), 3)
        elements, blocks = section("Elements"), list[Block]()
        for kind, tags, table in elements.elements(elements.count()):
            group = table[:, 1] if tags else np.zeros(len(table), int)
            blocks.append((kind, _with_direction(kind, table[:, 1 + tags :], group, table[:, 0])))
    order = np.argsort(numbers, kind="stable")
    rows = {kind: placed(own, numbers[order]) for kind, own in rows_by_type(blocks).items()}
    return Content(points[order], rows, _names(data), missing, numbers[order], "4.1" if version == "4.1" else "2.2")


def _names(data: bytes) -> GroupNames:
    start = data.find(b"\n$PhysicalNames")
    if start < 0:
        return {}
    lines = data[start : data.index(b"\n$EndPhysicalNames", start)].decode("utf-8", "replace").split("\n")[3:]
    names = {}
    for line in lines:
        dimension, tag, quoted = line.split(maxsplit=2)
        if abs(int(tag)) > LARGEST_TAG:
            raise ValueError(f"a group has the number {tag}")
        names[int(dimension), abs(int(tag))] = quoted[quoted.index('"') + 1 : quoted.rindex('"')]
    return names


def _entities(section: Numbers, groups: OfEntities, of_parts: bool) -> None:
    if of_parts:
        section.integer(SIZE)
        section.ints(2 * section.integer(SIZE))  # ghosts
    for dimension, count in enumerate(section.ints(4, SIZE)):
        for _ in range(count):
            tag = section.integer()
            if of_parts:  # elements belong to the parts of an entity, which have its groups
                groups.pop(tuple(section.ints(2).tolist()), None)
                section.ints(section.integer(SIZE))
            section.take(6 if dimension else 3)
            groups[dimension, tag] = section.ints(section.integer(SIZE))
            if dimension:
                section.ints(section.integer(SIZE))


def _nodes_41(section: Numbers) -> tuple[Ints, Floats]:
    numbers: list[Ints] = [np.empty(0, int)]
    points = [np.empty((0, 3))]
    for _ in range(section.ints(4, SIZE)[0]):
        dimension, _, parametric = (section.integer() for _ in range(3))
        count = section.integer(SIZE)
        numbers.append(section.ints(count, SIZE))
        width = 3 + (dimension if parametric else 0)
        points.append(section.take(count * width).reshape(-1, width)[:, :3])
    return np.concatenate(numbers), np.concatenate(points)


def _elements_41(section: Numbers, groups: OfEntities, most: int) -> tuple[list[Block], set[tuple[int, int]]]:
    blocks, meshed = [], set()
    for _ in range(section.ints(4, SIZE)[0]):
        dimension, entity, kind = (section.integer() for _ in range(3))
        width = 1 + nodes_per_element(kind)
        table = section.ints(section.integer(SIZE) * width, SIZE).reshape(-1, width)
        meshed.add((dimension, entity))
        tags = groups.get((dimension, entity), ())
        most -= len(tags) * len(table)
        if most < 0:
            raise ValueError("it has elements in more groups than a mesh of its size can need")
        for tag in tags if len(tags) else (0,):
            blocks.append((kind, _with_direction(kind, table[:, 1:], np.full(len(table), tag), table[:, 0])))
    return blocks, meshed


def _with_direction(kind: int, nodes: Ints, group: Ints, number: Ints) -> Rows:
    if shape_of(kind) == LINE or kind == TRIANGLE3:
        nodes = np.where(group[:, None] < 0, nodes[:, [1, 0, *range(2, nodes.shape[1])]], nodes)
    return Rows(nodes, np.abs(group), number)


def read_views(path: Path, shape: str) -> CellFields:
    """Return the cells of a shape in a file, and the fields on them.

    The file is MSH 2.2 or 4.1 with ``$NodeData``, ``$ElementData`` or ``$ElementNodeData``, or a list of triangles
    (``View "name" {ST(...){...}; };``) or tetrahedra (``SS``).
    """
    with as_value_error(path, f"read_field cannot read '{path}': {{}}."):
        data = path.read_bytes()
    if data[:80].lstrip()[:4] == b"View":
        return _read_lists(data, path, shape)
    version, binary = _header_of(data, path)
    with as_value_error(path, f"'{path}' is not a complete Gmsh file: {{}}. Write it again."):
        return _views(data, binary, _content(data, version, binary), shape)


def _read_lists(data: bytes, path: Path, shape: str) -> CellFields:
    fields: list[Field] = []
    width = CORNERS[shape]
    corners = np.empty((0, 3 * width))
    _, *parts = VIEW.split(data)
    if not parts:
        raise ValueError(
            f"read_field expected lists of {plural(shape)}; '{path}' begins with View, but has no such list."
        )
    for view, body in zip(parts[::2], parts[1::2], strict=True):
        name, rows = view.decode("utf-8", "replace"), LIST_ITEM.findall(body)
        components = _components(name, {kind.decode() for kind, _, _ in rows}, path, shape)
        try:
            places = _numbers([place for _, place, _ in rows]).reshape(len(rows), 3 * width)
            table = _numbers([value for _, _, value in rows]).reshape(len(rows), width, components)
        except ValueError:
            raise ValueError(
                f"'{path}' must have {plural(shape)} of {3 * width} coordinates and {width} values, one step; "
                "write one step only."
            ) from None
        if len(fields) and not np.array_equal(places, corners):
            raise ValueError(f"'{path}' has views on different {plural(shape)}; write each view to its own file.")
        corners = places
        fields.append(Field(name, False, table))
    points, node = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return CellFields(points, node.reshape(-1, width), fields)


def _components(name: str, kinds: set[str], path: Path, shape: str) -> int:
    known = {kind + LETTER[shape]: components for kind, components in COMPONENTS.items()}
    others = sorted(kinds - known.keys())
    if others or len(kinds) > 1:
        raise ValueError(
            f"read_field expected {plural(shape)} of one kind ({', '.join(known)}); the view '{name}' of '{path}' has "
            f"{listed(others or kinds)}. Write it on {plural(shape)} alone."
        )
    return known[kinds.pop()] if kinds else 1


def _numbers(lists: list[bytes]) -> Floats:
    return parse_numbers(b",".join(lists).replace(b",", b" "))


def _views(data: bytes, binary: bool, content: Content, shape: str) -> CellFields:
    rows = content.of_shape(shape)
    # An element of several groups is listed several times, in MSH 2.2 under several numbers; data may refer to any.
    cells, element = np.unique(np.sort(rows.nodes, axis=1), axis=0, return_inverse=True)
    fields = []
    for found in SECTION.finditer(data):
        kind = found[1].decode()
        (name, components, count), start = _tags(data, found.end())
        numbers, width = Numbers(data, start, binary), CORNERS[shape]
        # Numbers of nodes or elements (n,), and values (n, 1 or corners, components)
        if kind != "ElementNodeData":
            number, given = numbers.rows(count, components)
            parts = [(number, given[:, None])]
        else:
            parts = list(numbers.nodal_rows(count, components))
            if components == COMPONENTS["T"]:
                parts = [(number, given[:, :width]) for number, given in parts if given.shape[1] >= width]
            else:
                parts = [(number, given.mean(axis=1, keepdims=True)) for number, given in parts]
        nodal = kind == "NodeData"
        owner, known = (np.arange(len(content.points)), content.numbers) if nodal else (element.ravel(), rows.number)
        corners = max((given.shape[1] for _, given in parts), default=1)
        values = np.full((len(content.points) if nodal else len(cells), corners, components), np.nan)
        for number, given in parts:
            place = indices_in(known, number)
            values[owner[place[place >= 0]]] = given[place >= 0]
        fields.append(Field(name, nodal, values[:, 0] if nodal else values))
    return CellFields(content.points, cells, fields)


def _tags(data: bytes, start: int) -> tuple[tuple[str, int, int], int]:
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
