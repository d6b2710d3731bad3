"""Element blocks, node sets and surfaces of Abaqus and CalculiX."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from kohonen_adapt.arrays import Array, Ints
from kohonen_adapt.io.content import indices_in
from kohonen_adapt.mesh.host import keys_of
from kohonen_adapt.mesh.names import combinations

__all__ = ["add_names"]

COMMENT = re.compile(r"(?m)^\*\*.*\n?")
SECTION = re.compile(r"(?m)^[ \t]*\*([A-Za-z][A-Za-z ]*)(.*)\n?((?:(?![ \t]*\*).*\n?)*)")
PARAMETER = re.compile(r",[ \t]*([A-Za-z ]+?)[ \t]*=[ \t]*([^,\r\n]*)")

# Corners of the sides S1, S2, ... by the corners of an element; E1, E2, ... are sides of triangles, too.
SIDES: dict[int, list[tuple[int, ...]]] = {
    3: [(0, 1), (1, 2), (2, 0)],
    4: [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
}
CORNERS = {"triangle": 3, "triangle6": 3, "tetra": 4, "tetra10": 4}


def add_names(mesh: Any, text: str) -> list[str]:
    # Sets `side_sets`, the nodes (m, d) of sides by name, and returns the names of the sets without sides. A node set
    # means the sides of the outline, or between element sets, with all nodes in the set.
    sections = [
        (keyword.strip().upper(), {key.upper(): value.strip() for key, value in PARAMETER.findall(options)}, body)
        for keyword, options, body in SECTION.findall(COMMENT.sub("", text.replace("\r", "")))
    ]
    blocks = [(options.get("ELSET", ""), body) for keyword, options, body in sections if keyword == "ELEMENT"]
    for name in filter(None, (name for name, _ in blocks)):
        parts = zip(blocks, mesh.cells, strict=True)
        mesh.cell_sets[name] = [np.arange(len(block) if name == own else 0) for (own, _), block in parts]
    dimension = max((block.dim for block in mesh.cells), default=0)
    top = [(k, CORNERS.get(block.type, 0)) for k, block in enumerate(mesh.cells) if block.dim == dimension]
    if not all(size for _, size in top):
        mesh.side_sets = {}  # other elements are refused anyway
        return []
    corners = np.concatenate([np.asarray(mesh.cells[k].data, int)[:, :size] for k, size in top])
    numbers = np.concatenate([_numbers(blocks[k][1], mesh.cells[k].data.shape[1]) for k, _ in top])
    starts = np.cumsum([0, *(len(mesh.cells[k].data) for k, _ in top)])
    members = {
        name: np.unique(np.concatenate([start + parts[k] for start, (k, _) in zip(starts, top, strict=False)]))
        for name, parts in mesh.cell_sets.items()
        if len(parts) == len(mesh.cells)
    }
    elements = {name.upper(): numbers[rows] for name, rows in members.items()}
    found = _of_surfaces(sections, corners, numbers, elements)
    region = combinations(list(members.values()), len(corners))[0]
    found |= _of_nodes(mesh.point_sets, corners, region, len(mesh.points))
    mesh.side_sets = {name: sides for name, sides in found.items() if len(sides)}
    return [name for name, sides in found.items() if not len(sides)]


def _numbers(body: str, width: int) -> Ints:
    words = np.array([int(word) for word in re.split(r"[,\s]+", body) if word], int)
    return words.reshape(-1, 1 + width)[:, 0]


def _of_surfaces(
    sections: list[tuple[str, dict[str, str], str]], corners: Ints, numbers: Ints, elements: Mapping[str, Ints]
) -> dict[str, Ints]:
    sides = SIDES[corners.shape[1]]

    def of_line(line: str) -> Iterator[Ints]:
        which, face = (*(word.strip().upper() for word in line.split(",")), "", "")[:2]
        if face[:1] in ("S", "E") and face[1:].isdigit() and 0 < int(face[1:]) <= len(sides):
            wanted = np.array([int(which)]) if which.isdigit() else elements.get(which, np.empty(0, int))
            place = indices_in(numbers, wanted)
            yield corners[place[place >= 0]][:, sides[int(face[1:]) - 1]]

    none = np.empty((0, len(sides[0])), int)
    return {
        options.get("NAME", "surface"): np.concatenate(
            [none, *(part for line in body.split("\n") for part in of_line(line))]
        )
        for keyword, options, body in sections
        if keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "ELEMENT"
    }


def _of_nodes(sets: Mapping[str, Array], corners: Ints, region: Ints, count: int) -> dict[str, Ints]:
    sides = np.concatenate([corners[:, side] for side in SIDES[corners.shape[1]]])
    owner = np.tile(region, len(SIDES[corners.shape[1]]))
    key = keys_of(np.sort(sides, axis=1).T, count)
    _, first, place, times = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    differs = np.bincount(place, owner != owner[first][place]) > 0
    outline = sides[first[(times == 1) | differs]]
    found = {}
    for name, nodes in sets.items():
        inside = np.zeros(count, bool)
        inside[nodes] = True
        found[name] = outline[inside[outline].all(axis=1) & ~inside[corners].all()]
    return found
