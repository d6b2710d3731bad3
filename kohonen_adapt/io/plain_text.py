"""Meshes of FreeFEM and MFEM in their own text formats."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from kohonen_adapt.arrays import Ints
from kohonen_adapt.io.content import (
    DIMENSION,
    Content,
    Named,
    as_value_error,
    content_of_sets,
    in_space,
    nodes_per_element,
    parse_numbers,
    shape_of,
)
from kohonen_adapt.io.groups import UNNAMED

__all__ = ["is_freefem", "is_mfem", "read_freefem", "read_mfem"]

LINE, TRIANGLE, TETRAHEDRON = 1, 2, 4
COUNTS = re.compile(rb"\s*[0-9]+[ \t]+[0-9]+[ \t]+[0-9]+[ \t\r]*\n")
MFEM = b"MFEM mesh v1."
GEOMETRIES = {0: 15, 1: LINE, 2: TRIANGLE, 3: 3, 4: TETRAHEDRON, 5: 5, 6: 6, 7: 7}  # others are refused by their shapes
SECTIONS = re.compile(r"(?m)^([a-z_]+)[ \t\r]*$")


def is_freefem(data: bytes) -> bool:
    return COUNTS.match(data) is not None


def is_mfem(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(len(MFEM)) == MFEM


def read_freefem(path: Path) -> Content:
    with as_value_error(path, f"read_mesh expected a mesh of FreeFEM; '{path}' cannot be read: {{}}."):
        values = parse_numbers(path.read_bytes())
        vertices, triangles, edges = values[:3].astype(int)
        ends = 3 + np.cumsum([3 * vertices, 4 * triangles, 3 * edges])
        if len(values) != ends[-1]:
            raise ValueError(f"it announces {ends[-1]} numbers and has {len(values)}")
        points = in_space(values[3 : ends[0]].reshape(-1, 3)[:, :2])
        _, *tables = np.split(values.astype(int), ends)
        sets = [
            (kind, rows[:, :-1] - 1, rows[:, -1])
            for kind, corners, table in zip((TRIANGLE, LINE), (3, 2), tables, strict=False)
            for rows in [table.reshape(-1, corners + 1)]
        ]
        return content_of_sets(points, _named(sets, 2))


def read_mfem(path: Path) -> Content:
    with as_value_error(path, f"read_mesh expected a mesh of MFEM; '{path}' cannot be read: {{}}."):
        text = re.sub(r"#.*", "", path.read_text("utf-8", "replace"))
        _, *parts = SECTIONS.split(text)
        sections = dict(zip(parts[::2], (parse_numbers(part) for part in parts[1::2]), strict=True))
        others = sections.keys() - {"dimension", "elements", "boundary", "vertices"}
        if others or not {"dimension", "elements", "vertices"} <= sections.keys():
            raise ValueError(f"it has {', '.join(sections)}; save the mesh without curved sides and refinement")
        count, dimension, *_ = sections["vertices"].astype(int)
        points = in_space(sections["vertices"][2:].reshape(count, dimension))
        sets = [
            each for name in ("elements", "boundary") for each in _rows(sections.get(name, np.zeros(1)).astype(int))
        ]
        return content_of_sets(points, _named(sets, int(sections["dimension"][0])))


def _rows(words: Ints) -> Iterator[tuple[int, Ints, Ints]]:
    rows: dict[int, list[Ints]] = {}
    start = 1
    for _ in range(words[0]):
        kind = GEOMETRIES[int(words[start + 1])]
        end = start + 2 + nodes_per_element(kind)
        rows.setdefault(kind, []).append(words[start:end])
        start = end
    for kind, parts in rows.items():
        table = np.stack(parts)
        yield kind, table[:, 2:], table[:, 0]


def _named(sets: Sequence[tuple[int, Ints, Ints]], dimension: int) -> Iterator[Named]:
    first = 0
    for kind, nodes, group in sets:
        own = DIMENSION[shape_of(kind)]
        for tag in np.unique(group).tolist():
            is_named = own <= dimension and (tag or (own == dimension and np.any(group)))
            rows = np.flatnonzero(group == tag)
            yield kind, UNNAMED[dimension][own].format(tag) if is_named else "", nodes[rows], first + rows
        first += len(nodes)
