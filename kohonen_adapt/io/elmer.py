"""Mesh folders of Elmer.

An element of Elmer is in one body and a facet in one boundary, so overlapping groups cannot be written.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.files import whole_files
from kohonen_adapt.io.content import (
    GMSH_TETRAHEDRON,
    Content,
    Rows,
    as_value_error,
    in_space,
    nodes_per_element,
    parse_numbers,
    placed,
    rows_by_type,
)
from kohonen_adapt.io.groups import GroupNumbers, Groups, numbers_for
from kohonen_adapt.mesh.measures import directed

__all__ = ["HEADER", "read_elmer", "write_elmer"]

Sets = Mapping[str, Ints]

HEADER = "mesh.header"
"""File that identifies a folder as a mesh of Elmer."""

KINDS = {"101": 15, "202": 1, "203": 8, "303": 2, "306": 9, "504": 4, "510": 11}
"""Elmer's number of a type (a digit for the shape, and the number of nodes) to Gmsh's."""

SHAPES = {"4": 3, "6": 7, "7": 6, "8": 5}
"""First digit of refused types (quadrilaterals, pyramids, prisms, hexahedra) to Gmsh's number."""

WRITTEN_AS = {2: (303, 202), 3: (504, 303)}
"""Dimension to Elmer's numbers of the types of elements and facets."""

NAME = re.compile(r"\$\s*(\S.*?)\s*=\s*([0-9]+)\s*")


def read_elmer(folder: Path) -> Content:
    with as_value_error(folder, f"read_mesh expected a mesh of Elmer; '{folder}' cannot be read: {{}}."):
        nodes = parse_numbers(_text(folder, "mesh.nodes")).reshape(-1, 5)
        nodes = nodes[np.argsort(nodes[:, 0], kind="stable")]
        blocks = [*_blocks(_text(folder, "mesh.elements"), 1), *_blocks(_text(folder, "mesh.boundary"), 3)]
        rows = rows_by_type((kind, placed(own, nodes[:, 0])) for kind, own in blocks)
        content = Content(nodes[:, 2:], rows, {}, numbers=nodes[:, 0].astype(int))
        dimension = content.dimension
        for line in _text(folder, "mesh.names").splitlines() if (folder / "mesh.names").exists() else []:
            if line.startswith("!"):
                dimension = content.dimension - ("boundaries" in line)
            elif found := NAME.fullmatch(line):
                content.names[dimension, int(found[2])] = found[1]
        return content


def _text(folder: Path, name: str) -> str:
    if not (folder / name).is_file():
        raise ValueError(f"it has no file {name}")
    return (folder / name).read_text("utf-8", "replace")


def _blocks(text: str, before: int) -> Iterator[tuple[int, Rows]]:
    # A line has the number, the body or boundary, `before` - 1 further words, the type and the nodes.
    lines = [words for line in text.splitlines() if (words := line.split())]
    for kind in sorted({words[1 + before] for words in lines}):
        number = KINDS.get(kind) or SHAPES.get(kind[0])
        if number is None:
            raise ValueError(f"element type {kind} is unknown")
        table = np.array([words for words in lines if words[1 + before] == kind], int)
        nodes = table[:, 2 + before :][:, : nodes_per_element(number)]
        yield number, Rows(nodes[:, GMSH_TETRAHEDRON] if kind == "510" else nodes, table[:, 1], table[:, 0])


def write_elmer(folder: Path, mesh: Mesh, subdomains: Sets, boundaries: Sets, groups: Groups) -> None:
    d, (kind, of_facet) = len(mesh.p), WRITTEN_AS[len(mesh.p)]
    numbers = numbers_for({d: subdomains, d - 1: boundaries}, groups)
    body = _numbered(subdomains, d, mesh.nelements, numbers)
    boundary = _numbered(boundaries, d - 1, mesh.nfacets, numbers)
    facets = np.flatnonzero(boundary)
    side = np.zeros(mesh.nfacets, int)
    for items in boundaries.values():
        side[np.asarray(items)] = getattr(items, "ori", 0)
    elements = [1 + np.arange(len(body)), body, np.full(len(body), kind), *(1 + mesh.t)]
    corners, types = 1 + directed(mesh, facets, side[facets]).T, np.full(len(facets), of_facet)
    sides = [1 + np.arange(len(facets)), boundary[facets], *(1 + mesh.f2t[:, facets]), types, *corners]
    counts = f"{mesh.p.shape[1]} {len(body)} {len(facets)}\n2\n{of_facet} {len(facets)}\n{kind} {len(body)}\n"
    places = in_space(mesh.p.T).tolist()
    folder.mkdir(exist_ok=True)
    with whole_files(folder) as draft:
        rows = [f"{number} -1 {x!r} {y!r} {z!r}\n" for number, (x, y, z) in enumerate(places, 1)]
        names = [
            "! ----- names for bodies -----\n",
            *(f"$ {name} = {numbers[d, name]}\n" for name in subdomains),
            "! ----- names for boundaries -----\n",
            *(f"$ {name} = {numbers[d - 1, name]}\n" for name in boundaries),
        ]
        for name, texts in ((HEADER, [counts]), ("mesh.nodes", rows), ("mesh.names", names)):
            (draft / name).write_text("".join(texts), "utf-8")
        for name, columns in (("mesh.elements", elements), ("mesh.boundary", sides)):
            np.savetxt(draft / name, np.column_stack(columns), "%d")


def _numbered(sets: Sets, dimension: int, count: int, numbers: GroupNumbers) -> Ints:
    number = np.zeros(count, int)
    for name, items in sets.items():
        taken = number[np.asarray(items)].max(initial=0)
        if taken:
            other = next(other for other in sets if numbers[dimension, other] == taken)
            raise ValueError(f"groups must not overlap in Elmer; '{other}' and '{name}' do. Leave one of them out.")
        number[np.asarray(items)] = numbers[dimension, name]
    return number
