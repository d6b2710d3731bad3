"""Meshes of triangles and tetrahedra from the content of mesh files."""

from pathlib import Path

import numpy as np
from skfem import Mesh, MeshTet, MeshTet2, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Ints, IntsPair
from kohonen_adapt.display import plural
from kohonen_adapt.io.content import (
    DIMENSION,
    LINE,
    OTHERS,
    TETRAHEDRON,
    TRIANGLE,
    Content,
    Rows,
    check_finite,
    check_flat,
    indices_in,
    rows_in,
    shape_of,
)
from kohonen_adapt.io.curved_sides import ORDERS, order_of_sides, with_curved_sides
from kohonen_adapt.io.groups import by_group, name_of
from kohonen_adapt.log import logger
from kohonen_adapt.mesh.cells import CELLS, centroids_of
from kohonen_adapt.mesh.curved import corners_of, is_second_order
from kohonen_adapt.mesh.host import is_own_name, keys_of, number_facets, of_kind, set_boundaries
from kohonen_adapt.mesh.measures import area, directed, is_in_front, signed_area

__all__ = ["of_positive_volume", "to_mesh"]


Sets = dict[str, Ints]

FOUR_NODES, TEN_NODES = 4, 11  # Gmsh's numbers for tetrahedra
MEASURES = {2: ("area", "surface", "sides"), 3: ("volume", "volume", "edges")}
"""Dimension to the words for the measure, for a group of elements and for what may be curved."""


def to_mesh(content: Content, path: Path, scale: float) -> MeshTri | MeshTet:
    """Return the elements of a file, with groups as subdomains and boundaries.

    The mesh is of second order if a triangle of order 2 to 5 or a tetrahedron of order 2 has a curved side.

    Raises
    ------
    ValueError
        If the file, `path`, holds neither triangles in the xy-plane nor tetrahedra of four or of ten nodes, or if
        triangles are not faces of the tetrahedra.
    """
    dim = content.dimension
    shape = (TRIANGLE, TETRAHEDRON)[dim - 2]
    (_check_plane if dim == 2 else _check_solid)(content, path)
    rows = content.of_shape(shape)
    elements, element = _unique_elements(rows)
    used, t = np.unique(elements, return_inverse=True)
    if dim == 2:
        check_flat(content.points[used], path)
    check_finite(content.points[used], path, "read_mesh", "node")
    p = np.ascontiguousarray(scale * content.points[used, :dim].T)
    t = np.ascontiguousarray(t.reshape(elements.shape).T)
    subdomains = _items_by_name(rows.group, element, shape, content)
    mesh = of_positive_volume((MeshTri, MeshTet)[dim - 2](p, t, None, subdomains))
    set_boundaries(mesh, _boundaries(mesh, used, content, path))
    if order_of_sides(content, shape):
        mesh = with_curved_sides(mesh, content, used, path, scale)
    elif dim == 2 and content.rows.keys() & ORDERS.keys():
        logger.warning("'%s' has triangles of several orders: all sides are read as straight.", path)
    _report(mesh, content, path, shape)
    return mesh


def of_positive_volume(mesh: Mesh) -> Mesh:
    if len(mesh.p) == 2 or not np.any(signed_area(mesh) < 0.0):
        return mesh
    turned = corners_of(mesh).oriented()
    return of_kind(MeshTet2, mesh.p, turned) if is_second_order(mesh) else turned


def _check_plane(content: Content, path: Path) -> None:
    counts, found = _element_counts(content)
    if "quadrilateral" in counts:
        raise ValueError(
            f"read_mesh expected triangles only; '{path}' has {found}. "
            "Mesh without recombination, or split them with skfem.MeshQuad.to_meshtri()."
        )
    if not counts.get(TRIANGLE):
        raise ValueError(
            f"read_mesh expected triangles; '{path}' has {found}. "
            "Mesh in two dimensions (gmsh -2) and give the surfaces a physical group: Gmsh saves only elements in "
            "groups."
        )


def _check_solid(content: Content, path: Path) -> None:
    counts, found = _element_counts(content)
    if counts.keys() & OTHERS.keys():
        raise ValueError(
            f"read_mesh expected tetrahedra and triangles only; '{path}' has {found}. Mesh without recombination and "
            "extruded layers, or split hexahedra with skfem.MeshHex.to_meshtet()."
        )
    if {kind for kind in content.rows if shape_of(kind) == TETRAHEDRON} not in ({FOUR_NODES}, {TEN_NODES}):
        raise ValueError(
            f"read_mesh expected tetrahedra of four nodes, or of ten; '{path}' has some of another order. Mesh with "
            "Mesh.ElementOrder = 1 or 2: gmsh -3 -order 2."
        )


def _element_counts(content: Content) -> tuple[dict[str, int], str]:
    counts: dict[str, int] = {}
    for kind, rows in content.rows.items():
        counts[shape_of(kind)] = counts.get(shape_of(kind), 0) + len(rows.number)
    return counts, ", ".join(f"{number} {shape} elements" for shape, number in sorted(counts.items())) or "no elements"


def _unique_elements(rows: Rows) -> IntsPair:
    # Elements have the order of their numbers in the file. MSH 2.2 lists an element of two groups twice, under two
    # numbers.
    order = np.argsort(rows.number, kind="stable")
    key = keys_of(np.sort(rows.nodes[order], axis=1).T, 1 + int(rows.nodes.max(initial=0)))
    _, first, same = np.unique(key, return_index=True, return_inverse=True)
    leader, element = np.sort(first), np.empty_like(order)
    element[order] = np.searchsorted(leader, first)[same]
    return rows.nodes[order[leader]], element


def _items_by_name(group: Ints, item: Ints, shape: str, content: Content) -> Sets | None:
    """Return the items by group name, where `item[k]` is in group `group[k]`."""
    named = [tag for dimension, tag in content.names if dimension == DIMENSION[shape]]
    members = by_group(group, item)
    sets: Sets = {}
    for tag in sorted({*members, *named}):
        name, items = name_of(content, DIMENSION[shape], tag), members.get(tag, np.empty(0, int))
        if is_own_name(name):
            sets[name] = np.union1d(sets.get(name, ()), items).astype(np.int32)
    for name, items in sets.items():
        if len(items) == 0:
            what = shape if DIMENSION[shape] == content.dimension else "facet"
            logger.warning("group '%s' has no %s in the mesh.", name, what)
    return sets or None


def _boundaries(mesh: MeshTri | MeshTet, used: Ints, content: Content, path: Path) -> Sets | None:
    """Return boundaries as scikit-fem stores them.

    A boundary is an `OrientedBoundary` if some of its facets are inside the mesh, and if the file gives them a
    direction.
    """
    shape = (LINE, TRIANGLE)[content.dimension - 2]
    rows = content.of_shape(shape)
    if len(rows.number) == 0 and not content.names:
        return None
    number_facets(mesh)
    node = indices_in(used, rows.nodes)
    facet = np.where(np.all(node >= 0, axis=1), rows_in(mesh.facets.T, node), -1)
    found = facet >= 0
    others = rows.nodes[~found]
    if len(others) and content.dimension == 2:
        logger.warning("%d lines of '%s' are not sides of triangles and are left out.", len(others), path)
    elif len(others):
        place = tuple(content.points[others[0]].mean(axis=0).tolist())
        raise ValueError(
            f"read_mesh expected triangles that are faces of tetrahedra; {len(others)} of '{path}' are not, one "
            f"near {place}. Put the volumes beside them into a physical group, mesh surfaces inside a volume with it "
            "(Gmsh: BooleanFragments), or leave them out."
        )
    node, facet = node[found], facet[found]
    second = ~is_in_front(mesh.p[:, node.T], centroids_of(mesh, mesh.f2t[0, facet])) & (mesh.f2t[1, facet] >= 0)
    made: Sets = {}
    for name, codes in (_items_by_name(rows.group[found], 2 * facet + second, shape, content) or {}).items():
        facets, first = np.unique(codes // 2, return_index=True)
        side, made[name] = codes[first] % 2, facets.astype(np.int32)
        if np.any(mesh.f2t[1, facets] >= 0) and _have_direction(directed(mesh, facets, side)):
            made[name] = OrientedBoundary(made[name], side)
    return made or None


def _have_direction(facets: Ints) -> bool:
    """Return True if most neighbouring facets (m, d) have the same direction.

    Half of them have if a program writes facets without direction. Lines join head to tail, and triangles traverse a
    common edge in opposite directions.
    """
    if facets.shape[1] == 2:
        joint, sign = facets.T.ravel(), np.repeat([1.0, -1.0], len(facets))
    else:
        edges = np.vstack([facets[:, edge] for edge in map(list, CELLS[2].outward)]).T
        joint = np.unique(keys_of(np.sort(edges, axis=0), 1 + int(edges.max(initial=0))), return_inverse=True)[1]
        sign = np.where(edges[0] < edges[1], 1.0, -1.0)
    of_two = np.bincount(joint) == 2
    return bool(np.sum(np.bincount(joint, sign)[of_two] != 0.0) <= np.sum(of_two) / 4)


def _report(mesh: MeshTri | MeshTet, content: Content, path: Path, shape: str) -> None:
    measure, group, sides = MEASURES[content.dimension]
    elements = plural(shape)
    kind = f"{elements} with curved {sides}" if is_second_order(mesh) else elements
    nodes = [rows.nodes.ravel() for number, rows in content.rows.items() if shape_of(number) == shape]
    unused = len(content.points) - np.unique(np.concatenate(nodes)).size
    names = sorted(mesh.subdomains or ()), sorted(mesh.boundaries or ())
    text = "read '%s': %d nodes, %d %s, subdomains %s, boundaries %s; %d unused nodes dropped."
    logger.info(text, path, mesh.nvertices, mesh.nelements, kind, *names, unused)
    lines = sorted({name for (dimension, _), name in content.names.items() if dimension == 1})
    if lines and content.dimension == 3:
        logger.warning("groups of lines of '%s' are left out of a mesh of tetrahedra: %s.", path, lines)
    if mesh.subdomains:
        bare = np.ones(mesh.nelements, bool)
        bare[np.concatenate(list(mesh.subdomains.values()))] = False
        if bare.any():
            share = 100.0 * area(mesh)[bare].sum() / area(mesh).sum()
            logger.warning("%.3g %% of the %s of '%s' is in no %s group: give it one.", share, measure, path, group)
    if content.missing:
        logger.warning(
            "'%s' has no %s for %s %s of its geometry: the mesh has holes there. "
            "Put every %s into a physical group: if there are groups, Gmsh saves only the elements in groups.",
            *(path, elements, group, ", ".join(map(str, content.missing)), group),
        )
