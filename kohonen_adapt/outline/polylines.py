"""Join segments in any order to polylines, from corner to corner or round a loop."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.triangle.trace import trace_runs

__all__ = ["CORNER", "Polyline", "Runs", "meetings", "polylines_of", "traced", "turns"]

CORNER = np.radians(35.0)  # a turn as large as this, or larger, is a corner


class Polyline(NamedTuple):
    """Nodes in order; a closed one goes on from the last to the first, which is not repeated."""

    nodes: Ints
    closed: bool


class Runs(NamedTuple):
    """Segments that go on into one another, from end to end or all round; `trace_runs` describes the arrays."""

    node: NDArray[np.int32]  # (s,)
    facet: NDArray[np.int32]  # (s,) the segment after each node, -1 after the last of a run
    start: NDArray[np.int32]  # (r + 1,)
    closed: Mask  # (r,)


def polylines_of(segments: Ints, position: Floats) -> list[Polyline]:
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
    end = segments[:, [0, -1]]
    node, segment, start, closed = traced(end, _smooth(segments, position))
    forth = end[segment, 0] == node  # of the last of a run the segment is -1
    polylines = []
    for first, last, loop in zip(start[:-1], start[1:] - 1, closed, strict=True):
        along = segments[segment[first:last]]
        along = np.where(forth[first:last, None], along, along[:, ::-1])
        nodes = along[:, :-1].ravel()
        polylines.append(Polyline(nodes if loop else np.append(nodes, node[last]), bool(loop)))
    return polylines


def traced(ends: Ints, through: Ints) -> Runs:
    """Trace segments with the ends (m, 2) where `through` (n, 2) has two that go on into one another."""
    count = len(ends)
    node, facet = (np.empty(2 * count, dtype=np.int32) for _ in range(2))
    start, closed = np.zeros(count + 1, dtype=np.int32), np.zeros(count, dtype=np.bool_)
    runs = trace_runs(ends.astype(np.int32), through, node, facet, start, closed)
    slots = start[runs]
    return Runs(node[:slots], facet[:slots], start[: runs + 1], closed[:runs])


def meetings(ends: Ints, nnodes: int) -> tuple[Ints, Ints]:
    """The nodes (j,) in which just two segments end, and which ends these are, (j, 2): 2 k and 2 k + 1 of segment k."""
    flat = ends.ravel()
    order, count = np.argsort(flat, kind="stable"), np.bincount(flat, minlength=nnodes)
    node = np.flatnonzero(count == 2)
    first = (np.cumsum(count) - count)[node]
    return node, np.stack([order[first], order[first + 1]], axis=1)


def turns(u: Floats, w: Floats) -> Floats:
    """By how much a way turns that comes along -u and goes on along w, (j,) for (j, 2), in radians."""
    return np.abs(np.arctan2(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0], -np.sum(u * w, axis=1)))


def _smooth(segments: Ints, position: Floats) -> Ints:
    """The two segments of which one goes on into the other at a node, (n, 2); -1 at ends and corners."""
    node, end = meetings(segments[:, [0, -1]], position.shape[1])
    way = _directions(segments, position)
    smooth = turns(way[end[:, 0]], way[end[:, 1]]) < CORNER
    through = np.full((position.shape[1], 2), -1, dtype=np.int32)
    through[node[smooth]] = end[smooth] // 2
    return through


def _directions(segments: Ints, position: Floats) -> Floats:
    """Directions in which segments leave their ends, (2 m, 2); with three nodes those of the parabola through them."""
    start, end = position[:, segments[:, 0]], position[:, segments[:, -1]]
    middle = position[:, segments[:, 1]] if segments.shape[1] == 3 else 0.5 * (start + end)
    forth, back = 4.0 * (middle - start) - (end - start), 4.0 * (middle - end) - (start - end)
    return np.stack([forth, back], axis=2).reshape(2, -1).T
