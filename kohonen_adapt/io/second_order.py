"""Lay curves through the mid-side nodes of a second-order Gmsh file, by the name of the boundary."""

import logging
from pathlib import Path

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.io.content import TRIANGLE, Content, found_in, shape_of
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.outline.polylines import polylines_of
from kohonen_adapt.outline.spline import Spline

__all__ = ["to_curves"]

logger = logging.getLogger("kohonen_adapt")

TRIANGLE6 = 9
"""Gmsh's number for triangles of three corners and, in `MIDDLES`, a node on each side."""

SIDES, MIDDLES = ([0, 1], [1, 2], [2, 0]), (3, 4, 5)
SAME = 1e-12
"""How far, in sizes of the mesh, a node may be from where the file has it."""

STRAIGHT = 1e-9
"""How far, in lengths of its facet, a mid-side node may be off a straight one."""

DIGITS = 1e-14
"""How far, in sizes of the coordinates, it may be off because these are rounded."""


def to_curves(content: Content, mesh: MeshTri, path: Path, scale: float) -> dict[str, Spline]:
    """Splines through the end and mid-side nodes of the named boundaries of a mesh that are curved in its file.

    Raises
    ------
    ValueError
        If the file, `path`, holds triangles of another order, or the mesh is not that of its corners.
    """
    _check_order(content, path)
    triangles = content.rows[TRIANGLE6].nodes
    used = np.unique(triangles[:, :3])
    _check_same(mesh.p, scale * content.points[used, :2].T, path)
    named = {name: np.unique(rows) for name, rows in named_sets(mesh.boundaries).items()}
    facets = np.unique(np.concatenate([np.empty(0, np.int64), *named.values()]))
    ends = used[mesh.facets[:, facets].T]
    middle = _middles(triangles, ends, path)
    position = scale * content.points[:, :2].T
    _check_finite(position[:, middle], path)
    segments = np.column_stack([ends[:, 0], middle, ends[:, 1]])
    bent = _is_bent(segments, position)
    curves = {}
    for name, members in named.items():
        which = np.searchsorted(facets, members)
        if bent[which].any():
            polylines = polylines_of(segments[which], position)
            curves[name] = Spline.of_pieces([(position[:, line.nodes], line.closed) for line in polylines])
    logger.info("curved boundaries of '%s': %s.", path, curves or "none")
    return curves


def _check_order(content: Content, path: Path) -> None:
    kinds = {kind for kind in content.rows if shape_of(kind) == TRIANGLE}
    if kinds != {TRIANGLE6}:
        found = "others, too" if TRIANGLE6 in kinds else "none"
        raise ValueError(
            f"read_curves expected triangles of second order only, for their mid-side nodes; '{path}' has {found}. "
            "Mesh with Mesh.ElementOrder = 2, or take the nodes of the mesh: Spline.through(mesh, name)."
        )


def _check_same(p: Floats, own: Floats, path: Path) -> None:
    if p.shape != own.shape:
        raise ValueError(
            f"read_curves expected the mesh that read_mesh('{path}') gives, with {own.shape[1]} nodes; got one with "
            f"{p.shape[1]}. Read the curves before the mesh is changed."
        )
    off = np.max(np.abs(p - own))
    size = np.ptp(own, axis=1).max()
    if off > SAME * size + DIGITS * np.abs(own).max():
        raise ValueError(
            f"read_curves expected the mesh that read_mesh('{path}') gives at this scale; a node is "
            f"{off / size:.3g} sizes of the mesh off its place. Read the curves before the mesh is changed."
        )


def _middles(triangles: Ints, ends: Ints, path: Path) -> Ints:
    """The node between each of these pairs of nodes, (f, 2) -> (f,).

    The triangles have it for every facet, also where a name was given after reading and the file has no line.
    """
    count = triangles.max(initial=0) + 1
    wanted = np.min(ends, axis=1) * count + np.max(ends, axis=1)
    middle = np.full(len(ends), -1)
    for side, between in zip(SIDES, MIDDLES, strict=True):
        pair = triangles[:, side]
        facet = found_in(wanted, np.min(pair, axis=1) * count + np.max(pair, axis=1))
        middle[facet[facet >= 0]] = triangles[facet >= 0, between]
    if np.any(middle < 0):
        raise ValueError(
            f"read_curves expected the mesh that read_mesh('{path}') gives; {np.sum(middle < 0)} facets in its "
            "boundaries are no side of a triangle of the file. Read the curves before the mesh is changed."
        )
    return middle


def _check_finite(points: Floats, path: Path) -> None:
    if not np.all(np.isfinite(points)):
        broken = points[:, ~np.isfinite(points).all(axis=0)][:, 0]
        raise ValueError(f"read_curves expected finite coordinates; '{path}' has a mid-side node at {broken}.")


def _is_bent(segments: Ints, position: Floats) -> Mask:
    """Tell whether a middle is off its chord by more than rounding, (f, 3) -> (f,)."""
    start, middle, end = (position[:, segments[:, k]] for k in range(3))
    chord, off = end - start, middle - start
    length = np.sqrt(np.sum(chord**2, axis=0))
    distance = np.abs(chord[0] * off[1] - chord[1] * off[0]) / length
    return distance > STRAIGHT * length + DIGITS * np.abs(position[:, segments]).max(initial=0.0)
