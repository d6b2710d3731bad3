"""VTU files for ParaView, and checks of files that meshio would misread."""

import re
from functools import cache
from html import escape
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.display import divisions_of, lattice_points
from kohonen_adapt.io.content import in_space
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.curved import Isoparametric, nodes_of_elements
from kohonen_adapt.mesh.elements.functions import hierarchical, reference_functions
from kohonen_adapt.mesh.elements.rules import tetrahedron_rule, triangle_rule
from kohonen_adapt.mesh.measures import is_in_front
from kohonen_adapt.mesh.names import combinations

__all__ = ["BOUNDARY", "LAGRANGE", "SUBDOMAIN", "checked_vtu", "mean_weights", "sides_of", "write_vtu"]

Sets = dict[str, Ints]
Fields = dict[str, Floats]

REGION = "region"
SUBDOMAIN, BOUNDARY = "skfem:s:", "skfem:b:"
KINDS = {3: "triangle", 4: "tetra", 6: "triangle6", 10: "tetra10"}
"""Nodes per element to the type in meshio (VTK's types 5, 10 and 22)."""

LAGRANGE = ("VTK_LAGRANGE_TRIANGLE", "VTK_LAGRANGE_TETRAHEDRON")
"""Elements of any order with equispaced nodes (VTK's types 69 and 71) in meshio."""

PARTS: dict[int, tuple[tuple[int, ...], ...]] = {
    3: ((0, 1), (1, 2), (2, 0), (0, 1, 2)),
    4: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3), (0, 1, 3), (2, 3, 1), (0, 3, 2), (0, 2, 1), (0, 1, 2, 3)),
}
"""Number of corners to edges, faces and the inside in the order and direction of VTK."""

PARABOLAS = 3  # highest order whose elements have parabolas as sides; the others have arcs
RAW = re.compile(rb"encoding\s*=\s*[\"']raw")
PIECE = re.compile(rb"<Piece\b")
NEWER = re.compile(rb"(<VTKFile\b[^>]*\bversion\s*=\s*[\"'])2\.[0-9]+")


def write_vtu(
    path: Path,
    mesh: Mesh,
    subdomains: Sets,
    boundaries: Sets,
    point_data: Fields,
    cell_data: Fields,
    positions: Floats | None = None,
) -> None:
    """Write a mesh and fields for ParaView.

    The names are integer arrays per element: ``region`` is the index of the combination of subdomain names,
    ``skfem:s:<name>`` is 1 in a subdomain, and bit k of ``skfem:b:<name>`` is set if side k is in a boundary.

    If a field in `point_data` has values inside elements, as in `write_mesh`, the elements share no points.

    Raises
    ------
    ValueError
        If a field in `cell_data` has one of these names.
    """
    names: dict[str, Ints] = {REGION: combinations(list(subdomains.values()), mesh.nelements)[0]}
    names |= {SUBDOMAIN + name: np.bincount(items, minlength=mesh.nelements) for name, items in subdomains.items()}
    names |= {BOUNDARY + name: _mark_sides(mesh, items) for name, items in boundaries.items()}
    taken = names.keys() & cell_data.keys()
    if taken:
        raise ValueError(
            f"cell_data '{min(taken)}' has a name that write_mesh reserves for the mesh; choose another name."
        )
    # meshio does not escape names in the XML.
    vectors = {name: in_space(values.T) for name, values in cell_data.items() if values.ndim > 1}
    cells = {escape(name, quote=False): [values] for name, values in {**names, **cell_data, **vectors}.items()}
    dim, inside = len(mesh.p), [len(values) for values in point_data.values() if values.ndim == 2]
    order = max((divisions_of(count, dim) for count in inside), default=0)
    nodes, p = nodes_of_elements(mesh), mesh.p
    if order:
        count = mesh.nelements
        nodes = _vtk_rows(order, dim) * count + np.arange(count)[:, None]
        if positions is None:
            shape = Blended(mesh) if order > PARABOLAS and dim == 2 else Isoparametric(mesh)
            positions = shape.points_in_each(lattice_points(order, dim))
        p = positions
    kind = LAGRANGE[dim - 2] if order > 1 else KINDS[nodes.shape[1]]
    nodal = {
        escape(name, quote=False): _at_points(mesh, values, order) if order else values
        for name, values in point_data.items()
    }
    meshio.vtu.write(str(path), meshio.Mesh(in_space(p.T), [(kind, nodes)], point_data=nodal, cell_data=cells))


def _at_points(mesh: Mesh, values: Floats, order: int) -> Floats:
    if values.ndim == 2:
        return values.ravel()
    own, share = values[nodes_of_elements(mesh)].T, lattice_points(order, len(mesh.p))
    functions, _ = reference_functions(share.T, 1 if len(own) == len(share) else 2)
    return (functions.T @ own).ravel()


def _places(order: int, corners: int) -> list[tuple[int, ...]]:
    # nodes of VTK in steps towards each corner: corners, edges, faces, inside
    if corners == 2:
        return [(order - step, step) for step in range(order + 1)]
    if order == 0:
        return [(0,) * corners]
    found = [tuple(row) for row in (order * np.eye(corners, dtype=int)).tolist()]
    for part in PARTS[corners]:
        for steps in _places(order - len(part), len(part)) if order >= len(part) else ():
            inner = dict(zip(part, steps, strict=True))
            found.append(tuple(inner[corner] + 1 if corner in inner else 0 for corner in range(corners)))
    return found


@cache
def _vtk_rows(order: int, dim: int) -> Ints:
    steps = np.rint(order * lattice_points(order, dim).T).astype(int).tolist()
    row = {tuple(place): k for k, place in enumerate(steps)}
    return np.array([row[place] for place in _places(order, dim + 1)])


@cache
def mean_weights(nodes: int, dim: int) -> Floats:
    order = divisions_of(nodes, dim)
    if not order:
        raise ValueError(f"a Lagrange cell has {nodes} nodes, which is not the number of any order")
    barycentric, weight = (triangle_rule if dim == 2 else tetrahedron_rule)(order)
    at = lattice_points(order, dim)[:, _vtk_rows(order, dim)]
    values, moments = hierarchical(at.T, order)[0], hierarchical(barycentric, order)[0] @ weight
    return np.asarray(np.linalg.solve(values, moments))


def _mark_sides(mesh: Mesh, facets: Ints) -> Ints:
    """Return the bits of marked sides per element, shape (nelements,).

    A facet is marked in one element, the first or that in front of the facet.
    """
    element = mesh.f2t[getattr(facets, "ori", 0), facets]
    side = np.argmax(mesh.t2f[:, element] == facets, axis=0)
    bits = np.zeros(mesh.nelements, int)
    np.add.at(bits, element, 1 << side)
    return bits


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


def checked_vtu(data: bytes) -> bytes:
    """Return the bytes of a VTU file in a form that meshio reads.

    Version 2 of VTK differs from version 1 in polyhedra only, and meshio refuses it. meshio joins pieces without their
    common nodes.
    """
    if not RAW.search(data):  # raw data is not valid XML
        ElementTree.fromstring(data)  # meshio gives no reason for damaged XML
    pieces = len(PIECE.findall(data))
    if pieces > 1:
        raise ValueError(f"it has {pieces} pieces instead of one: merge them, in ParaView by Merge Blocks")
    return NEWER.sub(rb"\g<1>1.0", data, count=1)
