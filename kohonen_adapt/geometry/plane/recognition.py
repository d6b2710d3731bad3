"""Recognition of curves by midside nodes, of arcs with junctions and coarse arcs."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.curves import Arc, Curve
from kohonen_adapt.geometry.plane.cutting import (
    COLLINEAR,
    FEWEST_FACETS,
    IS_ROUND,
    LAST,
    MOST,
    TURN,
    angle_on_circle,
    arc_end,
    circle_of_part,
    fitted_circle,
    is_full_turn,
    lengths_and_angles,
)
from kohonen_adapt.geometry.plane.pairs import Pairs
from kohonen_adapt.geometry.plane.polylines import (
    BY_MIDSIDES,
    CORNER,
    Facets,
    Joints,
    Polylines,
    Segments,
    continuations,
    cut_into_segments,
    joined_ends,
    trace_polylines,
    without_noise,
)
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = [
    "Midsides",
    "arcs_across_junctions",
    "fewest_facets",
    "joints_on_curves",
    "midsides_of",
    "trace_across_junctions",
    "with_arcs_across_junctions",
]

CIRCULAR = 1e-6  # maximum distance of corners and midside nodes from their circle, relative to the radius
ANGLE = 1e-6  # radians: a motion with a smaller angle is a translation
FACETS = 5  # fewest facets of an arc that can be recognised again; FEWEST_FACETS for a coarse arc
SHORTEST = 2  # fewest facets of a part of a circle, if another part has the same circle
CONCENTRIC = 1e-3  # maximum distance of centres that coincide, relative to the radius


class Midsides(NamedTuple):
    offset: Floats  # (f, 2) from the midpoints of the chords
    is_curved: Mask  # (f,)
    any_curved: bool  # True if a facet is curved: then all others are straight, and no chords of arcs

    def curve_index(self, curve: Ints) -> Ints:
        return np.where((curve == -1) & self.is_curved, BY_MIDSIDES, curve)


def midsides_of(facets: Facets, triangulation: Triangulation, offsets: Floats | None) -> Midsides:
    if offsets is None:
        return Midsides(np.zeros(facets.nodes.shape), np.zeros(len(facets.nodes), dtype=bool), any_curved=False)
    offset = offsets.T[facets_opposite(triangulation.mesh, triangulation.elements.node)[facets.element, facets.corner]]
    position = triangulation.position
    chord = position[facets.nodes[:, 1]] - position[facets.nodes[:, 0]]
    height = np.abs(chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0])
    is_curved = height > COLLINEAR * np.sum(chord**2, axis=1)
    return Midsides(np.where(is_curved[:, None], offset, 0.0), is_curved, any_curved=bool(is_curved.any()))


def joints_on_curves(
    joints: Joints, facets: Facets, position: Floats, midsides: Midsides, curve: Ints
) -> tuple[Joints, Floats]:
    # A circle is centre, radius and nan, shape (f, 4), all nan for facets on no circle. Joints between facets with a
    # user-defined curve remain.
    circle = np.full((len(facets.nodes), 4), np.nan)
    if not midsides.any_curved:
        return joints, circle
    curve_index, (one, other) = curve == BY_MIDSIDES, joints.facets.T
    on_circle = on_one_circle(facets, position, midsides, one, other) & on_one_circle(
        facets, position, midsides, other, one
    )
    group = groups_of(len(circle), joints.facets[joints.smooth & curve_index[one] & curve_index[other] & on_circle])
    for rows in members(group, curve_index):
        circle[rows, :3] = circle_through(facets, position, midsides, rows)
    group[np.isnan(circle[:, 0])] = -1
    continues = (curve_index[one] == curve_index[other]) & (~curve_index[one] | (group[one] == group[other]))
    kinked = (curve[one] == -1) & (curve[other] == -1) & (joints.turn > TURN)
    return joints._replace(smooth=joints.smooth & continues & ~kinked), circle


def on_one_circle(facets: Facets, position: Floats, midsides: Midsides, one: Ints, other: Ints) -> Mask:
    (a, b), m = ends_and_midside(facets, position, midsides, one)
    u, w = b - a, m - a
    twice = 2.0 * (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])
    uu, ww = np.sum(u**2, axis=1), np.sum(w**2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (w[:, 1] * uu - u[:, 1] * ww) / twice, (u[:, 0] * ww - w[:, 0] * uu) / twice
        radius, found = np.hypot(x, y), np.ones(len(one), dtype=bool)
        (c, d), n = ends_and_midside(facets, position, midsides, other)
        for point in (c, d, n):
            offset = point - a
            found &= np.abs(np.hypot(offset[:, 0] - x, offset[:, 1] - y) - radius) <= CIRCULAR * radius
    return found


def ends_and_midside(
    facets: Facets, position: Floats, midsides: Midsides, rows: Ints
) -> tuple[tuple[Floats, Floats], Floats]:
    a, b = (position[facets.nodes[rows, side]] for side in (0, 1))
    return (a, b), 0.5 * (a + b) + midsides.offset[rows]


def groups_of(count: int, linked: Ints) -> Ints:
    graph = coo_array((np.ones(len(linked), dtype=np.int8), tuple(linked.T)), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def members(group: Ints, curve_index: Mask) -> Iterator[Ints]:
    order = np.argsort(group[curve_index], kind="stable")
    rows = np.flatnonzero(curve_index)[order]
    cuts = np.flatnonzero(np.diff(group[rows])) + 1
    yield from (part for part in np.split(rows, cuts) if len(part) > 1)


def circle_through(facets: Facets, position: Floats, midsides: Midsides, rows: Ints) -> Floats:
    (a, b), m = ends_and_midside(facets, position, midsides, rows)
    points = np.concatenate([a, b, m])
    found = without_noise(np.array([fitted_circle(points, np.arange(len(points)), 0, len(points) - 1)]))[0]
    offset = np.abs(np.hypot(*(points - found[:2]).T) - found[2])
    return found if np.max(offset) <= CIRCULAR * found[2] < np.inf else np.full(3, np.nan)


def with_coarse_arcs(position: Floats, node: Ints, segments: Segments, others: Floats) -> Segments:
    # Four or five nodes may lie on a circle by chance, as on a chamfer. They are an arc if their centre coincides
    # with the centre of an arc, of another candidate, or of the circles `others`, shape (k, 3). Three nodes always lie
    # on a circle, so the radius must coincide, too, unless the radius in `others` is nan.
    found = list(arc_candidates(position, node, segments))
    if not found:
        return segments
    circles = without_noise(np.array([candidate for _, _, candidate in found]))
    others = np.concatenate([circles, segments.circle[segments.is_round], others])
    accepted = []
    for number, (first, last, _) in enumerate(found):
        tolerance = CONCENTRIC * circles[number, 2]
        near = np.hypot(*(others[:, :2] - circles[number, :2]).T) <= tolerance
        if last - first + 1 < FEWEST_FACETS:
            near &= ~(np.abs(others[:, 2] - circles[number, 2]) > tolerance)
        near[number] = False
        if near.any():
            accepted.append((first, last, np.append(circles[number], np.nan)))
    return joined_segments(segments, accepted)


def joined_segments(segments: Segments, arcs: Iterable[tuple[int, int, Floats]]) -> Segments:
    # An arc is the indices of its first and last segment, with centre, radius and `widest`.
    remaining, rows, circle = np.ones(len(segments.rows), dtype=bool), segments.rows.copy(), segments.circle.copy()
    widest = segments.widest.copy()
    for first, last, arc in arcs:
        rows[first, LAST], rows[first, IS_ROUND], circle[first], widest[first] = rows[last, LAST], 1, arc[:3], arc[3]
        remaining[first + 1 : last + 1] = False
    return Segments(rows[remaining], circle[remaining], segments.curve[remaining], widest[remaining])


def arcs_across_junctions(
    facets: Facets, position: Floats, curve: Ints, curves: Mapping[str, Curve], stops: Mask, pairs: Pairs
) -> Floats:
    # Returns the circles of facets, shape (f, 4): centre, radius and the largest angle of a facet that leaves the arc
    # enough nodes, nan for facets on no arc. Junctions with other boundaries and interfaces are ignored. Facets with a
    # user-defined curve are left out. Arcs end at nodes of the mask `stops`, shape (n,).
    arcs, rows = np.full((len(curve), 4), np.nan), np.flatnonzero(curve == -1)
    polylines = trace_across_junctions(facets.nodes[rows], position, stops, CORNER)
    none = np.full((len(rows), 4), np.nan)
    polylines, segments = cut_into_segments(position, polylines, np.full(len(rows), -1), {}, none)
    segments = with_whole_arcs(position, polylines, segments, np.bincount(facets.nodes.ravel()) > 2)
    user_defined = [(*shape.centre, shape.radius) for shape in curves.values() if isinstance(shape, Arc)]
    others = [*user_defined, *((x, y, np.nan) for x, y in centres_of(pairs.motions))]
    segments = with_coarse_arcs(position, polylines.node, segments, np.reshape(others, (-1, 3)))
    longest, even, angle = (np.empty(len(segments.rows)) for _ in range(3))
    lengths_and_angles(position, polylines.node, segments.rows, segments.circle, longest, even, angle)
    for p in np.flatnonzero(segments.is_round).tolist():
        widest = abs(angle[p]) / fewest_facets(segments.facets[p])
        arcs[rows[polylines.facet[segments.first[p] : segments.last[p]]]] = (*segments.circle[p], widest)
    arcs[(pairs.facet >= 0) & np.isnan(arcs[pairs.facet, 0])] = np.nan  # both sides of a pair are arcs, or none is
    return arcs


def fewest_facets(facets: Ints) -> Ints:
    # an arc of so many facets can be recognised again
    return np.where(facets < FACETS, np.minimum(facets, FEWEST_FACETS), FACETS)


def with_whole_arcs(position: Floats, polylines: Polylines, segments: Segments, junction: Mask) -> Segments:
    # Noise may leave only parts of a polyline on a circle. A polyline with a junction and without a straight part is an
    # arc if all nodes are near a circle.
    begin, accepted, circle = np.searchsorted(segments.first, polylines.start), [], np.full((1, 4), np.nan)
    is_straight = (segments.facets > 1) & ~segments.is_round
    for first, last in pairwise(begin.tolist()):
        slots = range(segments.first[first], segments.last[last - 1] + 1)
        if last - first < 2 or is_straight[first:last].any() or not junction[polylines.node[slots]].any():
            continue
        angle = abs(angle_on_circle(position, polylines.node, slots[0], slots[-1], circle, 0))
        if 0.0 < angle <= MOST or is_full_turn(angle):
            accepted.append((first, last - 1, np.append(without_noise(circle[:, :3])[0], np.nan)))
    return joined_segments(segments, accepted)


def trace_across_junctions(nodes: Ints, position: Floats, stops: Mask, sharpest: float) -> Polylines:
    ends, node = continuations(nodes, position, stops, sharpest)
    through = np.full((len(node), 2), -1, dtype=np.int32)
    joint, end = joined_ends(ends, len(node))
    through[joint] = end // 2
    polylines = trace_polylines(ends, through)
    return polylines._replace(node=node[polylines.node].astype(np.int32))


def with_arcs_across_junctions(polylines: Polylines, segments: Segments, arcs: Floats) -> Segments:
    # Straight segments of one facet are changed to arcs, together if no junction is between them.
    arc, accepted = arcs[polylines.facet[segments.first]], []
    for first, last in runs_of_single_facets(segments, arc):
        loop = polylines.node[segments.first[first]] == polylines.node[segments.last[last]]
        cuts = [first, (first + last + 1) // 2, last + 1] if loop else [first, last + 1]
        accepted += [(begin, end - 1, arc[first]) for begin, end in pairwise(cuts)]
    return joined_segments(segments, accepted)


def centres_of(motions: Floats) -> Floats:
    rest = np.eye(2) - motions[:, :, :2]
    turns = (np.linalg.det(motions[:, :, :2]) > 0.0) & (np.abs(np.linalg.det(rest)) > ANGLE**2)
    return np.linalg.solve(rest[turns], motions[turns, :, 2:])[:, :, 0]


def arc_candidates(
    position: Floats, node: Ints, segments: Segments
) -> Iterator[tuple[int, int, tuple[float, float, float]]]:
    # Fewer than FEWEST_FACETS facets are a candidate only from corner to corner.
    for first, last in runs_of_single_facets(segments, np.zeros((len(segments.rows), 1))):
        at, stop = int(segments.first[first]), int(segments.last[last])
        segment_at = first - at
        if SHORTEST <= stop - at < FEWEST_FACETS:
            yield first, last, circle_of_part(position, node, at, stop)
        while at + FEWEST_FACETS <= stop:
            end = arc_end(position, node, at, stop)
            if end - at >= FEWEST_FACETS:
                yield segment_at + at, segment_at + end - 1, circle_of_part(position, node, at, end)
            at = end if end - at >= FEWEST_FACETS else at + 1


def runs_of_single_facets(segments: Segments, key: Floats) -> Iterator[tuple[int, int]]:
    # First and last of consecutive straight segments of one facet, with equal rows of `key`, shape (p, k), none nan.
    single = (segments.facets == 1) & ~segments.is_round & ~np.isnan(key[:, 0])
    linked = single[1:] & single[:-1] & (segments.first[1:] == segments.last[:-1]) & np.all(key[1:] == key[:-1], axis=1)
    begins, ends = single & ~np.append(False, linked), single & ~np.append(linked, False)
    yield from zip(np.flatnonzero(begins).tolist(), np.flatnonzero(ends).tolist(), strict=True)
