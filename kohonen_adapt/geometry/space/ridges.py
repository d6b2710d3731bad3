"""Ridges, the curves along which patches meet or end.

Nodes slide along ridges; corners, the ends of ridges, stay where they are.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Int32s, Ints, Mask, counted, unique_pairs
from kohonen_adapt.geometry.circles import sphere_through
from kohonen_adapt.geometry.plane.cutting import COLLINEAR, TURN, Circle, Part, as_complex, as_rows, cut_polyline
from kohonen_adapt.geometry.plane.polylines import CORNER, circles_of, joined_ends, trace_polylines, turns_at
from kohonen_adapt.geometry.space.patches import Edges, Faces, Patches, Shapes
from kohonen_adapt.geometry.space.surfaces import unit
from kohonen_adapt.kernels.tetrahedron.arrays import (
    CIRCLE,
    CONE,
    CYLINDER,
    HELD,
    INSIDE,
    INTERSECTION,
    LINE,
    ON_PATCH,
    ON_RIDGE,
    PLANE,
    SPHERE,
    Freedom,
)
from kohonen_adapt.mesh.names import connected_components_of

__all__ = ["Ridges", "freedom_of", "ridges_of"]

MOST = 4  # maximum number of patches of a ridge; nodes of edges in which more patches meet are held
SAME = 1e-8  # maximum difference of equal lines and circles, relative to the size of the mesh
ACROSS = 1e-3  # sine of the minimum angle at which two patches meet in an INTERSECTION
APEX = 1e-9  # distance from the apex of a cone below which nodes are held, relative to the size of the mesh
UNKNOWN = -1  # shape of a curve that is not recognised
STEPS = np.array([[0.36, 0.48, 0.8], [0.8, -0.36, 0.48]])  # directions parallel to no axis


class Ridges(NamedTuple):
    ends: Ints  # (k, 2) nodes of the edges
    of_edge: Ints  # (k,) ridge of every edge, -1 if more than MOST patches meet or the shape is unknown
    meets: Int32s  # (r, MOST) patches that meet, ascending, padded with -1
    curves: Shapes  # (r,)


def ridges_of(edges: Edges, patches: Patches, position: Floats) -> Ridges:
    meets, crowded, is_ridge = meeting_patches(edges, patches)
    ends, crowded = edges.ends[is_ridge], crowded[is_ridge]
    kinds, kind = np.unique(meets[is_ridge], axis=0, return_inverse=True)
    kind = np.where(crowded, -1, kind.ravel())
    of_edge, pieces = cut(ends, kind, kinds, patches, position)
    edge = np.full(len(pieces.shape), -1)  # an edge of every piece
    edge[of_edge] = np.arange(len(ends))
    known = np.flatnonzero((pieces.shape != UNKNOWN) & (edge >= 0) & (kind[edge] >= 0))
    own, ridge = Shapes._make(array[known] for array in pieces), np.full(len(edge), -1)
    ridge[known] = connected_components_of(len(known), same_pairs(own, kind[edge[known]], position))
    first = np.unique(ridge[known], return_index=True)[1]
    return Ridges(ends, ridge[of_edge], kinds[kind[edge[known[first]]]], Shapes._make(array[first] for array in own))


def meeting_patches(edges: Edges, patches: Patches) -> tuple[Int32s, Mask, Mask]:
    """Return the patches that meet at every edge, (g, MOST), and two masks (g,).

    The first mask is True if more than MOST patches meet, the second if the edge belongs to a ridge.
    """
    row, patch = unique_pairs(np.repeat(np.arange(len(edges.ends)), edges.faces_around), patches.of_face[edges.face])
    different = np.bincount(row, minlength=len(edges.ends))
    place = counted(different)
    meets = np.full((len(edges.ends), MOST), -1, np.int32)
    meets[row[place < MOST], place[place < MOST]] = patch[place < MOST]
    return meets, different > MOST, (edges.faces_around != 2) | (different != 1)


def cut(ends: Ints, kind: Ints, kinds: Ints, patches: Patches, position: Floats) -> tuple[Ints, Shapes]:
    # Edges without a sharp turn between them are lines, or pieces of curves. Returns the piece of every edge.
    joint, end = joined_ends(ends, len(position))
    turn = turns_at(end, position[ends[:, ::-1]] - position[ends])
    one, other = kind[end // 2].T
    smooth = (one == other) & ((turn < CORNER) | np.append(meet_smoothly(kinds, patches), False)[one])
    polylines = trace_polylines(ends, joint, end // 2, smooth)
    of_edge = np.empty(len(ends), np.int64)
    is_edge = polylines.facet >= 0
    of_edge[polylines.facet[is_edge]] = np.repeat(np.arange(len(polylines.closed)), np.diff(polylines.start))[is_edge]
    first, last = position[polylines.node[polylines.start[:-1]]], position[polylines.node[polylines.start[1:] - 1]]
    found = [lines(first, last)]
    for r in np.unique(of_edge[end[smooth & (turn > TURN), 0] // 2]).tolist():
        slots = slice(polylines.start[r], polylines.start[r + 1])
        x, edge = position[polylines.node[slots]], polylines.facet[slots][:-1]
        meeting = kinds[kind[edge[0]]]
        piece, curves = pieces_of(x, bool(polylines.closed[r]), meeting[meeting >= 0], patches)
        of_edge[edge] = sum(len(each.shape) for each in found) + piece
        found.append(curves)
    return of_edge, Shapes._make(map(np.concatenate, zip(*found, strict=True)))


def meet_smoothly(kinds: Ints, patches: Patches) -> Mask:
    """Return a mask (k,) of patches `kinds` (k, MOST) that meet smoothly.

    Planes and cylinders meet in ellipses, and spheres meet planes and spheres in circles. On coarse meshes such a curve
    may turn at a node by any angle.
    """
    shape = np.where(kinds >= 0, patches.shape[kinds], -1)
    planes, cylinders, spheres = (np.sum(shape == each, axis=1) for each in (PLANE, CYLINDER, SPHERE))
    return np.asarray(((planes > 0) & (cylinders + spheres > 0)) | (spheres > 1))


def lines(start: Floats, end: Floats) -> Shapes:
    return Shapes(np.full(len(start), LINE, np.int8), start, unit(end - start, end - start), np.zeros(len(start)))


def pieces_of(x: Floats, closed: bool, meeting: Ints, patches: Patches) -> tuple[Ints, Shapes]:
    # A polyline between patches that are not all planes is one piece: a circle, the intersection of two patches, or
    # of unknown shape. Other polylines are cut into straight pieces and arcs if they lie in a plane, else into single
    # edges.
    middle = x.mean(axis=0)
    axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2]
    flat = np.abs((x - middle) @ axes[2]).max() <= COLLINEAR * np.ptp(x, axis=0).max()
    z = as_complex((x - middle) @ axes[:2].T)
    count = len(x) - 1
    shift = 0
    if len(meeting) > 1 and np.any(patches.shape[meeting] != PLANE):
        circle = sphere_through(as_rows(z), COLLINEAR) if flat else None
        if circle is None:
            curves = lines(np.zeros((1, 3)), np.zeros((1, 3)))
            curves.shape[:] = INTERSECTION if intersect_at_angle(x, meeting, patches) else UNKNOWN
            return np.zeros(count, np.int64), curves
        parts = [Part(0, count, Circle(as_complex(circle[0]), circle[1]))]
    elif flat:
        parts, shift = cut_polyline(z, closed)
    else:
        parts = [Part(k, k + 1) for k in range(count)]
    first, last = np.array([part[:2] for part in parts]).T
    x, piece = np.append(x[shift:], x[1 : shift + 1], axis=0), np.repeat(np.arange(len(parts)), last - first)
    curves, circles = lines(x[first], x[last]), circles_of(parts)
    for p in np.flatnonzero(~np.isnan(circles[:, 2])).tolist():
        curves.set(p, (CIRCLE, middle + circles[p, :2] @ axes[:2], axes[2], circles[p, 2]))
    return np.roll(piece, shift), curves


def intersect_at_angle(x: Floats, meeting: Ints, patches: Patches) -> bool:
    normal = []
    for p in meeting[:2].tolist():
        beside = x + 1e-3 * np.ptp(x, axis=0).max() * STEPS[:, None]
        away = beside - [patches.project(np.full(len(x), p), points) for points in beside]
        length = np.linalg.norm(away, axis=2)
        longer = np.argmax(length, axis=0), np.arange(len(x))
        normal.append(away[longer] / length[longer][:, None])
    return bool(np.all(np.linalg.norm(np.cross(*normal), axis=1) > ACROSS))


def same_pairs(curves: Shapes, kind: Ints, position: Floats) -> Ints:
    low, size = position.min(axis=0), np.ptp(position, axis=0).max()
    shape, origin, axis, radius = curves
    at = origin - low
    at = np.where((shape == LINE)[:, None], at - axis * np.einsum("ij,ij->i", at, axis)[:, None], at)
    both_ways = np.einsum("ij,ik->ijk", axis, axis).reshape(len(axis), 9)
    rows = np.column_stack([at / size, both_ways, radius / size, kind, shape])
    rows[shape == INTERSECTION, :3] = 0.0
    return cKDTree(rows).query_pairs(SAME, output_type="ndarray")


def freedom_of(faces: Faces, patches: Patches, ridges: Ridges, pinned: Mask, position: Floats) -> Freedom:
    nnodes = len(pinned)
    node, patch = unique_pairs(faces.nodes.ravel(), np.repeat(patches.of_face, 3))
    different = np.bincount(node, minlength=nnodes)
    number, place = np.full(nnodes, INSIDE, np.int8), np.full(nnodes, -1, np.int32)
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
