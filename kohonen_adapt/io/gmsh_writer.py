"""Writer of Gmsh files, MSH 4.1 and 2.2 as text, with a physical group per name.

In MSH 4.1 an element lies on one entity, and an entity may be in several groups. Every combination of names is
therefore written as an entity in all these groups, and every point in a group as an entity. In MSH 2.2 an element is
listed once per group. meshio writes one group per element, and damages files that have an entity without nodes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TextIO

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Array, Floats, Ints, grouped
from kohonen_adapt.io.content import GMSH_TETRAHEDRON, union
from kohonen_adapt.io.groups import UNNAMED, GroupNumbers, Groups, numbers_for
from kohonen_adapt.mesh.curved import is_second_order, nodes_of_elements
from kohonen_adapt.mesh.host import edges_between
from kohonen_adapt.mesh.measures import directed
from kohonen_adapt.mesh.names import combinations

__all__ = ["write_msh"]

Sets = Mapping[str, Ints]
Fields = dict[str, Floats]

ELEMENT_TYPE = {(0, 1): 15, (1, 2): 1, (2, 3): 2, (3, 4): 4, (1, 3): 8, (2, 6): 9, (3, 10): 11}
"""(dimension, number of nodes) to Gmsh's number of the element type."""

CHUNK = 2**16
"""Lines formatted at once."""


@dataclass(frozen=True)
class Layer:
    """Elements of one dimension.

    Attributes
    ----------
    dimension
        0 for points, 1 for lines, 2 for triangles, 3 for tetrahedra.
    nodes
        (m, dimension + 1): corners, with midside nodes after them in Gmsh's order if sides are curved.
    number
        (m,): numbers of the elements in a file of version 4.1.
    entity
        (m,): index of the entity of each element.
    groups
        Tags of the groups of every entity.
    names
        Names of groups by tag, without groups that have no name in the file.
    """

    dimension: int
    nodes: Ints
    number: Ints
    entity: Ints
    groups: Sequence[Ints]
    names: dict[int, str]

    @property
    def kind(self) -> int:
        return ELEMENT_TYPE[self.dimension, self.nodes.shape[1]]


def write_msh(
    path: Path,
    mesh: Mesh,
    subdomains: Sets,
    boundaries: Sets,
    point_data: Fields,
    cell_data: Fields,
    *,
    version: str,
    groups: Groups,
) -> None:
    # Two boundaries with a facet in opposite directions have two elements on the facet.
    codes = {name: 2 * np.asarray(items) + getattr(items, "ori", 0) for name, items in boundaries.items()}
    facets = union(codes.values())
    sides = {name: np.searchsorted(facets, items) for name, items in codes.items()}
    nodes, d = groups.nodes(mesh), len(mesh.p)
    numbers = numbers_for({d: subdomains, d - 1: boundaries}, groups)
    corners = directed(mesh, *divmod(facets, 2))
    of_elements = nodes_of_elements(mesh)
    if of_elements.shape[1] == 10:
        of_elements = of_elements[:, GMSH_TETRAHEDRON]
    elements = _layer(d, of_elements, subdomains, numbers, UNNAMED[d][d], first=1)
    if is_second_order(mesh):
        midsides = facets // 2 if d == 2 else edges_between(mesh, corners, np.roll(corners, -1, axis=1))
        corners = np.column_stack([corners, mesh.nvertices + midsides])
    boundary = _layer(d - 1, corners, sides, numbers, UNNAMED[d][d - 1], first=1 + mesh.nelements)
    used = union(nodes.values())
    tags = [np.array([tag for tag, members in nodes.items() if node in members], int) for node in used]
    default = UNNAMED[d][0].format
    names = {tag: name for tag in nodes if (name := groups.names.get((0, tag), default(tag))) != default(tag)}
    number = 1 + mesh.nelements + len(facets) + np.arange(len(used))
    layers = [Layer(0, used[:, None], number, np.arange(len(used)), tags, names), boundary, elements]
    named = [f'{layer.dimension} {tag} "{name}"\n' for layer in layers for tag, name in layer.names.items()]
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n")
        if named:
            stream.write(f"$PhysicalNames\n{len(named)}\n{''.join(named)}$EndPhysicalNames\n")
        (_write_41 if version == "4.1" else _write_22)(stream, mesh.p, layers)
        for name, values in point_data.items():
            _write_field(stream, "NodeData", name, values)
        for name, values in cell_data.items():
            _write_field(stream, "ElementData", name, values)


def _layer(dimension: int, nodes: Ints, sets: Sets, numbers: GroupNumbers, unnamed: str, *, first: int) -> Layer:
    entity, members = combinations(list(sets.values()), len(nodes))
    tags = np.array([numbers[dimension, name] for name in sets], int)
    # Default names are not written, except for empty sets, which would otherwise be lost.
    names = {
        numbers[dimension, name]: name
        for name, items in sets.items()
        if len(items) == 0 or name != unnamed.format(numbers[dimension, name])
    }
    return Layer(dimension, nodes, first + np.arange(len(nodes)), entity, [tags[each] for each in members], names)


def _write_integers(stream: TextIO, table: Ints) -> None:
    _write_rows(stream, " ".join(["%d"] * table.shape[1]), table)


def _write_rows(stream: TextIO, row: str, table: Array) -> None:
    for start in range(0, len(table), CHUNK):  # %r restores floats exactly
        part = table[start : start + CHUNK]
        stream.write((row + "\n") * len(part) % tuple(part.ravel().tolist()))


def _write_41(stream: TextIO, p: Floats, layers: list[Layer]) -> None:
    counts = {layer.dimension: len(layer.groups) for layer in layers}
    stream.write(f"$Entities\n{' '.join(str(counts.get(dimension, 0)) for dimension in range(4))}\n")
    for layer in layers:
        for entity, which in _by_entity(layer.entity):
            corners, groups = p[:, layer.nodes[which]], layer.groups[entity]
            bounds = [corners.min(axis=(1, 2)), corners.max(axis=(1, 2))][: 1 + (layer.dimension > 0)]
            place = " ".join(_coordinates(p) % tuple(bound.tolist()) for bound in bounds)
            ends = " 0" * (layer.dimension > 0)
            stream.write(f"{entity + 1} {place} {' '.join(map(str, [len(groups), *groups]))}{ends}\n")
    start = np.cumsum([0, *(len(layer.groups) for layer in layers)])
    owner = np.empty(p.shape[1], int)
    for layer, shift in reversed(list(zip(layers, start, strict=False))):  # the lowest dimension is last, and prevails
        owner[layer.nodes] = shift + layer.entity[:, None]
    nodes = _by_entity(owner)
    stream.write(f"$EndEntities\n$Nodes\n{len(nodes)} {p.shape[1]} 1 {p.shape[1]}\n")
    for entity, which in nodes:
        rank = int(np.searchsorted(start, entity, side="right")) - 1
        stream.write(f"{layers[rank].dimension} {entity - start[rank] + 1} 0 {len(which)}\n")
        _write_rows(stream, "%d", which + 1)
        _write_rows(stream, _coordinates(p), p[:, which].T)
    parts = [(layer, tag, which) for layer in layers for tag, which in _by_entity(layer.entity)]
    total = sum(len(layer.number) for layer in layers)
    stream.write(f"$EndNodes\n$Elements\n{len(parts)} {total} 1 {total}\n")
    for layer, entity, which in parts:
        stream.write(f"{layer.dimension} {entity + 1} {layer.kind} {len(which)}\n")
        _write_integers(stream, np.column_stack([layer.number[which], layer.nodes[which] + 1]))
    stream.write("$EndElements\n")


def _by_entity(entity: Ints) -> list[tuple[int, Ints]]:
    return [(int(entity[which[0]]), which) for which in grouped(entity)]


def _coordinates(p: Floats) -> str:
    return " ".join(["%r"] * len(p) + ["0"] * (3 - len(p)))


def _write_22(stream: TextIO, p: Floats, layers: list[Layer]) -> None:
    stream.write(f"$Nodes\n{p.shape[1]}\n")
    _write_rows(stream, f"%d {_coordinates(p)}", np.column_stack([1 + np.arange(p.shape[1]), p.T]))
    most = max(1, *(len(groups) for layer in layers for groups in layer.groups))
    tables, listed = list[Ints](), 0
    for rank, layer in product(range(most), reversed(layers)):
        # The first rank has all elements; elements of further groups are listed again, with further numbers.
        group = np.array([groups[rank] if rank < len(groups) else 0 for groups in layer.groups], int)[layer.entity]
        which = np.flatnonzero((group > 0) | (rank == 0))
        number, head = listed + 1 + np.arange(len(which)), np.full((len(which), 2), [layer.kind, 2])
        tags = np.column_stack([number, head, group[which], layer.entity[which] + 1])
        tables.append(np.column_stack([tags, layer.nodes[which] + 1]))
        listed += len(which)
    stream.write(f"$EndNodes\n$Elements\n{listed}\n")
    for table in tables:
        _write_integers(stream, table)
    stream.write("$EndElements\n")


def _write_field(stream: TextIO, section: str, name: str, values: Floats) -> None:
    rows = np.atleast_2d(values)
    if len(rows) == 2:  # Gmsh requires three components
        rows = np.vstack([rows, np.zeros(rows.shape[1])])
    stream.write(f'${section}\n1\n"{name}"\n1\n0\n3\n0\n{len(rows)}\n{rows.shape[1]}\n')
    table = np.column_stack([1 + np.arange(rows.shape[1]), rows.T])
    _write_rows(stream, " ".join(["%d"] + ["%r"] * len(rows)), table)
    stream.write(f"$End{section}\n")
