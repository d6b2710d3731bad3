"""Make a mesh with names of what a file holds."""

import logging
from pathlib import Path

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.io.content import LINE, TRIANGLE, Content, Rows, found_in, shape_of
from kohonen_adapt.io.groups import DIMENSION, by_group, name_of
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.names import is_own_name

__all__ = ["to_mesh"]

logger = logging.getLogger("kohonen_adapt")

Sets = dict[str, Ints]

FLAT = 1e-9
"""How far from a plane z = constant a drawing may be, in sizes of the mesh."""


def to_mesh(content: Content, path: Path, scale: float) -> MeshTri:
    """The triangles of a file as a mesh, with its groups as subdomains and boundaries.

    Raises
    ------
    ValueError
        If the file, `path`, holds other than triangles in the xy-plane.
    """
    _check_shapes(content, path)
    rows = content.of_shape(TRIANGLE)
    triangles, element = _listed_once(rows)
    is_used = np.zeros(len(content.points), dtype=bool)
    is_used[triangles] = True
    used = np.flatnonzero(is_used)
    _check_points(content.points[used], path)
    p = np.ascontiguousarray(scale * content.points[used, :2].T)
    bare = MeshTri(p, np.ascontiguousarray((np.cumsum(is_used) - 1)[triangles].T))
    subdomains = _by_name(rows.group, element, TRIANGLE, content)
    mesh = MeshTri(bare.p, bare.t, _boundaries(bare, used, content, path), subdomains)
    _report(mesh, content, path)
    return mesh


def _check_shapes(content: Content, path: Path) -> None:
    counts: dict[str, int] = {}
    for kind, rows in content.rows.items():
        counts[shape_of(kind)] = counts.get(shape_of(kind), 0) + len(rows.number)
    found = ", ".join(f"{number} {shape} elements" for shape, number in sorted(counts.items())) or "no elements"
    if "3D" in counts:
        raise ValueError(f"read_mesh expected a plane mesh; '{path}' has {found}. Mesh only the surface: gmsh -2.")
    if "quadrilateral" in counts:
        raise ValueError(
            f"read_mesh expected triangles only; '{path}' has {found}. "
            "Mesh without recombination, or split them with skfem.MeshQuad.to_meshtri()."
        )
    if TRIANGLE not in counts:
        raise ValueError(
            f"read_mesh expected triangles; '{path}' has {found}. "
            "Mesh in two dimensions (gmsh -2) and give the surfaces a physical group: Gmsh saves only what has one."
        )


def _listed_once(rows: Rows) -> tuple[Ints, Ints]:
    """Every element once, in the order of the numbers in the file: its corners, and which element each row is.

    MSH 2.2 lists an element of two groups twice, under two numbers.
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


def _check_points(points: Floats, path: Path) -> None:
    if not np.all(np.isfinite(points)):
        broken = points[~np.isfinite(points).all(axis=1)][0]
        raise ValueError(f"read_mesh expected finite coordinates; '{path}' has a node at {broken}.")
    extent = np.ptp(points, axis=0)
    if extent[2] > FLAT * extent.max():
        low, high = points[:, 2].min(), points[:, 2].max()
        raise ValueError(f"read_mesh expected a drawing in the xy-plane; z runs from {low:g} to {high:g} in '{path}'.")


def _by_name(group: Ints, item: Ints, shape: str, content: Content) -> Sets | None:
    """Items by the name of their group; row k says that `item[k]` is in `group[k]`."""
    named = [tag for dimension, tag in content.names if dimension == DIMENSION[shape]]
    members = by_group(group, item)
    sets: Sets = {}
    for tag in sorted({*members, *named}):
        name, items = name_of(content, DIMENSION[shape], tag), members.get(tag, np.empty(0, np.int64))
        if is_own_name(name):
            sets[name] = np.union1d(sets.get(name, ()), items).astype(np.int32)
    for name, items in sets.items():
        if len(items) == 0:
            logger.warning("group '%s' has no %s in the mesh.", name, "facet" if shape == LINE else "triangle")
    return sets or None


def _boundaries(mesh: MeshTri, used: Ints, content: Content, path: Path) -> Sets | None:
    rows = content.of_shape(LINE)
    if len(rows.number) == 0 and not content.names:
        return None
    node = found_in(used, rows.nodes)
    facet = np.where(np.all(node >= 0, axis=1), _facets(mesh, np.sort(node, axis=1)), -1)
    if np.any(facet < 0):
        logger.warning("%d lines of '%s' are no side of a triangle: left out.", np.sum(facet < 0), path)
    return _by_name(rows.group[facet >= 0], facet[facet >= 0], LINE, content)


def _facets(mesh: MeshTri, pairs: Ints) -> Ints:
    """Number of the facet between two nodes, lower one first, (n, 2) -> (n,); -1 where there is none."""
    keys = mesh.facets[0].astype(np.int64) * mesh.p.shape[1] + mesh.facets[1]
    return found_in(keys, pairs[:, 0] * mesh.p.shape[1] + pairs[:, 1])


def _report(mesh: MeshTri, content: Content, path: Path) -> None:
    logger.info(
        "read '%s': %d nodes, %d triangles, subdomains %s, boundaries %s; %d unused nodes dropped.",
        path,
        mesh.p.shape[1],
        mesh.t.shape[1],
        sorted(mesh.subdomains or ()),
        sorted(mesh.boundaries or ()),
        len(content.points) - mesh.p.shape[1],
    )
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
            "Put every surface into a physical group: where there are groups, Gmsh saves only what is in one.",
            path,
            surfaces,
        )
