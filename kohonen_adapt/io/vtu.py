"""Write VTU files for ParaView, with names as scikit-fem stores them, and read them back."""

from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

import meshio
import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.io.content import EXACT, Content, Field, Rows, Sampled
from kohonen_adapt.io.vtu_reader import read_grid
from kohonen_adapt.mesh.names import combinations

__all__ = ["read_arrays", "read_vtu", "write_vtu"]

Sets = dict[str, Ints]
Fields = dict[str, Floats]

REGION = "region"
SUBDOMAIN, BOUNDARY = "skfem:s:", "skfem:b:"
LINE, TRIANGLE = 1, 2
VTK_TRIANGLE = 5
GMSH_TYPES = {1: 15, 3: LINE, 21: 8, VTK_TRIANGLE: TRIANGLE, 22: 9}
"""VTK's number of a type to Gmsh's."""

SOLID = (10, 11, 12, 13, 14, 15, 16, 24, 25, 26, 27, 28, 29, 31, 32, 33, 42, 71, 72, 73, 74)
QUADRILATERAL, TETRAHEDRON = 3, 4
"""Gmsh's types that stand for all that is refused anyhow."""

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
    names |= {SUBDOMAIN + name: np.bincount(items, minlength=mesh.t.shape[1]) for name, items in subdomains.items()}
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
    """Read a VTU file with the names that `write_vtu` or scikit-fem put there; damage is a ValueError."""
    grid = read_grid(path, "read_mesh")
    rows = {GMSH_TYPES[kind]: _rows(*grid.cells(kind)) for kind in np.unique(grid.types).tolist() if kind in GMSH_TYPES}
    solid = np.isin(grid.types, SOLID)
    for number, refused in ((TETRAHEDRON, solid), (QUADRILATERAL, ~solid & ~np.isin(grid.types, list(GMSH_TYPES)))):
        if refused.any():
            which = np.flatnonzero(refused)
            rows[number] = _rows(which, np.empty((len(which), 0), np.int64))
    names: dict[tuple[int, int], str] = {}
    if set(rows) == {TRIANGLE}:
        rows = _named_rows(rows[TRIANGLE].nodes, grid.cell_data, names, path)
    return Content(grid.points, rows, names)


def _rows(which: Ints, nodes: Ints) -> Rows:
    return Rows(nodes, np.zeros(len(which), np.int64), which)


def read_arrays(path: Path) -> Sampled:
    """Read the triangles of a VTU file and the fields on them; damage is a ValueError."""
    grid = read_grid(path, "read_field")
    which, triangles = grid.cells(VTK_TRIANGLE)
    nodal = [Field(name, True, values) for name, values in grid.point_data.items()]
    cellwise = [Field(name, False, values[which]) for name, values in grid.cell_data.items()]
    return Sampled(grid.points, triangles, [*nodal, *cellwise])


def _named_rows(
    triangles: Ints, data: dict[str, np.ndarray], names: dict[tuple[int, int], str], path: Path
) -> dict[int, Rows]:
    """Rows of all triangles, of those in each subdomain, and of the sides in each boundary; fills in `names`."""
    surfaces, sides = [np.arange(len(triangles))], [np.empty((0, 2), np.int64)]
    # The sides are numbered by the sorted corners.
    corners = np.sort(triangles, axis=1)
    for key, values in data.items():
        if key.startswith((SUBDOMAIN, BOUNDARY)) and not (values.ndim == 1 and np.all(np.abs(values) < EXACT)):
            raise ValueError(f"read_mesh expected whole numbers, one for each cell, in '{key}' of '{path}'.")
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


def _group(parts: Sequence[Ints]) -> Ints:
    return np.repeat(np.arange(len(parts)), [len(part) for part in parts])
