"""Meshes from the solution files (.ans) of FEMM."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import listed
from kohonen_adapt.io.content import Content, Named, as_value_error, content_of_sets, in_space
from kohonen_adapt.log import logger

__all__ = ["read_ans"]


UNITS = {
    "inches": 0.0254,
    "millimeters": 1e-3,
    "centimeters": 1e-2,
    "meters": 1.0,
    "mils": 2.54e-5,
    "micrometers": 1e-6,
    "microns": 1e-6,
}
"""FEMM's name of a unit of length to metres."""

PERIODIC = (4, 5)  # types of boundaries whose two sides have one name
AIR_GAP = (6, 7)  # without triangles between rotor and stator

LINE, TRIANGLE = 1, 2
NEAR = 1e-7  # tolerance for nodes on a curve, relative to the length of a segment or the radius of an arc

Complex = NDArray[np.complex128]


def read_ans(path: Path) -> Content:
    # Boundaries are found as the nodes on segments and arcs with a property, because files before 2018 do not list
    # the sides of triangles.
    with as_value_error(path, f"read_mesh expected a solution of FEMM; '{path}' cannot be read: {{}}."):
        head, mark, solution = path.read_text("utf-8", "replace").partition("[Solution]")
        if not mark:
            raise ValueError("it has no [Solution]: analyse the model in FEMM, and use the .ans file of the solution")
        lines = solution.split("\n")[1:]
        nodes = _table(lines, 2)
        elements = _table(lines[1 + len(nodes) :], 4).astype(int)
        blocks, boundaries = _blocks(head, elements), _boundaries(head, nodes[:, 0] + 1j * nodes[:, 1])
        points = _unit(head) * in_space(nodes)
        return content_of_sets(points, [*blocks, *boundaries])


def _unit(head: str) -> float:
    found = re.search(r"\[LengthUnits\]\s*=\s*(\w+)", head)
    name = found[1].lower() if found else "inches"  # the default of FEMM
    if name not in UNITS:
        raise ValueError(f"its unit of length is '{name}'; FEMM has {listed(UNITS)}")
    return UNITS[name]


def _table(lines: list[str], columns: int) -> Floats:
    count = int(lines[0].split("=")[-1])
    rows = [line.split()[:columns] for line in lines[1 : 1 + max(count, 0)]]
    if len(rows) != count:
        raise ValueError(f"it announces {count} rows, but has {len(rows)}")
    return np.array(rows, float).reshape(count, columns)


def _section(head: str, name: str, columns: int) -> Floats:
    start = head.find(f"[{name}]")
    return _table(head[start:].split("\n"), columns) if start >= 0 else np.empty((0, columns))


def _blocks(head: str, elements: Ints) -> Iterator[Named]:
    # (type, name, nodes, numbers) of blocks, and of several labels of a block
    names = ["", *re.findall(r'<BlockName>\s*=\s*"([^"]*)"', head)]
    block = _section(head, "NumBlockLabels", 3)[:, 2].astype(int)
    label, number = elements[:, 3], np.arange(len(elements))
    if np.any((label < 0) | (label >= len(block))) or np.any((block < 0) | (block >= len(names))):
        raise ValueError("a triangle is in a block that does not exist")
    for k in np.unique(block).tolist():
        members = np.flatnonzero(block[label] == k)
        yield TRIANGLE, names[k], elements[members, :3], number[members]
        labels = np.flatnonzero(block == k).tolist()
        for place, own in enumerate(labels if k > 0 and len(labels) > 1 else [], 1):
            yield TRIANGLE, f"{names[k]} {place}", elements[label == own, :3], number[label == own]


def _boundaries(head: str, nodes: Complex) -> Iterator[Named]:
    names = ["", *re.findall(r'<BdryName>\s*=\s*"([^"]*)"', head)]
    kinds = [0, *map(int, re.findall(r"<BdryType>\s*=\s*(\d+)", head))]
    gaps = [name for name, kind in zip(names, kinds, strict=True) if kind in AIR_GAP]
    if gaps:
        logger.warning(
            "the air gap element %s has no triangles, so the mesh has a hole there. In FEMM, clear the boundary "
            "property, put a block label into the gap and analyse again.",
            listed(gaps),
        )
    sides = Counter[int]()
    ends = _section(head, "NumPoints", 2) @ [1.0, 1.0j]
    # Ends, angle, size and property of arcs, which segments have without an angle
    segments = np.insert(_section(head, "NumSegments", 4), 2, 0.0, axis=1)
    for row in np.vstack([segments, _section(head, "NumArcSegments", 5)]):
        first, last, which = row[[0, 1, 4]].astype(int).tolist()
        if which > 0:
            node = _nodes_on_curve(nodes, ends[first], ends[last], np.radians(row[2]))
            lines, number = np.column_stack([node[:-1], node[1:]]), np.arange(len(node) - 1)
            yield LINE, names[which], lines, number
            if kinds[which] in PERIODIC:
                sides[which] += 1
                yield LINE, f"{names[which]} {sides[which]}", lines, number


def _nodes_on_curve(nodes: Complex, start: complex, end: complex, angle: float) -> Ints:
    if angle > 0.0:
        centre = 0.5 * (start + end) + 0.5j * (end - start) / np.tan(0.5 * angle)
        turned = (nodes - centre) / (start - centre)
        off, place = np.abs(turned) - 1.0, ((np.angle(turned) + NEAR) % (2.0 * np.pi) - NEAR) / angle
    else:
        along = (nodes - start) / (end - start)
        off, place = along.imag, along.real
    on = np.flatnonzero((np.abs(off) < NEAR) & (np.abs(place - 0.5) < 0.5 + NEAR))
    return on[np.argsort(place[on], kind="stable")]
