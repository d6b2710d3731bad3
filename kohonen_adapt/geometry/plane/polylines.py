"""Constrained facets of triangles, polylines of facets, and curve segments.

A facet is constrained if it lies on the outer boundary, between two regions, or on a named boundary.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.curves import Arc, Curve, check_near
from kohonen_adapt.geometry.plane.cutting import FIRST, IS_CLOSED, IS_ROUND, LAST, cut_polylines
from kohonen_adapt.kernels.triangle.arrays import Elements
from kohonen_adapt.mesh.names import marked_facets

__all__ = [
    "BY_MIDSIDES",
    "CORNER",
    "Facets",
    "Joints",
    "Polyline",
    "Polylines",
    "Segments",
    "angles_between",
    "constrained_facets",
    "continuations",
    "cut_into_segments",
    "joined_ends",
    "joints_of",
    "nodes_of",
    "polylines_of",
    "trace_facets",
    "trace_polylines",
    "without_noise",
]

BITS = 43  # bits kept of centres and radii of recognised circles
BY_MIDSIDES = -2  # index of curve of a facet that is curved by its midside node, without a user-defined curve
CORNER = np.radians(35.0)  # an angle of this size or more is a corner


class Facets(NamedTuple):
    element: Ints  # (f,)
    corner: Ints  # (f,) local index of the corner opposite to the facet
    nodes: Ints  # (f, 2)
    label: Ints  # (f, 2) regions and names on both sides, seen along and against the facet
    sides: dict[str, NDArray[np.int8]]  # per boundary name (f,): 0, UNORIENTED, LEFT or RIGHT


class Joints(NamedTuple):
    node: Ints  # (j,)
    facets: Ints  # (j, 2)
    ends: Ints  # (j, 2) other nodes of the facets
    turn: Floats  # (j,) angle between the facets in radians
    smooth: Mask  # (j,) True if a curve may pass: same names and regions on both sides, no sharp turn


class Polyline(NamedTuple):
    """Open or closed polyline.

    A closed polyline continues from the last node to the first, which is not repeated.
    """

    nodes: Ints
    closed: bool


class Polylines(NamedTuple):
    node: NDArray[np.int32]  # (s,) in order, polyline after polyline; closed polylines repeat the first node at the end
    facet: NDArray[np.int32]  # (s,) facet after each node, -1 after the last node of a polyline
    start: NDArray[np.int32]  # (r + 1,) first slot of every polyline in `node` and `facet`
    closed: Mask  # (r,) True if the polyline is a loop without a corner


class Segments(NamedTuple):
    """Curve segments into which polylines are cut.

    A slot is an index into ``Polylines.node``.
    """

    rows: Ints  # (p, 4) slots of the first and last node, 1 if an arc, 1 if closed
    circle: Floats  # (p, 3) centre and radius of arcs
    curve: Ints  # (p,) index of the user-defined curve, -1 for none, `BY_MIDSIDES` if curved by midside nodes
    widest: Floats  # (p,) largest angle of a facet in radians, for a part of an arc across junctions, nan for others

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
        count = self.facets
        return np.arange(count.sum()) + np.repeat(self.first - np.cumsum(count) + count, count)


def constrained_facets(mesh: MeshTri, elements: Elements) -> Facets:
    e, k, _, label, sides = marked_facets(mesh, elements)
    return Facets(e, k, np.stack(elements.ends(e, k), axis=1), label, sides)


def joints_of(facets: Facets, position: Floats, cornerless: Mask, offset: Floats | float = 0.0) -> Joints:
    """Return the joints, the nodes in which exactly two facets meet.

    Facets of the mask `cornerless`, shape (f,), join smoothly at any angle. `offset`, shape (f, 2), is the midside
    offset, with which the turn is the angle between parabolas.
    """
    node, rows = joined_ends(facets.nodes, len(position))
    other = facets.nodes.ravel()[rows ^ 1]
    # the path arrives along the first facet and leaves along the second, so labels may be reversed
    before, after = facets.label[rows[:, 0] // 2, 1 - rows[:, 0] % 2], facets.label[rows[:, 1] // 2, rows[:, 1] % 2]
    tangent_change = np.broadcast_to(4.0 * offset, facets.nodes.shape)
    turn = angles_between(
        *(position[other[:, side]] - position[node] + tangent_change[rows[:, side] // 2] for side in (0, 1))
    )
    smooth = (turn < CORNER) | np.all(cornerless[rows // 2], axis=1)
    return Joints(node, rows // 2, other, turn, (before == after) & smooth)


def trace_facets(facets: Facets, joints: Joints, stops: Mask) -> Polylines:
    through = np.full((len(stops), 2), -1, dtype=np.int32)
    continuing = joints.smooth & ~stops[joints.node]
    through[joints.node[continuing]] = joints.facets[continuing]
    return trace_polylines(facets.nodes, through)


def continuations(edges: Ints, position: Floats, stops: Mask, sharpest: float) -> tuple[Ints, Ints]:
    # Edges continue each other with the smallest turn below `sharpest`, also where more edges end, but not at nodes of
    # the mask `stops`, shape (n,). Returns the ends (m, 2) of the edges as new numbers, equal only where two edges
    # continue each other, and the node of every number.
    flat, number = edges.ravel(), np.arange(edges.size)
    direction = position[edges[:, ::-1].ravel()] - position[flat]
    order = np.argsort(flat, kind="stable")
    order = order[~stops[flat[order]]]
    found, shift = [np.empty((0, 2), dtype=np.int64)], 1
    while shift < len(order) and np.any(same := flat[order[shift:]] == flat[order[:-shift]]):
        found.append(np.stack([order[:-shift][same], order[shift:][same]], axis=1))
        shift += 1
    pairs = np.concatenate(found)
    turn = angles_between(direction[pairs[:, 0]], direction[pairs[:, 1]])
    free = np.ones(len(flat), dtype=bool)
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
    end = edges[:, [0, -1]]
    node, edge, start, closed = trace_polylines(end, _smooth(edges, position))
    forth = end[edge, 0] == node  # the edge after the last node of a polyline is -1
    polylines = []
    for first, last, loop in zip(start[:-1], start[1:] - 1, closed, strict=True):
        along = edges[edge[first:last]]
        along = np.where(forth[first:last, None], along, along[:, ::-1])
        nodes = along[:, :-1].ravel()
        polylines.append(Polyline(nodes if loop else np.append(nodes, node[last]), bool(loop)))
    return polylines


def trace_polylines(ends: Ints, through: Ints) -> Polylines:
    """Trace polylines along edges with the ends (m, 2).

    `through`, shape (n, 2), holds the two edges that join smoothly at a node, -1 at nodes where polylines end.
    Direction 2 f + s of edge f starts at its end s. Among the starts of a loop and the two directions of an open
    polyline, the lowest number is chosen.
    """
    begin, end = ends.ravel(), ends[:, ::-1].ravel()
    direction = np.arange(len(begin))
    # the edge before, and its direction that ends here
    back = np.where(through[begin, 0] < 0, direction // 2, through[begin].sum(axis=1) - direction // 2)
    before = np.where(ends[back, 1] == begin, 2 * back, 2 * back + 1)
    before = np.where(through[begin, 0] < 0, direction, before)
    graph = coo_array((np.ones(len(direction)), (direction, before)), shape=(len(direction),) * 2)
    polyline = connected_components(graph, directed=False)[1]
    closed = np.bincount(polyline, before == direction) == 0
    first = np.full(len(closed), len(direction))
    np.minimum.at(first, polyline, np.where(closed[polyline] | (before == direction), direction, len(direction)))
    before[first], rank = first, (direction != first[polyline]).astype(np.int64)
    while np.any(before != before[before]):  # twice as far back in every iteration
        rank, before = rank + rank[before], before[before]
    reverse = polyline[direction ^ 1]  # the same polyline in the other direction
    chosen = np.flatnonzero(first[polyline] <= first[reverse])
    start = first[polyline[chosen]]
    order = chosen[np.lexsort((rank[chosen], start, closed[polyline[chosen]]))]
    last = np.append(np.diff(polyline[order]) != 0, True)[: len(order)]
    count = np.flatnonzero(last) + 1
    node, facet = (
        np.insert(array, count, extra) for array, extra in ((begin[order], end[order[last]]), (order // 2, -1))
    )
    slots = np.append(0, count + np.arange(1, len(count) + 1))
    return Polylines(
        node.astype(np.int32), facet.astype(np.int32), slots.astype(np.int32), closed[polyline[order[last]]]
    )


def cut_into_segments(
    position: Floats, polylines: Polylines, curve: Ints, curves: Mapping[str, Curve], circle_of_facet: Floats
) -> tuple[Polylines, Segments]:
    # Facets with the curve index `BY_MIDSIDES` are not cut; the first columns of `circle_of_facet`, shape (f, 4), are
    # their circles, nan for none.
    node, facet = polylines.node.copy(), polylines.facet.copy()
    of_polyline = curve[facet[polylines.start[:-1]]]
    most = len(facet) + len(of_polyline)
    rows, circle = np.zeros((most, 4), dtype=np.int64), np.zeros((most, 3))
    count = cut_polylines(position, node, facet, polylines.start, polylines.closed, of_polyline != -1, rows, circle)
    first = facet[rows[:count, FIRST]]
    segments = Segments(rows[:count], without_noise(circle[:count]), curve[first], np.full(count, np.nan))
    on_arc = (segments.curve == BY_MIDSIDES) & ~np.isnan(circle_of_facet[first, 0])
    segments.rows[on_arc, IS_ROUND], segments.circle[on_arc] = 1, circle_of_facet[first[on_arc], :3]
    for p in np.flatnonzero(segments.curve >= 0).tolist():
        name, shape = list(curves.items())[segments.curve[p]]
        check_near(nodes_of(position, node, segments, p), shape, name)
        if isinstance(shape, Arc):
            segments.rows[p, IS_ROUND], segments.circle[p] = 1, (*shape.centre, shape.radius)
    return polylines._replace(node=node, facet=facet), segments


def without_noise(circle: Floats) -> Floats:
    """Return circles (p, 3) rounded to about 1e-13 of their radius."""
    step = np.ldexp(1.0, np.frexp(circle[:, 2:])[1] - BITS)
    return np.round(circle / step) * step + 0.0  # no -0


def nodes_of(position: Floats, node: Ints, segments: Segments, p: int) -> Floats:
    return position[node[segments.first[p] : segments.last[p] + 1]]


def joined_ends(ends: Ints, nnodes: int) -> tuple[Ints, Ints]:
    """Return the nodes (j,) in which exactly two edges end, and the ends (j, 2).

    Ends of edge k have the indices 2 k and 2 k + 1.
    """
    flat = ends.ravel()
    order, count = np.argsort(flat, kind="stable"), np.bincount(flat, minlength=nnodes)
    node = np.flatnonzero(count == 2)
    first = (np.cumsum(count) - count)[node]
    return node, np.stack([order[first], order[first + 1]], axis=1)


def angles_between(u: Floats, w: Floats) -> Floats:
    return np.abs(np.arctan2(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0], -np.sum(u * w, axis=1)))


def _smooth(edges: Ints, position: Floats) -> Ints:
    node, end = joined_ends(edges[:, [0, -1]], position.shape[1])
    direction = _directions(edges, position)
    smooth = angles_between(direction[end[:, 0]], direction[end[:, 1]]) < CORNER
    through = np.full((position.shape[1], 2), -1, dtype=np.int32)
    through[node[smooth]] = end[smooth] // 2
    return through


def _directions(edges: Ints, position: Floats) -> Floats:
    if edges.shape[1] > 3:  # slopes of the polynomials through equispaced nodes
        slope = np.linalg.inv(np.vander(np.linspace(0.0, 1.0, edges.shape[1]), increasing=True))[1]
        return np.stack([position[:, edges] @ slope, position[:, edges[:, ::-1]] @ slope], axis=2).reshape(2, -1).T
    start, end = position[:, edges[:, 0]], position[:, edges[:, -1]]
    middle = position[:, edges[:, 1]] if edges.shape[1] == 3 else 0.5 * (start + end)
    forth, back = 4.0 * (middle - start) - (end - start), 4.0 * (middle - end) - (start - end)
    return np.stack([forth, back], axis=2).reshape(2, -1).T
