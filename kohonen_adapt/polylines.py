"""Segments in any order joined to polylines, from corner to corner or round a loop."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

__all__ = ["Polyline", "polylines_of"]

CORNER = np.radians(35.0)  # a turn as large as this, or larger, is a corner

Indices = NDArray[np.integer]
Floats = NDArray[np.float64]


class Polyline(NamedTuple):
    """Nodes in order; a closed one goes on from the last to the first, which is not repeated."""

    nodes: Indices
    closed: bool


def polylines_of(segments: Indices, position: Floats) -> list[Polyline]:
    """Join segments that meet two by two, cut where they turn by 35 degrees or more.

    Parameters
    ----------
    segments
        (m, 2) nodes at the ends, at least one segment and none twice; or (m, 3) with a node of the segment between
        them. The turn where two such segments meet is that of the parabolas through their nodes.
    position
        (2, n): where the nodes are.

    Returns
    -------
    list of Polyline
        Loops without a corner are closed. A loop with one corner starts and ends there.
    """
    one, other = _joints(segments, position)
    opened = _openings(one // 2, other // 2, len(segments))
    # A vertex is an end of segments that go on there, or a middle, and so has one or two neighbours.
    half = np.arange(2 * len(segments))
    half[other[~opened]] = one[~opened]
    middles = np.arange(len(half), segments.size).reshape(len(segments), -1)
    path = np.column_stack([half[0::2], middles, half[1::2]])
    vertex, first, number = np.unique(path, return_index=True, return_inverse=True)
    rank, piece = _ranks(number.reshape(path.shape), len(vertex))
    order = np.lexsort((rank, piece))
    closed = np.zeros(piece.max() + 1, dtype=bool)
    closed[piece[np.isin(vertex, one[opened])]] = True
    parts = np.split(segments.ravel()[first[order]], np.flatnonzero(np.diff(piece[order])) + 1)
    return [Polyline(nodes[:-1] if loop else nodes, bool(loop)) for nodes, loop in zip(parts, closed, strict=True)]


def _joints(segments: Indices, position: Floats) -> tuple[Indices, Indices]:
    """The two halves at every node in which just two segments meet without a corner, in the order of the nodes.

    Half 2 s is the beginning of segment s, half 2 s + 1 its end.
    """
    end = segments[:, [0, -1]].ravel()
    order = np.argsort(end, kind="stable")
    count = np.unique(end, return_counts=True)[1]
    first = (np.cumsum(count) - count)[count == 2]
    one, other = order[first], order[first + 1]
    x, y = _directions(segments, position)
    cross = x[one] * y[other] - y[one] * x[other]
    turn = np.abs(np.arctan2(cross, -(x[one] * x[other] + y[one] * y[other])))
    return one[turn < CORNER], other[turn < CORNER]


def _directions(segments: Indices, position: Floats) -> Floats:
    """Where every half leaves its end for, (2, 2 m): along the segment, or the parabola through its three nodes."""
    start, end = position[:, segments[:, 0]], position[:, segments[:, -1]]
    middle = position[:, segments[:, 1]] if segments.shape[1] == 3 else 0.5 * (start + end)
    forth, back = 4.0 * (middle - start) - (end - start), 4.0 * (middle - end) - (start - end)
    return np.stack([forth, back], axis=2).reshape(2, -1)


def _openings(one: Indices, other: Indices, count: int) -> NDArray[np.bool_]:
    """Which joints to open so that no loop of segments is left, (j,): the first of each loop."""
    piece = _components(one, other, count)
    loop = np.bincount(piece[one], minlength=count) == np.bincount(piece, minlength=count)
    first = np.zeros(len(one), dtype=bool)
    first[np.unique(piece[one], return_index=True)[1]] = True
    return first & loop[piece[one]]


def _ranks(path: Indices, count: int) -> tuple[Floats, Indices]:
    """How many steps every vertex is from the beginning of its piece, and which that is; rows of `path` are walks."""
    a, b = path[:, :-1].ravel(), path[:, 1:].ravel()
    piece = _components(a, b, count)
    ends = np.flatnonzero(np.bincount(np.concatenate([a, b]), minlength=count) == 1)
    begin = ends[np.unique(piece[ends], return_index=True)[1]]
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(count, count)).tocsr()
    return dijkstra(graph, directed=False, indices=begin, unweighted=True, min_only=True), piece


def _components(a: Indices, b: Indices, count: int) -> Indices:
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1]
