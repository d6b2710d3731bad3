"""Triangle meshes and curves from the content of mesh files."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
from skfem import MeshTet, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.polylines import polylines_of
from kohonen_adapt.geometry.plane.spline import Spline
from kohonen_adapt.io.content import (
    DIMENSION,
    LINE,
    TRIANGLE,
    Content,
    Rows,
    check_finite,
    indices_in,
    rows_in,
    shape_of,
)
from kohonen_adapt.io.groups import by_group, name_of
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.curved import corners_of, with_midsides
from kohonen_adapt.mesh.curved import is_second_order as has_bent_sides
from kohonen_adapt.mesh.host import is_own_name
from kohonen_adapt.mesh.measures import area, directed, is_in_front
from kohonen_adapt.mesh.names import named_sets

__all__ = ["element_counts", "items_by_name", "order_of_sides", "oriented", "to_curves", "to_mesh", "unique_elements"]

logger = logging.getLogger("kohonen_adapt")

Sets = dict[str, Ints]

ROTATE = {
    0: "The drawing is in the yz-plane; rotate it (Gmsh: Rotate {{0, 1, 0}, {0, 0, 0}, Pi/2} {Surface{:};}).",
    1: "The drawing is in the xz-plane; rotate it (Gmsh: Rotate {{1, 0, 0}, {0, 0, 0}, -Pi/2} {Surface{:};}).",
}
"""Index of the constant coordinate of a plane drawing to the remedy."""

FLAT = 1e-9
"""Tolerance for a plane z = constant, relative to the size of the mesh."""

ORDERS = {9: 2, 20: 3, 21: 3, 22: 4, 23: 4, 24: 5, 25: 5}
"""Gmsh's numbers for triangles to their order p; p - 1 nodes of each of `SIDES` follow the corners."""

SIDES = ([0, 1], [1, 2], [2, 0])
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


def to_mesh(content: Content, path: Path, scale: float) -> MeshTri:
    """Return the triangles of a file, with groups as subdomains and boundaries.

    The mesh is a `MeshTri2` if a triangle of order 2 to 5 has a curved side.

    Raises
    ------
    ValueError
        If the file, `path`, does not hold a mesh of triangles in the xy-plane.
    """
    _check_shapes(content, path)
    rows = content.of_shape(TRIANGLE)
    triangles, element = unique_elements(rows)
    is_used = np.zeros(len(content.points), dtype=bool)
    is_used[triangles] = True
    used = np.flatnonzero(is_used)
    _check_points(content.points[used], path)
    p = np.ascontiguousarray(scale * content.points[used, :2].T)
    bare = MeshTri(p, np.ascontiguousarray((np.cumsum(is_used) - 1)[triangles].T))
    subdomains = items_by_name(rows.group, element, TRIANGLE, content)
    boundaries = oriented(bare, _boundaries(bare, used, content, path), _has_direction)
    mesh = MeshTri(bare.p, bare.t, boundaries, subdomains)
    if order_of_sides(content):
        mesh = _with_curved_sides(mesh, content, used, path, scale)
    elif content.rows.keys() & ORDERS.keys():
        logger.warning("'%s' has triangles of several orders: all sides are read as straight.", path)
    _report(mesh, content, path)
    return mesh


def _with_curved_sides(mesh: MeshTri, content: Content, used: Ints, path: Path, scale: float) -> MeshTri:
    segments = _side_nodes(content, used[mesh.facets.T], path)
    _check_points(content.points[np.unique(segments)], path, "midside node")
    position = scale * content.points[:, :2].T
    if not _is_curved(segments, position).any():
        return mesh
    order = segments.shape[1] - 1
    curved = with_midsides(mesh, np.ascontiguousarray(position[:, segments] @ MIDDLE[order]))
    if order > 2:
        _report_loss(curved, position[:, segments[:, 1:-1]], path)
    return curved


def _report_loss(mesh: MeshTri, inner: Floats, path: Path) -> None:
    order, size = inner.shape[2] + 1, np.hypot(*np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0])
    x, tangent = Blended(mesh).facet_points(np.arange(size.size), np.arange(1, order) / order)
    across, up = inner - x
    off = np.abs(tangent[0] * up - tangent[1] * across).T / np.hypot(*tangent).T
    worst = int(np.argmax(off.max(axis=0) / size))
    logger.log(
        logging.WARNING if off[:, worst].max() > LOST * size[worst] else logging.INFO,
        "sides of order %d of '%s' become arcs or parabolas through their ends and middles, and the nodes inside "
        "triangles are left out: a node of a side is off by %.2g of its length, near (%.6g, %.6g).",
        *(order, path, off[:, worst].max() / size[worst], *x[:, worst].mean(axis=1)),
    )


def _check_shapes(content: Content, path: Path) -> None:
    counts, found = element_counts(content)
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


def element_counts(content: Content) -> tuple[dict[str, int], str]:
    counts: dict[str, int] = {}
    for kind, rows in content.rows.items():
        counts[shape_of(kind)] = counts.get(shape_of(kind), 0) + len(rows.number)
    return counts, ", ".join(f"{number} {shape} elements" for shape, number in sorted(counts.items())) or "no elements"


def unique_elements(rows: Rows) -> tuple[Ints, Ints]:
    """Return the corners of every element once, and the element of each row.

    Elements have the order of their numbers in the file. MSH 2.2 lists an element of two groups twice, under two
    numbers.
    """
    corners = np.sort(rows.nodes, axis=1)
    order = np.lexsort((rows.number, *corners.T))
    ahead = corners[order]
    first = np.append(True, np.any(ahead[1:] != ahead[:-1], axis=1))
    leader = order[first]
    by_number = np.argsort(rows.number[leader], kind="stable")
    place = np.empty_like(by_number)
    place[by_number] = np.arange(len(by_number))
    element = np.empty_like(order)
    element[order] = place[np.cumsum(first) - 1]
    return rows.nodes[leader[by_number]], element


def _check_points(points: Floats, path: Path, what: str = "node") -> None:
    check_finite(points, path, "read_mesh", what)
    extent = np.ptp(points, axis=0)
    if extent[2] > FLAT * extent.max():
        low, high = points[:, 2].min(), points[:, 2].max()
        flat = np.flatnonzero(extent <= FLAT * extent.max())
        remedy = ROTATE.get(int(flat[0])) if len(flat) == 1 else None
        raise ValueError(
            f"read_mesh expected a drawing in the xy-plane; z runs from {low:g} to {high:g} in '{path}'. "
            f"{remedy or 'For a solid, mesh the volume: gmsh -3.'}"
        )


def items_by_name(group: Ints, item: Ints, shape: str, content: Content) -> Sets | None:
    """Return the items by group name, where `item[k]` is in group `group[k]`."""
    named = [tag for dimension, tag in content.names if dimension == DIMENSION[shape]]
    members = by_group(group, item)
    sets: Sets = {}
    for tag in sorted({*members, *named}):
        name, items = name_of(content, DIMENSION[shape], tag), members.get(tag, np.empty(0, np.int64))
        if is_own_name(name):
            sets[name] = np.union1d(sets.get(name, ()), items).astype(np.int32)
    for name, items in sets.items():
        if len(items) == 0:
            what = shape if DIMENSION[shape] == content.dimension else "facet"
            logger.warning("group '%s' has no %s in the mesh.", name, what)
    return sets or None


def _boundaries(mesh: MeshTri, used: Ints, content: Content, path: Path) -> Sets | None:
    """Return ``2 * facet + side`` by name, side 1 if the second is left."""
    rows = content.of_shape(LINE)
    if len(rows.number) == 0 and not content.names:
        return None
    node = indices_in(used, rows.nodes)
    facet = np.where(np.all(node >= 0, axis=1), rows_in(mesh.facets.T, node), -1)
    if np.any(facet < 0):
        logger.warning("%d lines of '%s' are not sides of triangles and are left out.", np.sum(facet < 0), path)
    group, node, facet = rows.group[facet >= 0], node[facet >= 0], facet[facet >= 0]
    centre = mesh.p[:, mesh.t[:, mesh.f2t[0, facet]]].mean(axis=1)
    second = ~is_in_front(mesh.p[:, node.T], centre) & (mesh.f2t[1, facet] >= 0)
    return items_by_name(group, 2 * facet + second, LINE, content)


def oriented(mesh: MeshTri | MeshTet, boundaries: Sets | None, has_direction: Callable[[Ints], bool]) -> Sets | None:
    """Return boundaries as scikit-fem stores them, from codes ``2 * facet + side``.

    A boundary is an `OrientedBoundary` if some of its facets are inside the mesh and `has_direction` is true for its
    directed facets, shape (m, d).
    """
    made: Sets = {}
    for name, codes in (boundaries or {}).items():
        facets, first = np.unique(codes // 2, return_index=True)
        side, made[name] = codes[first] % 2, facets.astype(np.int32)
        if np.any(mesh.f2t[1, facets] >= 0) and has_direction(directed(mesh, facets, side)):
            made[name] = OrientedBoundary(made[name], side)
    return made or None


def _has_direction(lines: Ints) -> bool:
    """Return True if most lines (m, 2) join head to tail.

    Lines without direction meet head to head at half of their joints.
    """
    starts, ends = (np.bincount(nodes, minlength=1 + lines.max(initial=0)) for nodes in lines.T)
    joint = starts + ends == 2
    return bool(np.sum(starts[joint] != 1) <= np.sum(joint) / 4)


def _report(mesh: MeshTri, content: Content, path: Path) -> None:
    sizes, unused = (mesh.p.shape[1], mesh.t.shape[1]), len(content.points) - mesh.p.shape[1]
    names = sorted(mesh.subdomains or ()), sorted(mesh.boundaries or ())
    kind = "triangles with curved sides" if has_bent_sides(mesh) else "triangles"
    text = "read '%s': %d nodes, %d %s, subdomains %s, boundaries %s; %d unused nodes dropped."
    logger.info(text, path, *sizes, kind, *names, unused)
    if mesh.subdomains:
        bare = np.ones(mesh.t.shape[1], dtype=bool)
        bare[np.concatenate(list(mesh.subdomains.values()))] = False
        if bare.any():
            share = 100.0 * area(mesh)[bare].sum() / area(mesh).sum()
            logger.warning("%.3g %% of the area of '%s' is in no surface group: give it one.", share, path)
    if content.missing:
        surfaces = ", ".join(map(str, content.missing))
        logger.warning(
            "'%s' has no triangles for surface %s of its geometry: the mesh has holes there. "
            "Put every surface into a physical group: if there are groups, Gmsh saves only the elements in groups.",
            *(path, surfaces),
        )


def to_curves(content: Content, mesh: MeshTri, path: Path, scale: float) -> dict[str, Spline]:
    """Return a spline for every named boundary that is curved in the file.

    Raises
    ------
    ValueError
        If the file, `path`, does not hold triangles of one order from 2 to 5, or `mesh` has other nodes than the file.
    """
    _check_order(content, path)
    mesh = corners_of(mesh)
    used = np.unique(content.of_shape(TRIANGLE).nodes)
    _check_same(mesh.p, scale * content.points[used, :2].T, path)
    named = {name: np.unique(rows) for name, rows in named_sets(mesh.boundaries).items()}
    facets = np.unique(np.concatenate([np.empty(0, np.int64), *named.values()]))
    segments = _side_nodes(content, used[mesh.facets[:, facets].T], path)
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


def order_of_sides(content: Content) -> int:
    # 0 for straight sides, and for triangles of several orders
    kinds = [kind for kind in content.rows if shape_of(kind) == TRIANGLE]
    return ORDERS.get(kinds[0], 0) if len(kinds) == 1 else 0


def _check_order(content: Content, path: Path) -> None:
    if not order_of_sides(content):
        found = "other elements, too" if content.rows.keys() & ORDERS.keys() else "none"
        raise ValueError(
            f"read_curves expected triangles of one order from 2 to 5, for the nodes of sides; '{path}' has {found}. "
            "Mesh with Mesh.ElementOrder = 2, or use the nodes of the mesh: Spline.through(mesh, name)."
        )


def _check_same(p: Floats, own: Floats, path: Path) -> None:
    if p.shape != own.shape:
        raise _of_another_mesh(path, f", with {own.shape[1]} nodes; got one with {p.shape[1]}")
    off = np.max(np.abs(p - own))
    size = np.ptp(own, axis=1).max()
    if off > SAME * size + DIGITS * np.abs(own).max():
        raise _of_another_mesh(path, f" at this scale; a node is off by {off / size:.3g} times the size of the mesh")


def _of_another_mesh(path: Path, why: str) -> ValueError:
    expected = f"read_curves expected the mesh that read_mesh('{path}') returns"
    return ValueError(f"{expected}{why}. Read the curves before the mesh is changed.")


def _side_nodes(content: Content, ends: Ints, path: Path) -> Ints:
    """Return the nodes (f, order + 1) from end to end of the facets `ends` (f, 2)."""
    order, triangles = (
        order_of_sides(content),
        next(content.rows[kind] for kind in ORDERS if kind in content.rows).nodes,
    )
    inner = np.full((len(ends), order - 1), -1)
    for k, side in enumerate(SIDES):
        facet, first = rows_in(ends, triangles[:, side]), 3 + k * (order - 1)
        own, facet = triangles[facet >= 0], facet[facet >= 0]
        forth = ends[facet, 0] == own[:, side[0]]
        between = own[:, first : first + order - 1]
        inner[facet] = np.where(forth[:, None], between, between[:, ::-1])
    if np.any(inner < 0):
        count = np.sum(inner[:, 0] < 0)
        raise _of_another_mesh(path, f"; {count} facets of its boundaries are not sides of triangles in the file")
    return np.column_stack([ends[:, 0], inner, ends[:, 1]])


def _is_curved(segments: Ints, position: Floats) -> Mask:
    start, end = position[:, segments[:, 0]], position[:, segments[:, -1]]
    chord, off = (end - start)[..., None], position[:, segments[:, 1:-1]] - start[..., None]
    length = np.sqrt(np.sum(chord[..., 0] ** 2, axis=0))
    distance = np.abs(chord[0] * off[1] - chord[1] * off[0]).max(axis=1) / length
    return distance > STRAIGHT * length + DIGITS * np.abs(position[:, segments]).max(initial=0.0)
