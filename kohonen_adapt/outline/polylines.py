"""Tracing of polylines along facets, and their division into curve segments."""

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

BITS = 43  # bits kept of centres and radii of recognised circles
TOLD = -2  # index of curve of a facet that is curved by its midside node, without a user-defined curve
CORNER = np.radians(35.0)  # an angle of this size or more is a corner


class Polyline(NamedTuple):
    """Open or closed polyline.

    A closed polyline continues from the last node to the first, which is not repeated.
    """

    nodes: Ints
    closed: bool


class Runs(NamedTuple):
    """Open or closed polylines of facets."""

    node: NDArray[np.int32]  # (s,) in order, polyline after polyline; closed polylines repeat the first node at the end
    facet: NDArray[np.int32]  # (s,) facet after each node, -1 after the last node of a polyline
    start: NDArray[np.int32]  # (r + 1,) first slot of every polyline in `node` and `facet`
    closed: Mask  # (r,) True if the polyline is a loop without a corner


class Pieces(NamedTuple):
    """Curve segments into which polylines are cut.

    A slot is an index into ``Runs.node``.
    """

    rows: Ints  # (p, 4) slots of the first and last node, 1 if an arc, 1 if closed
    circle: Floats  # (p, 3) centre and radius of arcs
    curve: Ints  # (p,) index of the user-defined curve, -1 for none, `TOLD` if curved by midside nodes

    @property
    def first(self) -> Ints:
        return self.rows[:, FIRST]

    @property
    def last(self) -> Ints:
        return self.rows[:, LAST]

    @property
    def facets(self) -> Ints:
        return self.last - self.first

    @property
    def is_round(self) -> Mask:
        return self.rows[:, IS_ROUND] == 1

    @property
    def closed(self) -> Mask:
        return self.rows[:, IS_CLOSED] == 1

    @property
    def of_slot(self) -> Ints:
        return np.repeat(np.arange(len(self.rows)), self.facets)

    @property
    def slots(self) -> Ints:
        """Slots of the first nodes of all facets, segment by segment."""
        count = self.facets
        return np.arange(count.sum()) + np.repeat(self.first - np.cumsum(count) + count, count)


def polylines_of(segments: Ints, position: Floats) -> list[Polyline]:
    """Join segments into polylines that end at corners of 35 degrees or more.

    `segments`, shape (m, 2), are the end nodes of one segment or more, no segment twice. With a midside node between
    the ends, shape (m, 3), the angle is measured between the parabolas through the nodes. `position` has shape (2, n).
    Polylines also end where other than two segments meet. Loops without a corner are closed.
    """
    end = segments[:, [0, -1]]
    node, segment, start, closed = traced(end, _smooth(segments, position))
    forth = end[segment, 0] == node  # the segment after the last node of a polyline is -1
    polylines = []
    for first, last, loop in zip(start[:-1], start[1:] - 1, closed, strict=True):
        along = segments[segment[first:last]]
        along = np.where(forth[first:last, None], along, along[:, ::-1])
        nodes = along[:, :-1].ravel()
        polylines.append(Polyline(nodes if loop else np.append(nodes, node[last]), bool(loop)))
    return polylines


def traced(ends: Ints, through: Ints) -> Runs:
    """Trace polylines along segments with the ends (m, 2).

    `through`, shape (n, 2), holds the two segments that join smoothly at a node, -1 at nodes where polylines end.
    Direction 2 f + s of segment f starts at its end s. Among the starts of a loop and the two directions of an open
    polyline, the lowest number is chosen.
    """
    begin, end = ends.ravel(), ends[:, ::-1].ravel()
    way = np.arange(len(begin))
    back = np.where(through[begin, 0] < 0, way // 2, through[begin].sum(axis=1) - way // 2)  # the segment before
    before = np.where(ends[back, 1] == begin, 2 * back, 2 * back + 1)  # the direction that ends here
    before = np.where(through[begin, 0] < 0, way, before)
    run = connected_components(coo_array((np.ones(len(way)), (way, before)), shape=(len(way),) * 2), directed=False)[1]
    closed = np.bincount(run, before == way) == 0
    first = np.full(len(closed), len(way))
    np.minimum.at(first, run, np.where(closed[run] | (before == way), way, len(way)))
    before[first], place = first, (way != first[run]).astype(np.int64)
    while np.any(before != before[before]):  # twice as far back in every iteration
        place, before = place + place[before], before[before]
    twin = run[way ^ 1]  # the same polyline in the other direction
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
    """Cut polylines into curve segments.

    Facets with the curve index `TOLD` are not cut; `told`, shape (f, 3), are their circles, nan for none.
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
    """Return circles (p, 3) rounded to about 1e-13 of their radius."""
    step = np.ldexp(1.0, np.frexp(circle[:, 2:])[1] - BITS)
    return np.round(circle / step) * step + 0.0  # no -0


def nodes_of(position: Floats, node: Ints, pieces: Pieces, p: int) -> Floats:
    return position[node[pieces.first[p] : pieces.last[p] + 1]]


def meetings(ends: Ints, nnodes: int) -> tuple[Ints, Ints]:
    """Return the nodes (j,) in which exactly two segments end, and the ends (j, 2).

    Ends of segment k have the indices 2 k and 2 k + 1.
    """
    flat = ends.ravel()
    order, count = np.argsort(flat, kind="stable"), np.bincount(flat, minlength=nnodes)
    node = np.flatnonzero(count == 2)
    first = (np.cumsum(count) - count)[node]
    return node, np.stack([order[first], order[first + 1]], axis=1)


def turns(u: Floats, w: Floats) -> Floats:
    return np.abs(np.arctan2(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0], -np.sum(u * w, axis=1)))


def _smooth(segments: Ints, position: Floats) -> Ints:
    node, end = meetings(segments[:, [0, -1]], position.shape[1])
    way = _directions(segments, position)
    smooth = turns(way[end[:, 0]], way[end[:, 1]]) < CORNER
    through = np.full((position.shape[1], 2), -1, dtype=np.int32)
    through[node[smooth]] = end[smooth] // 2
    return through


def _directions(segments: Ints, position: Floats) -> Floats:
    start, end = position[:, segments[:, 0]], position[:, segments[:, -1]]
    middle = position[:, segments[:, 1]] if segments.shape[1] == 3 else 0.5 * (start + end)
    forth, back = 4.0 * (middle - start) - (end - start), 4.0 * (middle - end) - (start - end)
    return np.stack([forth, back], axis=2).reshape(2, -1).T
