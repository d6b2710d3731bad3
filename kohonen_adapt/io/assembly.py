"""Triangle meshes and curves from the content of mesh files."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
from skfem import MeshTet, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Ints
from kohonen_adapt.io.content import (
    DIMENSION,
    LINE,
    TRIANGLE,
    Content,
    Rows,
    check_flat,
    indices_in,
    rows_in,
    shape_of,
)
from kohonen_adapt.io.curved_sides import ORDERS, order_of_sides, with_curved_sides
from kohonen_adapt.io.groups import by_group, name_of
from kohonen_adapt.mesh.curved import is_second_order as has_bent_sides
from kohonen_adapt.mesh.host import is_own_name
from kohonen_adapt.mesh.measures import area, directed, is_in_front

__all__ = ["element_counts", "items_by_name", "oriented", "to_mesh", "unique_elements"]

logger = logging.getLogger("kohonen_adapt")

Sets = dict[str, Ints]


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
    check_flat(content.points[used], path)
    p = np.ascontiguousarray(scale * content.points[used, :2].T)
    bare = MeshTri(p, np.ascontiguousarray((np.cumsum(is_used) - 1)[triangles].T))
    subdomains = items_by_name(rows.group, element, TRIANGLE, content)
    boundaries = oriented(bare, _boundaries(bare, used, content, path), _has_direction)
    mesh = MeshTri(bare.p, bare.t, boundaries, subdomains)
    if order_of_sides(content):
        mesh = with_curved_sides(mesh, content, used, path, scale)
    elif content.rows.keys() & ORDERS.keys():
        logger.warning("'%s' has triangles of several orders: all sides are read as straight.", path)
    _report(mesh, content, path)
    return mesh


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
    # Elements have the order of their numbers in the file. MSH 2.2 lists an element of two groups twice, under two
    # numbers.
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
    # codes 2 * facet + side by name, side 1 if the second is left
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
