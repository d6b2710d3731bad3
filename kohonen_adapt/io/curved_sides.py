"""Curved sides of triangles of order 2 to 5, and of tetrahedra of order 2."""

import logging
from pathlib import Path

import numpy as np
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.polylines import polylines_of
from kohonen_adapt.geometry.plane.spline import Spline
from kohonen_adapt.io.content import (
    CORNERS,
    TETRAHEDRON,
    TRIANGLE,
    Content,
    check_finite,
    check_flat,
    rows_in,
    shape_of,
    union,
)
from kohonen_adapt.log import logger
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.cells import cell_of
from kohonen_adapt.mesh.curved import corners_of, numbered_sides, with_midsides
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.names import named_sets

__all__ = ["ORDERS", "order_of_sides", "to_curves", "with_curved_sides"]


ORDERS = {9: 2, 20: 3, 21: 3, 22: 4, 23: 4, 24: 5, 25: 5, 11: 2}
"""Gmsh's numbers for triangles and tetrahedra to their order p; p - 1 nodes of each of `SIDES` follow the corners."""

SIDES = {TRIANGLE: [(0, 1), (1, 2), (2, 0)], TETRAHEDRON: [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]}

MIDDLE = {
    2: np.array([0.0, 1.0, 0.0]),
    3: np.array([-1.0, 9.0, 9.0, -1.0]) / 16.0,
    4: np.array([0.0, 0.0, 1.0, 0.0, 0.0]),
    5: np.array([3.0, -25.0, 150.0, 150.0, -25.0, 3.0]) / 256.0,
}
"""Order of a side to the weights of its nodes in the middle of its polynomial."""
SAME = 1e-12
"""Tolerance for equal node positions, relative to the size of the mesh."""

STRAIGHT = 1e-9
"""Tolerance for the midside node of a straight facet, relative to the length of the facet."""

LOST = 1e-6
"""Distance of the nodes of sides from the curves read above which a warning is given, relative to the side."""

DIGITS = 1e-14
"""Rounding error of positions, relative to the largest coordinate."""


def with_curved_sides(mesh: Mesh, content: Content, used: Ints, path: Path, scale: float) -> Mesh:
    shape = cell_of(mesh).name
    segments = _side_nodes(content, shape, used[numbered_sides(mesh)[0].T], path)
    points = content.points[np.unique(segments)]
    if shape == TRIANGLE:
        check_flat(points, path, "midside node")
    check_finite(points, path, "read_mesh", "midside node")
    position = scale * content.points[:, : len(mesh.p)].T
    if not _is_curved(segments, position).any():
        return mesh
    order = segments.shape[1] - 1
    curved = with_midsides(mesh, np.ascontiguousarray(position[:, segments] @ MIDDLE[order]))
    if order > 2:
        size, at = np.hypot(*np.diff(curved.p[:, curved.facets], axis=1)[:, 0]), np.arange(1, order) / order
        x, tangents = Blended(curved).facet_points(np.arange(size.size), np.stack((1.0 - at, at)))
        tangent, (across, up) = tangents[:, 0], position[:, segments[:, 1:-1]] - x
        off = np.max(np.abs(tangent[0] * up - tangent[1] * across) / np.hypot(*tangent), axis=1) / size
        worst = int(np.argmax(off))
        logger.log(
            logging.WARNING if off[worst] > LOST else logging.INFO,
            "sides of order %d of '%s' become arcs or parabolas through their ends and middles, and the nodes inside "
            "triangles are left out: a node of a side is off by %.2g of its length, near (%.6g, %.6g).",
            *(order, path, off[worst], *x[:, worst].mean(axis=1)),
        )
    return curved


def to_curves(content: Content, mesh: MeshTri, path: Path, scale: float) -> dict[str, Spline]:
    """Return a spline for every named boundary that is curved in the file.

    Raises
    ------
    ValueError
        If the file, `path`, does not hold triangles of one order from 2 to 5, or `mesh` has other nodes than the file.
    """
    if not order_of_sides(content):
        found = "other elements, too" if content.rows.keys() & ORDERS.keys() else "none"
        raise ValueError(
            f"read_curves expected triangles of one order from 2 to 5, for the nodes of sides; '{path}' has {found}. "
            "Mesh with Mesh.ElementOrder = 2, or use the nodes of the mesh: Spline.through(mesh, name)."
        )
    mesh = corners_of(mesh)
    used = np.unique(content.of_shape(TRIANGLE).nodes)
    own = scale * content.points[used, :2].T
    if mesh.p.shape != own.shape:
        raise _of_another_mesh(path, f", with {own.shape[1]} nodes; got one with {mesh.p.shape[1]}")
    off, size = np.max(np.abs(mesh.p - own)), np.ptp(own, axis=1).max()
    if off > SAME * size + DIGITS * np.abs(own).max():
        raise _of_another_mesh(path, f" at this scale; a node is off by {off / size:.3g} times the size of the mesh")
    named = {name: np.unique(rows) for name, rows in named_sets(mesh.boundaries).items()}
    facets = union(named.values())
    segments = _side_nodes(content, TRIANGLE, used[mesh.facets[:, facets].T], path)
    position = scale * content.points[:, :2].T
    check_finite(position[:, np.unique(segments)].T, path, "read_curves", "midside node")
    curved = _is_curved(segments, position)
    curves = {}
    for name, members in named.items():
        which = np.searchsorted(facets, members)
        if curved[which].any():
            polylines = polylines_of(segments[which], position)
            curves[name] = Spline.of_pieces([(position[:, line.nodes], line.closed) for line in polylines])
    logger.info("curved boundaries of '%s': %s.", path, curves or "none")
    return curves


def order_of_sides(content: Content, shape: str = TRIANGLE) -> int:
    # 0 for straight sides, and for elements of several orders
    kinds = [kind for kind in content.rows if shape_of(kind) == shape]
    return ORDERS.get(kinds[0], 0) if len(kinds) == 1 else 0


def _of_another_mesh(path: Path, why: str) -> ValueError:
    expected = f"read_curves expected the mesh that read_mesh('{path}') returns"
    return ValueError(f"{expected}{why}. Read the curves before the mesh is changed.")


def _side_nodes(content: Content, shape: str, ends: Ints, path: Path) -> Ints:
    # nodes (f, order + 1) from end to end of the sides `ends` (f, 2)
    order = order_of_sides(content, shape)
    elements = next(rows.nodes for kind, rows in content.rows.items() if shape_of(kind) == shape)
    inner = np.reshape(elements[:, CORNERS[shape] :][:, : len(SIDES[shape]) * (order - 1)], (-1, order - 1))
    corners = elements[:, SIDES[shape]].reshape(-1, 2)
    side = rows_in(ends, corners)
    found = side >= 0
    side, corners, inner = side[found], corners[found], inner[found]
    inner = np.where(ends[side, :1] == corners[:, :1], inner, inner[:, ::-1])
    between = np.full((len(ends), order - 1), -1)
    between[side] = inner
    if np.any(between < 0):
        count = np.sum(between[:, 0] < 0)
        raise _of_another_mesh(path, f"; {count} facets of its boundaries are not sides of triangles in the file")
    if shape == TETRAHEDRON and np.any(between[side] != inner):
        raise ValueError(f"tetrahedra of '{path}' have different nodes inside one edge; write the mesh again.")
    return np.column_stack([ends[:, 0], between, ends[:, 1]])


def _is_curved(segments: Ints, position: Floats) -> Mask:
    start, end = position[:, segments[:, 0]], position[:, segments[:, -1]]
    length = magnitude(end - start)
    along, offset = ((end - start) / length)[..., None], position[:, segments[:, 1:-1]] - start[..., None]
    distance = magnitude(offset - along * np.sum(along * offset, axis=0)).max(axis=1)
    return distance > STRAIGHT * length + DIGITS * np.abs(position[:, segments]).max(initial=0.0)
