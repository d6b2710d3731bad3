"""Trace the ridges in which patches meet or end, from corner to corner, and say what each node of them may do."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, LINE, ON_PATCH, ON_RIDGE, Freedom
from kohonen_adapt.outline.faces import Edges, Faces
from kohonen_adapt.outline.patches import TURN, Patches, joined
from kohonen_adapt.outline.polylines import Runs, meetings, traced

__all__ = ["Ridges", "freedom_of", "ridges_of"]

MOST = 4  # patches that a ridge can tell; nodes where more meet along an edge are held
SAME = 1e-8  # of the size of the mesh: lines and circles that are no farther apart are one


class Ridges(NamedTuple):
    """The ridges, a row each, and the edges that are part of them."""

    ends: Ints  # (k, 2) nodes of the edges
    of_edge: Ints  # (k,) ridge of every edge, -1 where more than MOST patches meet
    meets: NDArray[np.int32]  # (r, MOST) the patches that meet there, ascending, then -1
    shape: NDArray[np.int8]  # (r,)
    origin: Floats  # (r, 3)
    axis: Floats  # (r, 3)
    size: Floats  # (r,)


def ridges_of(edges: Edges, patches: Patches, position: Floats) -> Ridges:
    """Trace the ridges; pieces of one line between the same patches are one ridge, whatever is between them."""
    meets, crowded, is_ridge = meeting_patches(edges, patches)
    ends, crowded = edges.ends[is_ridge], crowded[is_ridge]
    kinds, kind = np.unique(meets[is_ridge], axis=0, return_inverse=True)
    kind = np.where(crowded, -1, kind.ravel())
    runs = straight_runs(ends, kind, position)
    first, last = runs.node[runs.start[:-1]], runs.node[runs.start[1:] - 1]
    way = position[last] - position[first]
    axis = way / np.linalg.norm(way, axis=1, keepdims=True)
    of_run = kind[runs.facet[runs.start[:-1]]]
    ridge = joined(len(first), same_lines(position[first], axis, of_run, position))
    kept = np.unique(ridge, return_index=True)[1]
    of_edge = np.empty(len(ends), dtype=np.int64)
    length = np.diff(runs.start)
    of_edge[runs.facet[runs.facet >= 0]] = np.repeat(ridge, length)[runs.facet >= 0]
    of_edge[crowded] = -1
    shape, size = np.full(len(kept), LINE, dtype=np.int8), np.zeros(len(kept))
    return Ridges(ends, of_edge, kinds[of_run[kept]], shape, position[first[kept]], axis[kept], size)


def meeting_patches(edges: Edges, patches: Patches) -> tuple[NDArray[np.int32], Mask, Mask]:
    """The patches that meet in every edge, (g, MOST); whether they are more; and whether the edge is one of a ridge."""
    count = len(patches.shape)
    edge = np.repeat(np.arange(len(edges.ends)), edges.faces_around)
    row, patch = np.divmod(np.unique(edge * count + patches.of_face[edges.face]), max(count, 1))
    different = np.bincount(row, minlength=len(edges.ends))
    place = np.arange(len(row)) - np.repeat(np.cumsum(different) - different, different)
    meets = np.full((len(edges.ends), MOST), -1, dtype=np.int32)
    meets[row[place < MOST], place[place < MOST]] = patch[place < MOST]
    return meets, different > MOST, (edges.faces_around != 2) | (different != 1)


def straight_runs(ends: Ints, kind: Ints, position: Floats) -> Runs:
    """Trace edges through the nodes in which just two of one kind meet in a straight line."""
    node, end = meetings(ends, len(position))
    other = ends.ravel()[end ^ 1]
    arriving, leaving = position[node] - position[other[:, 0]], position[other[:, 1]] - position[node]
    off = np.linalg.norm(np.cross(arriving, leaving), axis=1)
    straight = np.arctan2(off, np.einsum("ij,ij->i", arriving, leaving)) <= TURN
    going = straight & (kind[end[:, 0] // 2] == kind[end[:, 1] // 2])
    through = np.full((len(position), 2), -1, dtype=np.int32)
    through[node[going]] = end[going] // 2
    return traced(ends, through)


def same_lines(point: Floats, axis: Floats, kind: Ints, position: Floats) -> Ints:
    """The pairs of lines of one kind that are the same, (k, 2)."""
    low, size = position.min(axis=0), np.ptp(position, axis=0).max()
    foot = (point - low) - axis * np.einsum("ij,ij->i", point - low, axis)[:, None]
    both_ways = np.einsum("ij,ik->ijk", axis, axis).reshape(len(axis), 9)
    return cKDTree(np.column_stack([foot / size, both_ways, kind])).query_pairs(SAME, output_type="ndarray")


def freedom_of(faces: Faces, patches: Patches, ridges: Ridges, pinned: Mask) -> Freedom:
    """What every node may do: those of one patch slide on it, those of one ridge along it, and corners stay."""
    nnodes, count = len(pinned), len(patches.shape)
    there = np.unique(faces.nodes.ravel() * np.int64(count) + np.repeat(patches.of_face, 3))
    node, patch = np.divmod(there, max(count, 1))
    different = np.bincount(node, minlength=nnodes)
    number, place = np.full(nnodes, INSIDE, dtype=np.int8), np.full(nnodes, -1, dtype=np.int32)
    number[node], place[node] = ON_PATCH, patch
    number[different > 1] = HELD
    number[ridges.ends] = HELD
    inner, end = meetings(ridges.ends, nnodes)
    one, other = ridges.of_edge[end // 2].T
    along = (one == other) & (one >= 0)
    along[along] = np.sum(ridges.meets[one[along]] >= 0, axis=1) == different[inner[along]]
    number[inner[along]], place[inner[along]] = ON_RIDGE, one[along]
    number[pinned] = HELD
    place[(number == HELD) | (number == INSIDE)] = -1
    return Freedom(number, place, pinned.copy())
