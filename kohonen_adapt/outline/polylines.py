"""Join segments to runs from corner to corner or round a loop, and cut those into straight pieces and arcs."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import FIRST, IS_CLOSED, IS_ROUND, LAST
from kohonen_adapt.outline.curves import Arc, Curve, check_near
from kohonen_adapt.outline.cutting import cut_runs

__all__ = [
    "CORNER",
    "TOLD",
    "Pieces",
    "Polyline",
    "Runs",
    "cut",
    "meetings",
    "nodes_of",
    "polylines_of",
    "traced",
    "turns",
    "without_noise",
]

BITS = 43  # of centres and radii of recognised circles
TOLD = -2  # in place of the number of a given curve: what the facet is on is told by its mid-side node
CORNER = np.radians(35.0)  # a turn as large as this, or larger, is a corner


class Polyline(NamedTuple):
    """Nodes in order; a closed one goes on from the last to the first, which is not repeated."""

    nodes: Ints
    closed: bool


class Runs(NamedTuple):
    """Segments that go on into one another, from end to end or all round."""

    node: NDArray[np.int32]  # (s,) in order, run after run; a closed run begins and ends with the same node
    facet: NDArray[np.int32]  # (s,) the segment after each node, -1 after the last of a run
    start: NDArray[np.int32]  # (r + 1,) where the runs begin in those
    closed: Mask  # (r,) whether it goes on from its last node


class Pieces(NamedTuple):
    """What the runs were cut into, a row for each piece."""

    rows: Ints  # (p, 4): slots of the first and the last node, whether it is round, whether it is closed
    circle: Floats  # (p, 3): centre and radius of round ones
    curve: Ints  # (p,): which of the given curves it is on, -1 for none, TOLD for what mid-side nodes tell

    @property
    def first(self) -> Ints:
        """Slots of the first nodes, (p,)."""
        return self.rows[:, FIRST]

    @property
    def last(self) -> Ints:
        """Slots of the last nodes, (p,)."""
        return self.rows[:, LAST]

    @property
    def facets(self) -> Ints:
        """Numbers of facets, (p,)."""
        return self.last - self.first

    @property
    def is_round(self) -> Mask:
        """Which are arcs or circles, (p,)."""
        return self.rows[:, IS_ROUND] == 1

    @property
    def closed(self) -> Mask:
        """Which are closed, (p,)."""
        return self.rows[:, IS_CLOSED] == 1

    @property
    def of_slot(self) -> Ints:
        """The piece of the facet after every slot, for the slots of pieces one after another."""
        return np.repeat(np.arange(len(self.rows)), self.facets)

    @property
    def slots(self) -> Ints:
        """The slots of the first nodes of all facets, piece by piece."""
        count = self.facets
        return np.arange(count.sum()) + np.repeat(self.first - np.cumsum(count) + count, count)


def polylines_of(segments: Ints, position: Floats) -> list[Polyline]:
    """Join segments that meet two by two, cut where they turn by 35 degrees or more.

    `segments` are the nodes at the ends, (m, 2), at least one segment and none twice; or (m, 3) with a node of the
    segment between them, and the turn is that of the parabolas through these. `position` (2, n) is where nodes are.
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
    """Trace segments with the ends (m, 2) from node to node.

    `through` (n, 2) has the two that go on into one another at a node, -1 where runs end. Way 2 f + s along segment f
    begins at its end s; of the ways round a loop, and of the two along an open run, the first in number is taken.
    """
    begin, end = ends.ravel(), ends[:, ::-1].ravel()
    way = np.arange(len(begin))
    back = np.where(through[begin, 0] < 0, way // 2, through[begin].sum(axis=1) - way // 2)  # the segment before
    before = np.where(ends[back, 1] == begin, 2 * back, 2 * back + 1)  # along it to where this one begins
    before = np.where(through[begin, 0] < 0, way, before)
    run = connected_components(coo_array((np.ones(len(way)), (way, before)), shape=(len(way),) * 2), directed=False)[1]
    closed = np.bincount(run, before == way) == 0
    first = np.full(len(closed), len(way))
    np.minimum.at(first, run, np.where(closed[run] | (before == way), way, len(way)))
    before[first], place = first, (way != first[run]).astype(np.int64)
    while np.any(before != before[before]):  # twice as far back each time
        place, before = place + place[before], before[before]
    twin = run[way ^ 1]  # the same run the other way round
    chosen = np.flatnonzero(first[run] <= first[twin])
    start = first[run[chosen]]
    order = chosen[np.lexsort((place[chosen], start, closed[run[chosen]]))]
    last = np.append(np.diff(run[order]) != 0, True)[: len(order)]
    count = np.flatnonzero(last) + 1
    node, facet = (
        np.insert(array, count, extra) for array, extra in ((begin[order], end[order[last]]), (order // 2, -1))
    )
    slots = np.append(0, count + np.arange(1, len(count) + 1))
    return Runs(node.astype(np.int32), facet.astype(np.int32), slots.astype(np.int32), closed[run[order[last]]])


def cut(position: Floats, runs: Runs, curve: Ints, curves: Mapping[str, Curve], told: Floats) -> tuple[Runs, Pieces]:
    """Cut runs into pieces; closed runs may begin elsewhere afterwards. `curve` (f,) is that of every facet.

    Those that are told by mid-side nodes are not cut; `told` (f, 3) are their circles, nan for what is no arc. Nodes
    that are not near the curve given for their boundary are refused.
    """
    node, facet = runs.node.copy(), runs.facet.copy()
    of_run = curve[facet[runs.start[:-1]]]
    most = len(facet) + len(of_run)
    rows, circle = np.zeros((most, 4), dtype=np.int64), np.zeros((most, 3))
    count = cut_runs(position, node, facet, runs.start, runs.closed, of_run != -1, rows, circle)
    first = facet[rows[:count, FIRST]]
    pieces = Pieces(rows[:count], without_noise(circle[:count]), curve[first])
    on_arc = ~np.isnan(told[first, 0])
    pieces.rows[on_arc, IS_ROUND], pieces.circle[on_arc] = 1, told[first[on_arc]]
    for p in np.flatnonzero(pieces.curve >= 0).tolist():
        name, given = list(curves.items())[pieces.curve[p]]
        check_near(nodes_of(position, node, pieces, p), given, name)
        if isinstance(given, Arc):
            pieces.rows[p, IS_ROUND], pieces.circle[p] = 1, (*given.centre, given.radius)
    return runs._replace(node=node, facet=facet), pieces


def without_noise(circle: Floats) -> Floats:
    """Circles (p, 3) rounded to some 1e-13 of their radius: however often nodes slide, the same is recognised again."""
    step = np.ldexp(1.0, np.frexp(circle[:, 2:])[1] - BITS)
    return np.round(circle / step) * step + 0.0  # no -0


def nodes_of(position: Floats, node: Ints, pieces: Pieces, p: int) -> Floats:
    """Where the nodes of a piece are, in order, (k, 2)."""
    return position[node[pieces.first[p] : pieces.last[p] + 1]]


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
