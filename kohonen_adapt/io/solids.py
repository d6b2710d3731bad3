"""Tetrahedral meshes from the content of mesh files."""

import logging
from pathlib import Path

import numpy as np
from skfem import MeshTet, MeshTet2, MeshTri

from kohonen_adapt.arrays import Ints
from kohonen_adapt.io.assembly import element_counts, items_by_name, oriented, unique_elements
from kohonen_adapt.io.content import (
    TETRAHEDRON,
    TRIANGLE,
    Content,
    check_finite,
    indices_in,
    rows_in,
    shape_of,
)
from kohonen_adapt.io.curved_sides import DIGITS, STRAIGHT
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.curved import corners_of, is_second_order, with_midside_offsets
from kohonen_adapt.mesh.host import keys_of, number_edges, number_facets, of_kind, set_boundaries
from kohonen_adapt.mesh.measures import area, is_in_front, signed_area

__all__ = ["of_positive_volume", "to_solid"]

logger = logging.getLogger("kohonen_adapt")

Sets = dict[str, Ints]

FIRST_ORDER, SECOND_ORDER = 4, 11
"""Gmsh's numbers for tetrahedra of four and of ten nodes."""

EDGES = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)])
"""Corners beside the nodes 4 to 9 of tetrahedra of ten nodes."""


def to_solid(content: Content, path: Path, scale: float) -> MeshTet:
    """Return the tetrahedra of a file, with groups as subdomains and boundaries.

    Raises
    ------
    ValueError
        If the file, `path`, has other cells than tetrahedra of four or of ten nodes, or triangles that are not faces of
        these.
    """
    _check_shapes(content, path)
    rows = content.of_shape(TETRAHEDRON)
    tetrahedra, element = unique_elements(rows)
    is_used = np.zeros(len(content.points), dtype=bool)
    is_used[tetrahedra] = True
    used = np.flatnonzero(is_used)
    check_finite(content.points[used], path, "read_mesh", "node")
    p = np.ascontiguousarray(scale * content.points[used].T)
    t = np.ascontiguousarray((np.cumsum(is_used) - 1)[tetrahedra].T)
    mesh = of_positive_volume(MeshTet(p, t, None, items_by_name(rows.group, element, TETRAHEDRON, content)))
    set_boundaries(mesh, oriented(mesh, _boundaries(mesh, used, content, path), _has_orientation))
    if SECOND_ORDER in content.rows:
        mesh = _with_curved_edges(mesh, used, content, path, scale)
    _report(mesh, content, path)
    return mesh


def _with_curved_edges(mesh: MeshTet, used: Ints, content: Content, path: Path, scale: float) -> MeshTet:
    number_edges(mesh)
    nodes = content.rows[SECOND_ORDER].nodes
    edge = rows_in(mesh.edges.T, np.searchsorted(used, nodes[:, EDGES]).reshape(-1, 2))
    middle = np.empty(mesh.edges.shape[1], dtype=np.int64)
    middle[edge] = nodes[:, 4:].ravel()
    if np.any(middle[edge] != nodes[:, 4:].ravel()):
        raise ValueError(f"tetrahedra of '{path}' have different nodes inside one edge; write the mesh again.")
    check_finite(content.points[middle], path, "read_mesh", "midside node")
    offset = scale * content.points[middle].T - mesh.p[:, mesh.edges].mean(axis=1)
    length = np.linalg.norm(np.diff(mesh.p[:, mesh.edges], axis=1)[:, 0], axis=0)
    straight = np.linalg.norm(offset, axis=0) <= STRAIGHT * length + DIGITS * np.abs(mesh.p).max()
    if straight.all():
        return mesh
    curved = with_midside_offsets(mesh, offset)
    curved.p[:, mesh.nvertices :] = scale * content.points[middle].T
    return curved


def of_positive_volume(mesh: MeshTri | MeshTet) -> MeshTri | MeshTet:
    if len(mesh.p) == 2 or not np.any(signed_area(mesh) < 0.0):
        return mesh
    turned = corners_of(mesh).oriented()
    return of_kind(MeshTet2, mesh.p, turned) if is_second_order(mesh) else turned


def _check_shapes(content: Content, path: Path) -> None:
    counts, found = element_counts(content)
    others = counts.keys() & {"quadrilateral", "hexahedron", "prism", "pyramid"}
    if others:
        raise ValueError(
            f"read_mesh expected tetrahedra and triangles only; '{path}' has {found}. Mesh without recombination and "
            "extruded layers, or split hexahedra with skfem.MeshHex.to_meshtet()."
        )
    orders = {kind for kind in content.rows if shape_of(kind) == TETRAHEDRON}
    if orders not in ({FIRST_ORDER}, {SECOND_ORDER}):
        raise ValueError(
            f"read_mesh expected tetrahedra of four nodes, or of ten; '{path}' has some of another order. Mesh with "
            "Mesh.ElementOrder = 1 or 2: gmsh -3 -order 2."
        )


def _boundaries(mesh: MeshTet, used: Ints, content: Content, path: Path) -> Sets | None:
    # codes 2 * facet + side by name, side 1 with the second element in front
    rows = content.of_shape(TRIANGLE)
    if len(rows.number) == 0 and not content.names:
        return None
    number_facets(mesh)
    node = indices_in(used, rows.nodes)
    facet = np.where(np.all(node >= 0, axis=1), rows_in(mesh.facets.T, node), -1)
    if np.any(facet < 0):
        place = tuple(content.points[rows.nodes[facet < 0][0]].mean(axis=0).tolist())
        raise ValueError(
            f"read_mesh expected triangles that are faces of tetrahedra; {np.sum(facet < 0)} of '{path}' are not, one "
            f"near {place}. Put the volumes beside them into a physical group, mesh surfaces inside a volume with it "
            "(Gmsh: BooleanFragments), or leave them out."
        )
    centre = mesh.p[:, mesh.t[:, mesh.f2t[0, facet]]].mean(axis=1)
    second = ~is_in_front(mesh.p[:, node.T], centre) & (mesh.f2t[1, facet] >= 0)
    return items_by_name(rows.group, 2 * facet + second, TRIANGLE, content)


def _has_orientation(triangles: Ints) -> bool:
    """Return True if most neighbouring triangles (m, 3) have the same orientation.

    Half of them have if a program writes triangles without direction.
    """
    edges = np.vstack([triangles[:, edge] for edge in map(list, CELLS[2].outward)]).T
    up = np.where(edges[0] < edges[1], 1.0, -1.0)
    number = np.unique(keys_of(np.sort(edges, axis=0), 1 + int(edges.max(initial=0))), return_inverse=True)[1]
    joint = np.bincount(number) == 2
    return bool(np.sum(np.bincount(number, up)[joint] != 0.0) <= np.sum(joint) / 4)


def _report(mesh: MeshTet, content: Content, path: Path) -> None:
    sizes, kind = (
        (mesh.nvertices, mesh.t.shape[1]),
        "tetrahedra with curved edges" if is_second_order(mesh) else "tetrahedra",
    )
    used = [np.unique(rows.nodes).size for number, rows in content.rows.items() if shape_of(number) == TETRAHEDRON]
    unused = len(content.points) - sum(used)
    names = sorted(mesh.subdomains or ()), sorted(mesh.boundaries or ())
    text = "read '%s': %d nodes, %d %s, subdomains %s, boundaries %s; %d unused nodes dropped."
    logger.info(text, path, *sizes, kind, *names, unused)
    curves = sorted({name for (dimension, _), name in content.names.items() if dimension == 1})
    if curves:
        logger.warning("groups of lines of '%s' are left out of a mesh of tetrahedra: %s.", path, curves)
    if mesh.subdomains:
        bare = np.ones(mesh.t.shape[1], dtype=bool)
        bare[np.concatenate(list(mesh.subdomains.values()))] = False
        if bare.any():
            share = 100.0 * area(mesh)[bare].sum() / area(mesh).sum()
            logger.warning("%.3g %% of the volume of '%s' is in no volume group: give it one.", share, path)
    if content.missing:
        volumes = ", ".join(map(str, content.missing))
        logger.warning(
            "'%s' has no tetrahedra for volume %s of its geometry: the mesh has holes there. "
            "Put every volume into a physical group: if there are groups, Gmsh saves only the elements in groups.",
            *(path, volumes),
        )
