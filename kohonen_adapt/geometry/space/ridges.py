"""Ridges, the curves along which patches meet or end.

Nodes slide along ridges; corners, the ends of ridges, stay where they are.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.cutting import COLLINEAR, TURN, cut_polylines, fitted_circle
from kohonen_adapt.geometry.plane.polylines import CORNER, Polylines, joined_ends, trace_polylines, without_noise
from kohonen_adapt.geometry.space.patches import Edges, Faces, Patches
from kohonen_adapt.kernels.tetrahedron.arrays import (
    CIRCLE,
    CONE,
    HELD,
    INSIDE,
    INTERSECTION,
    LINE,
    ON_PATCH,
    ON_RIDGE,
    PLANE,
    Freedom,
)
from kohonen_adapt.mesh.names import connected_components_of

__all__ = ["Ridges", "freedom_of", "ridges_of"]

MOST = 4  # maximum number of patches of a ridge; nodes of edges in which more patches meet are held
SAME = 1e-8  # maximum difference of equal lines and circles, relative to the size of the mesh
ACROSS = 1e-3  # sine of the minimum angle at which two patches meet in an INTERSECTION
APEX = 1e-9  # distance from the apex of a cone below which nodes are held, relative to the size of the mesh


class Ridges(NamedTuple):
    ends: Ints  # (k, 2) nodes of the edges
    of_edge: Ints  # (k,) ridge of every edge, -1 if more than MOST patches meet or the shape is unknown
    meets: NDArray[np.int32]  # (r, MOST) patches that meet, ascending, padded with -1
    shape: NDArray[np.int8]  # (r,)
    origin: Floats  # (r, 3)
    axis: Floats  # (r, 3)
    size: Floats  # (r,)


class Pieces(NamedTuple):
    of_edge: Ints  # (k,)
    kind: Ints  # (q,) row of the patches that meet
    shape: NDArray[np.int8]  # (q,)
    origin: Floats  # (q, 3)
    axis: Floats  # (q, 3)
    size: Floats  # (q,)


def ridges_of(edges: Edges, patches: Patches, position: Floats) -> Ridges:
    meets, crowded, is_ridge = meeting_patches(edges, patches)
    ends, crowded = edges.ends[is_ridge], crowded[is_ridge]
    kinds, kind = np.unique(meets[is_ridge], axis=0, return_inverse=True)
    kind = np.where(crowded, -1, kind.ravel())
    pieces = cut(ends, kind, kinds, patches, position)
    known = (pieces.shape >= 0) & (pieces.kind >= 0)
    known &= np.bincount(pieces.of_edge, minlength=len(known)) > 0  # polylines that were cut further have no edges
    ridge = np.full(len(known), -1)
    ridge[known] = connected_components_of(int(known.sum()), same_pairs(pieces, np.flatnonzero(known), position))
    kept = np.flatnonzero(known)[np.unique(ridge[known], return_index=True)[1]]
    own = (pieces.shape[kept], pieces.origin[kept], pieces.axis[kept], pieces.size[kept])
    return Ridges(ends, ridge[pieces.of_edge], kinds[pieces.kind[kept]], *own)


def meeting_patches(edges: Edges, patches: Patches) -> tuple[NDArray[np.int32], Mask, Mask]:
    """Return the patches that meet at every edge, (g, MOST), and two masks (g,).

    The first mask is True if more than MOST patches meet, the second if the edge belongs to a ridge.
    """
    count = len(patches.shape)
    edge = np.repeat(np.arange(len(edges.ends)), edges.faces_around)
    row, patch = np.divmod(np.unique(edge * count + patches.of_face[edges.face]), max(count, 1))
    different = np.bincount(row, minlength=len(edges.ends))
    place = np.arange(len(row)) - np.repeat(np.cumsum(different) - different, different)
    meets = np.full((len(edges.ends), MOST), -1, dtype=np.int32)
    meets[row[place < MOST], place[place < MOST]] = patch[place < MOST]
    return meets, different > MOST, (edges.faces_around != 2) | (different != 1)


def cut(ends: Ints, kind: Ints, kinds: Ints, patches: Patches, position: Floats) -> Pieces:
    polylines, curved = smooth_runs(ends, kind, position)
    first, last = polylines.node[polylines.start[:-1]], polylines.node[polylines.start[1:] - 1]
    chord = position[last] - position[first]
    length = np.linalg.norm(chord, axis=1, keepdims=True)
    axis = chord / np.where(length > 0.0, length, 1.0)
    of_run = kind[polylines.facet[polylines.start[:-1]]]
    straight = (np.full(len(chord), LINE, dtype=np.int8), position[first], axis, np.zeros(len(chord)))
    of_edge = np.empty(len(ends), dtype=np.int64)
    of_edge[polylines.facet[polylines.facet >= 0]] = np.repeat(np.arange(len(chord)), np.diff(polylines.start))[
        polylines.facet >= 0
    ]
    more: list[Rows] = [straight]
    added, kind_of = len(chord), [of_run]
    for r in np.flatnonzero(curved).tolist():
        slots = slice(polylines.start[r], polylines.start[r + 1])
        node, edge = polylines.node[slots], polylines.facet[slots][:-1]
        pieces, own = pieces_of(node, bool(polylines.closed[r]), kinds[of_run[r]], patches, position)
        of_edge[edge] = added + pieces
        more.append(own)
        kind_of.append(np.full(len(own[0]), of_run[r]))
        added += len(own[0])
    shape, origin, axis, size = (np.concatenate(column) for column in zip(*more, strict=True))
    return Pieces(of_edge, np.concatenate(kind_of), shape, origin, axis, size)


def smooth_runs(ends: Ints, kind: Ints, position: Floats) -> tuple[Polylines, Mask]:
    node, end = joined_ends(ends, len(position))
    other = ends.ravel()[end ^ 1]
    arriving, leaving = position[node] - position[other[:, 0]], position[other[:, 1]] - position[node]
    offset = np.linalg.norm(np.cross(arriving, leaving), axis=1)
    turn = np.arctan2(offset, np.einsum("ij,ij->i", arriving, leaving))
    continuing = (turn < CORNER) & (kind[end[:, 0] // 2] == kind[end[:, 1] // 2])
    through = np.full((len(position), 2), -1, dtype=np.int32)
    through[node[continuing]] = end[continuing] // 2
    polylines = trace_polylines(ends, through)
    turning = np.zeros(len(position), dtype=bool)
    turning[node[continuing & (turn > TURN)]] = True
    inner = turning[polylines.node] & (
        np.arange(len(polylines.node)) > np.repeat(polylines.start[:-1], np.diff(polylines.start))
    )
    inner[polylines.start[1:] - 1] &= polylines.closed
    return polylines, np.add.reduceat(inner, polylines.start[:-1], dtype=np.int64) > 0 if len(
        polylines.closed
    ) else polylines.closed


Rows = tuple[NDArray[np.int8], Floats, Floats, Floats]


def pieces_of(node: Ints, closed: bool, meets: Ints, patches: Patches, position: Floats) -> tuple[Ints, Rows]:
    # A polyline between patches that are not all planes is one piece: a circle, the intersection of two patches, or
    # of unknown shape. Other polylines are cut into straight pieces and arcs if they lie in a plane, else into single
    # edges.
    x = position[node]
    middle, axes = x.mean(axis=0), np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2]
    size = np.ptp(x, axis=0).max()
    flat = np.abs((x - middle) @ axes[2]).max() <= COLLINEAR * size
    meeting = meets[meets >= 0]
    if len(meeting) > 1 and np.any(patches.shape[meeting] != PLANE):
        rows, circle = np.array([[0, len(x) - 1, 1, closed]]), circle_through((x - middle) @ axes[:2].T)
        if not (flat and np.isfinite(circle).all()):
            shape = INTERSECTION if intersect_at_angle(x, meeting, patches) else -1
            own = (np.array([shape], dtype=np.int8), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1))
            return np.zeros(len(x) - 1, dtype=np.int64), own
    elif flat:
        rows, circle = cut_in_plane((x - middle) @ axes[:2].T, closed)
    else:
        edge = np.arange(len(x) - 1)
        rows, circle = np.column_stack([edge, edge + 1, 0 * edge, 0 * edge]), np.zeros((len(edge), 3))
    return np.repeat(np.arange(len(rows)), rows[:, 1] - rows[:, 0]), lines_and_circles(rows, circle, x, middle, axes)


def circle_through(x: Floats) -> Floats:
    circle = without_noise(np.array([fitted_circle(x, np.arange(len(x)), 0, len(x) - 1)]))
    offset = np.abs(np.hypot(*(x - circle[0, :2]).T) - circle[0, 2]).max()
    return circle if offset <= COLLINEAR * circle[0, 2] < np.inf else np.full((1, 3), np.nan)


def cut_in_plane(x: Floats, closed: bool) -> tuple[Ints, Floats]:
    """Return straight pieces and arcs of a polyline in its plane (k, 2).

    The first piece begins at the first node. A piece of a closed polyline across this node is returned as two.
    """
    count = len(x) - 1
    node, facet = np.append(np.arange(count), 0 if closed else count), np.append(np.arange(count), -1)
    rows, circle = np.zeros((count + 1, 4), dtype=np.int64), np.zeros((count + 1, 3))
    start, whole = np.array([0, count + 1]), np.array([False])
    number = cut_polylines(x, node, facet, start, np.array([closed]), whole, rows, circle)
    piece = np.empty(count, dtype=np.int64)
    piece[facet[:-1]] = np.repeat(np.arange(number), rows[:number, 1] - rows[:number, 0])
    begin = np.flatnonzero(np.diff(piece, prepend=-1))
    rows = np.column_stack([begin, np.append(begin[1:], count), rows[piece[begin], 2:]])
    return rows, without_noise(circle[:number])[piece[begin]]


def lines_and_circles(rows: Ints, circle: Floats, x: Floats, middle: Floats, axes: Floats) -> Rows:
    start, chord = x[rows[:, 0]], x[rows[:, 1]] - x[rows[:, 0]]
    is_round = rows[:, 2] == 1
    length = np.linalg.norm(chord, axis=1, keepdims=True)
    axis = np.where(is_round[:, None], axes[2], chord / np.where(length > 0.0, length, 1.0))
    origin = np.where(is_round[:, None], middle + circle[:, :2] @ axes[:2], start)
    return np.where(is_round, CIRCLE, LINE).astype(np.int8), origin, axis, np.where(is_round, circle[:, 2], 0.0)


def intersect_at_angle(x: Floats, meeting: Ints, patches: Patches) -> bool:
    step = 1e-3 * np.ptp(x, axis=0).max()
    normal = []
    for p in meeting[:2].tolist():
        offset = x + step * np.array([[0.36, 0.48, 0.8]])  # a direction parallel to no axis
        patch = np.full(len(x), p)
        away = offset - patches.project(patch, offset)
        again = x + step * np.array([[0.8, -0.36, 0.48]])
        other = again - patches.project(patch, again)
        longer = np.linalg.norm(away, axis=1) >= np.linalg.norm(other, axis=1)
        chosen = np.where(longer[:, None], away, other)
        normal.append(chosen / np.linalg.norm(chosen, axis=1, keepdims=True))
    return bool(np.all(np.linalg.norm(np.cross(*normal), axis=1) > ACROSS))


def same_pairs(pieces: Pieces, some: Ints, position: Floats) -> Ints:
    low, size = position.min(axis=0), np.ptp(position, axis=0).max()
    axis, at, shape = pieces.axis[some], pieces.origin[some] - low, pieces.shape[some]
    at = np.where((shape == LINE)[:, None], at - axis * np.einsum("ij,ij->i", at, axis)[:, None], at)
    at[shape == INTERSECTION] = 0.0
    both_ways = np.einsum("ij,ik->ijk", axis, axis).reshape(len(axis), 9)
    rows = np.column_stack([at / size, both_ways, pieces.size[some] / size, pieces.kind[some], shape])
    return cKDTree(rows).query_pairs(SAME, output_type="ndarray")


def freedom_of(faces: Faces, patches: Patches, ridges: Ridges, pinned: Mask, position: Floats) -> Freedom:
    nnodes, count = len(pinned), len(patches.shape)
    there = np.unique(faces.nodes.ravel() * np.int64(count) + np.repeat(patches.of_face, 3))
    node, patch = np.divmod(there, max(count, 1))
    different = np.bincount(node, minlength=nnodes)
    number, place = np.full(nnodes, INSIDE, dtype=np.int8), np.full(nnodes, -1, dtype=np.int32)
    number[node], place[node] = ON_PATCH, patch
    tip = np.linalg.norm(position[node] - patches.origin[patch], axis=1) <= APEX * np.ptp(position, axis=0).max()
    number[node[tip & (patches.shape[patch] == CONE)]] = HELD
    number[different > 1] = HELD
    number[ridges.ends] = HELD
    inner, end = joined_ends(ridges.ends, nnodes)
    one, other = ridges.of_edge[end // 2].T
    along = (one == other) & (one >= 0)
    along[along] = np.sum(ridges.meets[one[along]] >= 0, axis=1) == different[inner[along]]
    number[inner[along]], place[inner[along]] = ON_RIDGE, one[along]
    number[pinned] = HELD
    place[(number == HELD) | (number == INSIDE)] = -1
    return Freedom(number, place, pinned.copy())
