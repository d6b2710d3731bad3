"""VTU files for ParaView, with names as scikit-fem stores them."""

from html import escape
from pathlib import Path

import meshio
import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.curved import nodes_of_elements
from kohonen_adapt.mesh.measures import is_in_front
from kohonen_adapt.mesh.names import combinations

__all__ = ["BOUNDARY", "SUBDOMAIN", "sides_of", "write_vtu"]

Sets = dict[str, Ints]
Fields = dict[str, Floats]

REGION = "region"
SUBDOMAIN, BOUNDARY = "skfem:s:", "skfem:b:"
KINDS = {3: "triangle", 4: "tetra", 6: "triangle6"}
"""Nodes per element to the type in meshio (VTK's types 5, 10 and 22)."""


def write_vtu(
    path: Path, mesh: Mesh, subdomains: Sets, boundaries: Sets, point_data: Fields, cell_data: Fields
) -> None:
    """Write a mesh and fields for ParaView.

    The names are integer arrays per element: ``region`` is the index of the combination of subdomain names,
    ``skfem:s:<name>`` is 1 in a subdomain, and bit k of ``skfem:b:<name>`` is set if side k is in a boundary.

    Raises
    ------
    ValueError
        If a field in `cell_data` has one of these names.
    """
    names: dict[str, Ints] = {REGION: combinations(list(subdomains.values()), mesh.t.shape[1])[0]}
    names |= {SUBDOMAIN + name: np.bincount(items, minlength=mesh.t.shape[1]) for name, items in subdomains.items()}
    names |= {BOUNDARY + name: _mark_sides(mesh, items) for name, items in boundaries.items()}
    taken = names.keys() & cell_data.keys()
    if taken:
        raise ValueError(
            f"cell_data '{min(taken)}' has a name that write_mesh reserves for the mesh; choose another name."
        )
    # meshio does not escape names in the XML.
    cells = {escape(name, quote=False): [_components(values)] for name, values in (names | cell_data).items()}
    nodal = {escape(name, quote=False): values for name, values in point_data.items()}
    points = np.column_stack([mesh.p.T, np.zeros((mesh.p.shape[1], 3 - len(mesh.p)))])
    nodes = nodes_of_elements(mesh)
    content = meshio.Mesh(points, [(KINDS[nodes.shape[1]], nodes)], point_data=nodal, cell_data=cells)
    meshio.vtu.write(str(path), content)


def _mark_sides(mesh: Mesh, facets: Ints) -> Ints:
    """Return the bits of marked sides per element, shape (nelements,).

    A facet is marked in one element, the first or that in front of the facet.
    """
    element = mesh.f2t[getattr(facets, "ori", 0), facets]
    side = np.argmax(mesh.t2f[:, element] == facets, axis=0)
    bits = np.zeros(mesh.t.shape[1], dtype=np.int64)
    np.add.at(bits, element, 1 << side)
    return bits


def _components(values: np.ndarray) -> np.ndarray:
    return values if values.ndim == 1 else np.column_stack([values.T, np.zeros((values.shape[1], 3 - len(values)))])


def sides_of(elements: Ints, bits: Ints, points: Floats) -> Ints:
    """Return the sides of elements (n, d + 1) whose bit is set, shape (m, d).

    The corners are ordered so that the element is in front.
    """
    d = elements.shape[1] - 1
    corners = np.sort(elements, axis=1) if d == 2 else elements  # as scikit-fem numbers the sides
    sides = []
    for bit, side in enumerate(CELLS[d].facets):
        marked = (bits >> bit) & 1 == 1
        own = corners[marked][:, list(side)]
        right = is_in_front(points[own, :d].T, points[corners[marked], :d].mean(axis=1).T)
        sides.append(np.where(right[:, None], own, own[:, [1, 0, *range(2, d)]]))
    return np.concatenate(sides)
