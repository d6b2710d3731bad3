"""Write VTU files for ParaView, with names as scikit-fem stores them, and read such names."""

from pathlib import Path
from xml.sax.saxutils import escape

import meshio
import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.curved import nodes_of_elements
from kohonen_adapt.mesh.measures import is_left
from kohonen_adapt.mesh.names import combinations

__all__ = ["BOUNDARY", "SUBDOMAIN", "sides_of", "write_vtu"]

Sets = dict[str, Ints]
Fields = dict[str, Floats]

REGION = "region"
SUBDOMAIN, BOUNDARY = "skfem:s:", "skfem:b:"
CELLS = {3: "triangle", 6: "triangle6"}
"""Nodes of an element to what meshio calls it: VTK's types 5 and 22."""

SIDES = ([0, 1], [1, 2], [2, 0])
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
    nodes = nodes_of_elements(mesh)
    content = meshio.Mesh(points, [(CELLS[nodes.shape[1]], nodes)], point_data=nodal, cell_data=cells)
    meshio.vtu.write(str(path), content)


def _mark_sides(mesh: MeshTri, facets: Ints) -> Ints:
    """Bits of the sides of every element; a facet is marked in its first element only, or in the one in front of it."""
    element = mesh.f2t[getattr(facets, "ori", 0), facets]
    side = np.argmax(mesh.t2f[:, element] == facets, axis=0)
    bits = np.zeros(mesh.t.shape[1], dtype=np.int64)
    np.add.at(bits, element, 1 << side)
    return bits


def _components(values: np.ndarray) -> np.ndarray:
    """Scalars as they are, vectors as rows of three, as ParaView wants them."""
    return values if values.ndim == 1 else np.column_stack([values.T, np.zeros(values.shape[1])])


def sides_of(triangles: Ints, bits: Ints, points: Floats) -> Ints:
    """The sides of triangles (n, 3) whose bit is set, (m, 2), each with its element on the left."""
    corners = np.sort(triangles, axis=1)  # scikit-fem numbers sides by them
    overturned = ~is_left(*(points[corners[:, k], :2].T for k in range(3)))
    sides = []
    for bit, side in enumerate(SIDES):
        marked = (bits >> bit) & 1 == 1
        sides.append(np.where(overturned[marked, None], corners[marked][:, side[::-1]], corners[marked][:, side]))
    return np.concatenate(sides)
