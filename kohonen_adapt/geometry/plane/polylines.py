"""Constrained facets of triangles, polylines of facets, and curve segments.

A facet is constrained if it lies on the outer boundary, between two regions, or on a named boundary.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Int8s, Int32s, Ints, IntsPair, Mask, counted
from kohonen_adapt.geometry.circles import rounded
from kohonen_adapt.geometry.plane.curves import Arc, Curves, check_near
from kohonen_adapt.geometry.plane.cutting import Part, as_complex, as_rows, cut_polyline
from kohonen_adapt.kernels.triangle.arrays import Elements
from kohonen_adapt.mesh.measures import angles_between
from kohonen_adapt.mesh.names import connected_components_of, marked_facets

__all__ = [
    "BY_MIDSIDES",
    "CORNER",
    "Facets",
    "Joints",
    "Polyline",
    "Polylines",
    "Segments",
    "circles_of",
    "constrained_facets",
    "continuations",
    "cut_into_segments",
    "joined_ends",
    "joints_of",
    "nodes_of",
    "polylines_of",
    "trace_facets",
    "trace_polylines",
    "turns_at",
]

BY_MIDSIDES = -2  # index of curve of a facet that is curved by its midside node, without a user-defined curve
CORNER = np.radians(35.0)  # an angle of this size or more is a corner


class Facets(NamedTuple):
    element: Ints  # (f,)
    corner: Ints  # (f,) local index of the corner opposite to the facet
    nodes: Ints  # (f, 2)
    label: Ints  # (f, 2) regions and names on both sides, seen along and against the facet
    sides: dict[str, Int8s]  # per boundary name (f,): 0, UNORIENTED, LEFT or RIGHT


class Joints(NamedTuple):
    node: Ints  # (j,)
    facets: Ints  # (j, 2)
    turn: Floats  # (j,) angle between the facets in radians
    smooth: Mask  # (j,) True if a curve may pass: same names and regions on both sides, no sharp turn


class Polyline(NamedTuple):
    """Open or closed polyline.

    A closed polyline continues from the last node to the first, which is not repeated.
    """

    nodes: Ints
    closed: bool


class Polylines(NamedTuple):
    node: Int32s  # (s,) in order, polyline after polyline; closed polylines repeat the first node at the end
    facet: Int32s  # (s,) facet after each node, -1 after the last node of a polyline
    start: Int32s  # (r + 1,) first slot of every polyline in `node` and `facet`
    closed: Mask  # (r,) True if the polyline is a loop without a corner

    @property
    def facet_of_each(self) -> Ints:
        return self.facet[self.start[:-1]]


class Segments(NamedTuple):
    """Curve segments into which polylines are cut.

    A slot is an index into ``Polylines.node``.
    """

    first: Ints  # (p,) slots of the first and last node
    last: Ints  # (p,)
    closed: Mask  # (p,)
    circle: Floats  # (p, 3) centre and radius of arcs, nan for others
    curve: Ints  # (p,) index of the user-defined curve, -1 for none, `BY_MIDSIDES` if curved by midside nodes
    widest: Floats  # (p,) largest angle of a facet in radians, for a part of an arc across junctions, nan for others

    @property
    def facets(self) -> Ints:
        return self.last - self.first

    @property
    def is_round(self) -> Mask:
        return ~np.isnan(self.circle[:, 2])

    @property
    def of_slot(self) -> Ints:
        return np.repeat(np.arange(len(self.first)), self.facets)

    @property
    def slots(self) -> Ints:
        return np.repeat(self.first, self.facets) + counted(self.facets)

    def select(self, rows: Ints | Mask) -> "Segments":
        return Segments._make(array[rows] for array in self)


def constrained_facets(mesh: MeshTri, elements: Elements) -> Facets:
    e, k, _, label, sides = marked_facets(mesh, elements)
    return Facets(e, k, np.stack(elements.ends(e, k), axis=1), label, sides)


def joints_of(facets: Facets, position: Floats, cornerless: Mask, offset: Floats | float = 0.0) -> Joints:
    """Return the joints, the nodes in which exactly two facets meet.

    Facets of the mask `cornerless`, shape (f,), join smoothly at any angle. `offset`, shape (f, 2), is the midside
    offset, with which the turn is the angle between parabolas.
    """
    node, ends = joined_ends(facets.nodes, len(position))
    # the path arrives along the first facet and leaves along the second, so labels may be reversed
    before, after = (facets.label[end // 2, (end + arrives) % 2] for arrives, end in ((1, ends[:, 0]), (0, ends[:, 1])))
    curve = np.broadcast_to(4.0 * offset, facets.nodes.shape)
    turn = turns_at(ends, position[facets.nodes[:, ::-1]] - position[facets.nodes] + curve[:, None])
    smooth = (turn < CORNER) | np.all(cornerless[ends // 2], axis=1)
    return Joints(node, ends // 2, turn, (before == after) & smooth)


def trace_facets(facets: Facets, joints: Joints, stops: Mask) -> Polylines:
    return trace_polylines(facets.nodes, joints.node, joints.facets, joints.smooth & ~stops[joints.node])


def continuations(edges: Ints, position: Floats, stops: Mask, sharpest: float) -> IntsPair:
    # Edges continue each other with the smallest turn below `sharpest`, also where more edges end, but not at nodes of
    # the mask `stops`, shape (n,). Returns the ends (m, 2) of the edges as new numbers, equal only where two edges
    # continue each other, and the node of every number.
    flat, number = edges.ravel(), np.arange(edges.size)
    order = np.argsort(flat, kind="stable")
    order = order[~stops[flat[order]]]
    found = [np.empty((0, 2), np.int64)]
    shift = 1
    while shift < len(order) and np.any(same := flat[order[shift:]] == flat[order[:-shift]]):
        found.append(np.stack([order[:-shift][same], order[shift:][same]], axis=1))
        shift += 1
    pairs = np.concatenate(found)
    turn = turns_at(pairs, position[edges[:, ::-1]] - position[edges])
    free = np.ones(len(flat), bool)
    for one, other in pairs[np.argsort(turn, kind="stable")][: np.sum(turn < sharpest)].tolist():
        if free[one] and free[other]:
            free[[one, other]], number[other] = False, one
    used, ends = np.unique(number, return_inverse=True)
    return ends.reshape(-1, 2), flat[used]


def polylines_of(edges: Ints, position: Floats) -> list[Polyline]:
    """Join edges into polylines that end at corners of 35 degrees or more.

    `edges`, shape (m, 2), are the end nodes of one edge or more, no edge twice. With a midside node between
    the ends, shape (m, 3), or several, the angle is measured between the polynomials through the nodes. `position` has
    shape (2, n).
    Polylines also end where other than two edges meet. Loops without a corner are closed.
    """
    end, count = edges[:, [0, -1]], edges.shape[1]
    slope = np.linalg.inv(np.vander(np.linspace(0.0, 1.0, count), increasing=True))[1]
    directions = np.stack([position[:, edges] @ slope, position[:, edges[:, ::-1]] @ slope])
    joint, ends = joined_ends(end, position.shape[1])
    smooth = turns_at(ends, directions.transpose(2, 0, 1)) < CORNER
    node, edge, start, closed = trace_polylines(end, joint, ends // 2, smooth)
    forth = end[edge, 0] == node  # the edge after the last node of a polyline is -1
    polylines = []
    for first, last, loop in zip(start[:-1], start[1:] - 1, closed, strict=True):
        along = edges[edge[first:last]]
        along = np.where(forth[first:last, None], along, along[:, ::-1])
        nodes = along[:, :-1].ravel()
        polylines.append(Polyline(nodes if loop else np.append(nodes, node[last]), bool(loop)))
    return polylines


def trace_polylines(ends: Ints, node: Ints, edges: Ints, smooth: Mask) -> Polylines:
    """Trace polylines along edges with the ends (m, 2).

    The pairs of `edges`, shape (j, 2), join at nodes, shape (j,), if `smooth`. Polylines end at all other nodes.
    Direction 2 f + s of edge f starts at its end s. Among the starts of a loop and the two directions of an open
    polyline, the lowest number is chosen.
    """
    through = np.full((int(ends.max(initial=-1)) + 1, 2), -1, np.int32)
    through[node[smooth]] = edges[smooth]
    begin, end = ends.ravel(), ends[:, ::-1].ravel()
    direction = np.arange(len(begin))
    is_end = through[begin, 0] < 0
    # the edge before, and its direction that ends here
    back = np.where(is_end, direction // 2, through[begin].sum(axis=1) - direction // 2)
    before = np.where(is_end, direction, 2 * back + (ends[back, 1] != begin))
    polyline = connected_components_of(len(direction), np.stack([direction, before], axis=1))
    closed = np.bincount(polyline, before == direction) == 0
    first = np.full(len(closed), len(direction))
    np.minimum.at(first, polyline, np.where(closed[polyline] | (before == direction), direction, len(direction)))
    before[first], rank = first, (direction != first[polyline]).astype(np.int64)
    while np.any(before != before[before]):  # twice as far back in every iteration
        rank = rank + rank[before]
        before = before[before]
    reverse = polyline[direction ^ 1]  # the same polyline in the other direction
    chosen = np.flatnonzero(first[polyline] <= first[reverse])
    start = first[polyline[chosen]]
    order = chosen[np.lexsort((rank[chosen], start, closed[polyline[chosen]]))]
    last = np.append(np.diff(polyline[order]) != 0, True)[: len(order)]
    count = np.flatnonzero(last) + 1
    slots = np.append(0, count + np.arange(1, len(count) + 1))
    nodes, facets = np.insert(begin[order], count, end[order[last]]), np.insert(order // 2, count, -1)
    loops = closed[polyline[order[last]]]
    return Polylines(nodes.astype(np.int32), facets.astype(np.int32), slots.astype(np.int32), loops)


def cut_into_segments(
    position: Floats, polylines: Polylines, curve: Ints, curves: Curves, circle_of_facet: Floats
) -> tuple[Polylines, Segments]:
    # Facets with a curve index other than -1 are not cut. The first columns of `circle_of_facet`, shape (f, 4), are
    # the circles of facets with the index `BY_MIDSIDES`, nan for none.
    z, node, facet, parts = as_complex(position), polylines.node.copy(), polylines.facet.copy(), list[Part]()
    is_whole, loops = (curve[polylines.facet_of_each] != -1).tolist(), polylines.closed.tolist()
    for (begin, end), whole, closed in zip(pairwise(polylines.start.tolist()), is_whole, loops, strict=True):
        last = end - begin - 1
        shift = 0
        own = [Part(0, last, closed=closed)]
        if not whole and last > 1:
            own, shift = cut_polyline(z[node[begin:end]], closed)
        elif not closed and node[begin] == node[end - 1]:  # a loop with a corner: a segment needs two end nodes
            own = [Part(0, last // 2), Part(last // 2, last)]
        if shift:
            for array in (node, facet):
                array[begin : end - 1] = np.roll(array[begin : end - 1], -shift)
            node[end - 1] = node[begin]
        parts += [part._replace(first=begin + part.first, last=begin + part.last) for part in own]
    rows = [(part.first, part.last, part.closed) for part in parts]
    first, last, is_closed = np.array(rows, np.int64).reshape(-1, 3).T
    circle, widest = circles_of(parts), np.full(len(parts), np.nan)
    segments = Segments(first, last, is_closed == 1, circle, curve[facet[first]], widest)
    on_arc = segments.curve == BY_MIDSIDES
    segments.circle[on_arc] = circle_of_facet[facet[first[on_arc]], :3]
    for p in np.flatnonzero(segments.curve >= 0).tolist():
        name, shape = list(curves.items())[segments.curve[p]]
        check_near(nodes_of(position, node, segments, p), shape, name)
        if isinstance(shape, Arc):
            segments.circle[p] = *shape.centre, shape.radius
    return polylines._replace(node=node, facet=facet), segments


def circles_of(parts: Sequence[Part]) -> Floats:
    # (p, 3) centre and radius, nan for parts that are straight
    found = np.full((len(parts), 3), np.nan)
    for p, part in enumerate(parts):
        if part.circle:
            found[p] = rounded(np.append(as_rows(part.circle.centre), part.circle.radius), part.circle.radius)
    return found


def nodes_of(position: Floats, node: Ints, segments: Segments, p: int) -> Floats:
    return position[node[segments.first[p] : segments.last[p] + 1]]


def joined_ends(ends: Ints, nnodes: int) -> IntsPair:
    """Return the nodes (j,) in which exactly two edges end, and the ends (j, 2).

    Ends of edge k have the indices 2 k and 2 k + 1.
    """
    flat = ends.ravel()
    order, count = np.argsort(flat, kind="stable"), np.bincount(flat, minlength=nnodes)
    node = np.flatnonzero(count == 2)
    first = (np.cumsum(count) - count)[node]
    return node, np.stack([order[first], order[first + 1]], axis=1)


def turns_at(ends: Ints, directions: Floats) -> Floats:
    """Return the angles between edges that join at `ends`, shape (j, 2).

    `directions`, shape (m, 2, d), lead from both ends into the edges.
    """
    one, other = directions.reshape(-1, directions.shape[2])[ends.T].swapaxes(1, 2)
    return angles_between(one, -other)
