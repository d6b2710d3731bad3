"""VTU files for ParaView, with names as scikit-fem stores them."""

from pathlib import Path
from xml.sax.saxutils import escape

import meshio
import numpy as np
from skfem import MeshTri

from .combinations import combinations
from .content import Content, Floats, Ints, Rows
from .sampled import Field, Sampled

__all__ = ["read_arrays", "read_vtu", "write_vtu"]

Sets = dict[str, Ints]
Fields = dict[str, Floats]

REGION = "region"
SUBDOMAIN, BOUNDARY = "skfem:s:", "skfem:b:"
LINE, TRIANGLE = 1, 2
_GMSH_TYPES = {"vertex": 15, "line": LINE, "line3": 8, "triangle": TRIANGLE, "triangle6": 9}
SIDES = ([0, 1], [1, 2], [0, 2])
"""Corners of the sides of an element, numbered as in `MeshTri.t2f`."""


def write_vtu(
    path: Path, mesh: MeshTri, subdomains: Sets, boundaries: Sets, point_data: Fields, cell_data: Fields
) -> None:
    """Write a mesh for ParaView; arguments as `write_mesh` has checked them.

    Besides the fields there are integer arrays per element: ``region`` numbers the combinations of subdomain names,
    ``skfem:s:<name>`` is 1 in a subdomain, and in ``skfem:b:<name>`` bit k says that side k is in a boundary.

    Raises
    ------
    ValueError
        If a field of the caller has one of these names.
    """
    names: dict[str, Ints] = {REGION: combinations(list(subdomains.values()), mesh.t.shape[1])[0]}
    names |= {SUBDOMAIN + name: _mark(items, mesh.t.shape[1]) for name, items in subdomains.items()}
    names |= {BOUNDARY + name: _mark_sides(mesh, items) for name, items in boundaries.items()}
    taken = names.keys() & cell_data.keys()
    if taken:
        raise ValueError(f"cell_data '{min(taken)}' has a name that write_mesh needs for the mesh; choose another.")
    # meshio writes names into the XML as they are.
    cells = {escape(name): [_components(values)] for name, values in (names | cell_data).items()}
    nodal = {escape(name): values for name, values in point_data.items()}
    points = np.column_stack([mesh.p.T, np.zeros(mesh.p.shape[1])])
    content = meshio.Mesh(points, [("triangle", mesh.t.T)], point_data=nodal, cell_data=cells)
    meshio.vtu.write(str(path), content)


def _mark(items: Ints, count: int) -> Ints:
    mark = np.zeros(count, dtype=np.int64)
    mark[items] = 1
    return mark


def _mark_sides(mesh: MeshTri, facets: Ints) -> Ints:
    """Bits of the sides of every element; a facet is marked in its first element only."""
    side = np.argmax(mesh.t2f[:, mesh.f2t[0, facets]] == facets, axis=0)
    bits = np.zeros(mesh.t.shape[1], dtype=np.int64)
    np.add.at(bits, mesh.f2t[0, facets], 1 << side)
    return bits


def _components(values: np.ndarray) -> np.ndarray:
    """Scalars as they are, vectors as rows of three, as ParaView wants them."""
    return values if values.ndim == 1 else np.column_stack([values.T, np.zeros(values.shape[1])])


def read_vtu(path: Path) -> Content:
    """What a VTU file holds, with the names that `write_vtu` or scikit-fem put there.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    ValueError
        If meshio cannot read it.
    """
    mesh = _load(path, "read_mesh")
    rows = {}
    for kind in {_gmsh_type(block) for block in mesh.cells}:
        nodes = np.concatenate([block.data for block in mesh.cells if _gmsh_type(block) == kind]).astype(np.int64)
        rows[kind] = Rows(nodes, np.zeros(len(nodes), np.int64), np.arange(len(nodes)))
    names: dict[tuple[int, int], str] = {}
    if set(rows) == {TRIANGLE}:
        data = {name: np.concatenate(parts) for name, parts in mesh.cell_data.items()}
        rows = _named_rows(rows[TRIANGLE].nodes, data, names)
    points = np.column_stack([mesh.points, np.zeros((len(mesh.points), 3 - mesh.points.shape[1]))])
    return Content(points.astype(float), rows, names)


def read_arrays(path: Path) -> Sampled:
    """The triangles of a VTU file and the fields on them.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    ValueError
        If meshio cannot read it.
    """
    mesh = _load(path, "read_field")
    which = [number for number, block in enumerate(mesh.cells) if block.type == "triangle"]
    triangles = np.concatenate([np.empty((0, 3), np.int64), *(mesh.cells[number].data for number in which)])
    nodal = [Field(name, True, np.asarray(values)) for name, values in mesh.point_data.items()]
    cellwise = [
        Field(name, False, np.concatenate([parts[number] for number in which]) if which else np.empty(0))
        for name, parts in mesh.cell_data.items()
    ]
    return Sampled(mesh.points, triangles, [*nodal, *cellwise])


def _load(path: Path, caller: str) -> meshio.Mesh:
    """What meshio makes of a VTU file; a ValueError of the caller's if it cannot."""
    try:
        return meshio.vtu.read(str(path))
    except Exception as error:  # meshio and the XML parser under it raise all kinds
        raise ValueError(f"{caller} expected a VTU file; meshio cannot read '{path}': {error}") from error


def _gmsh_type(block: meshio.CellBlock) -> int:
    """Gmsh's number for the type; all that is refused anyhow counts as a quadrilateral or a tetrahedron."""
    return _GMSH_TYPES.get(block.type, 4 if block.dim == 3 else 3)


def _named_rows(triangles: Ints, data: dict[str, np.ndarray], names: dict[tuple[int, int], str]) -> dict[int, Rows]:
    """Rows of all triangles, of those in each subdomain, and of the sides in each boundary; fills in `names`."""
    surfaces, sides = [np.arange(len(triangles))], [np.empty((0, 2), np.int64)]
    # The sides are numbered by the sorted corners.
    corners = np.sort(triangles, axis=1)
    for key, values in data.items():
        if key.startswith(SUBDOMAIN):
            names[2, len(surfaces)] = key.removeprefix(SUBDOMAIN)
            surfaces.append(np.flatnonzero(values))
        elif key.startswith(BOUNDARY):
            names[1, len(sides)] = key.removeprefix(BOUNDARY)
            bits = values.astype(np.int64)
            sides.append(np.concatenate([corners[:, side][(bits >> bit) & 1 == 1] for bit, side in enumerate(SIDES)]))
    element, lines = np.concatenate(surfaces), np.concatenate(sides)
    return {
        TRIANGLE: Rows(triangles[element], _group(surfaces), element),
        LINE: Rows(lines, _group(sides), np.arange(len(lines))),
    }


def _group(parts: list[Ints]) -> Ints:
    return np.repeat(np.arange(len(parts)), [len(part) for part in parts])
