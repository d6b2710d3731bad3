"""Recognition of curves by midside nodes, of arcs with junctions and coarse arcs."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask, copied, grouped
from kohonen_adapt.geometry.circles import rounded, sphere_through
from kohonen_adapt.geometry.plane.curves import Arc, Curves
from kohonen_adapt.geometry.plane.cutting import (
    COLLINEAR,
    FEWEST_FACETS,
    MOST,
    TURN,
    Circle,
    Points,
    arc_facets,
    as_complex,
    as_rows,
    circle_near,
    circle_of_part,
    circle_through,
    is_full_turn,
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
)
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.mesh.names import connected_components_of
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = [
    "Midsides",
    "angles_of",
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
    points: Points  # (3, f): ends and midsides
    is_curved: Mask  # (f,)

    @property
    def any_curved(self) -> bool:  # True if a facet is curved: then all others are straight, and no chords of arcs
        return bool(self.is_curved.any())

    def curve_index(self, curve: Ints) -> Ints:
        return np.where((curve == -1) & self.is_curved, BY_MIDSIDES, curve)


def midsides_of(facets: Facets, triangulation: Triangulation, offsets: Floats | None) -> Midsides:
    start, end = as_complex(triangulation.position[facets.nodes.T])
    offset = np.zeros(facets.nodes.shape)
    if offsets is not None:
        opposite = facets_opposite(triangulation.mesh, triangulation.elements.node)
        offset = offsets.T[opposite[facets.element, facets.corner]]
    height = np.abs(((end - start).conj() * as_complex(offset)).imag)
    is_curved = height > COLLINEAR * np.abs(end - start) ** 2
    offset = np.where(is_curved[:, None], offset, 0.0)
    return Midsides(offset, np.stack([start, end, 0.5 * (start + end) + as_complex(offset)]), is_curved)


def joints_on_curves(joints: Joints, midsides: Midsides, curve: Ints) -> tuple[Joints, Floats]:
    # A circle is centre, radius and nan, shape (f, 4), all nan for facets on no circle. Joints between facets with a
    # user-defined curve remain.
    circle = np.full((len(curve), 4), np.nan)
    if not midsides.any_curved:
        return joints, circle
    points = midsides.points
    by_midsides = curve == BY_MIDSIDES
    one, other = joints.facets.T
    on_circle = are_on_circle(points[:, one], points[:, other]) & are_on_circle(points[:, other], points[:, one])
    linked = joints.smooth & by_midsides[one] & by_midsides[other] & on_circle
    group = connected_components_of(len(curve), joints.facets[linked])
    for rows in grouped(group):
        found = sphere_through(as_rows(points[:, rows].ravel()), CIRCULAR) if len(rows) > 1 else None
        if found:
            circle[rows, :3] = *found[0], found[1]
    group[np.isnan(circle[:, 0])] = -1
    continues = (by_midsides[one] == by_midsides[other]) & (~by_midsides[one] | (group[one] == group[other]))
    kinked = (curve[one] == -1) & (curve[other] == -1) & (joints.turn > TURN)
    return joints._replace(smooth=joints.smooth & continues & ~kinked), circle


def are_on_circle(own: Points, others: Points) -> Mask:
    # True if points (3, j) are on the circles through others
    a, b, c = own
    circle = circle_through(a, b, c)
    return np.all(circle.distances(others) <= CIRCULAR * circle.radius, axis=0)


def with_coarse_arcs(z: Points, node: Ints, segments: Segments, others: Floats) -> Segments:
    # Four or five nodes may lie on a circle by chance, as on a chamfer. They are an arc if their centre coincides
    # with the centre of an arc, of another candidate, or of the circles `others`, shape (k, 3). Three nodes always lie
    # on a circle, so the radius must coincide, too, unless the radius in `others` is nan.
    found = list(arc_candidates(z, node, segments))
    if not found:
        return segments
    centre, radius = (np.array(column) for column in zip(*(circle for _, _, circle in found), strict=True))
    circles = rounded(np.column_stack([as_rows(centre), radius]), radius[:, None])
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
    remaining, joined = np.ones(len(segments.first), bool), copied(segments)
    for first, last, arc in arcs:
        joined.last[first], joined.circle[first], joined.widest[first] = segments.last[last], arc[:3], arc[3]
        remaining[first + 1 : last + 1] = False
    return joined.select(remaining)


def arcs_across_junctions(
    facets: Facets, position: Floats, curve: Ints, curves: Curves, stops: Mask, pairs: Pairs
) -> Floats:
    # Returns the circles of facets, shape (f, 4): centre, radius and the largest angle of a facet that leaves the arc
    # enough nodes, nan for facets on no arc. Junctions with other boundaries and interfaces are ignored. Facets with a
    # user-defined curve are left out. Arcs end at nodes of the mask `stops`, shape (n,).
    arcs, rows, z = np.full((len(curve), 4), np.nan), np.flatnonzero(curve == -1), as_complex(position)
    polylines = trace_across_junctions(facets.nodes[rows], position, stops, CORNER)
    polylines, segments = cut_into_segments(position, polylines, np.full(len(rows), -1), {}, arcs[rows])
    segments = with_whole_arcs(z, polylines, segments, np.bincount(facets.nodes.ravel()) > 2)
    user_defined = [(*shape.centre, shape.radius) for shape in curves.values() if isinstance(shape, Arc)]
    others = [*user_defined, *((x, y, np.nan) for x, y in centres_of(pairs.motions))]
    segments = with_coarse_arcs(z, polylines.node, segments, np.reshape(others, (-1, 3)))
    widest = np.abs(angles_of(z, polylines.node, segments)) / fewest_facets(segments.facets)
    found = np.column_stack([segments.circle, widest])
    arcs[rows[polylines.facet[segments.slots]]] = found[segments.of_slot]
    arcs[(pairs.facet >= 0) & np.isnan(arcs[pairs.facet, 0])] = np.nan  # both sides of a pair are arcs, or none is
    return arcs


def angles_of(z: Points, node: Ints, segments: Segments) -> Floats:
    """Return the angles of arcs in radians, positive to the left, shape (p,)."""
    centre = as_complex(segments.circle)[segments.of_slot]
    start, end = z[node[segments.slots]] - centre, z[node[segments.slots + 1]] - centre
    return np.bincount(segments.of_slot, np.angle(end * start.conj())).astype(np.float64)


def fewest_facets(facets: Ints) -> Ints:
    # an arc of so many facets can be recognised again
    return np.where(facets < FACETS, np.minimum(facets, FEWEST_FACETS), FACETS)


def with_whole_arcs(z: Points, polylines: Polylines, segments: Segments, junction: Mask) -> Segments:
    # Noise may leave only parts of a polyline on a circle. A polyline with a junction and without a straight part is an
    # arc if all nodes are near a circle.
    begin = np.searchsorted(segments.first, polylines.start)
    accepted = []
    is_straight = (segments.facets > 1) & ~segments.is_round
    for first, last in pairwise(begin.tolist()):
        node = polylines.node[segments.first[first] : segments.last[last - 1] + 1]
        if last - first < 2 or is_straight[first:last].any() or not junction[node].any():
            continue
        circle = circle_near(z[node])
        angle = abs(circle.angle(z[node])) if circle else 0.0
        if circle and (0.0 < angle <= MOST or is_full_turn(angle)):
            accepted.append((first, last - 1, np.array([*as_rows(circle.centre), circle.radius, np.nan])))
    return joined_segments(segments, accepted)


def trace_across_junctions(nodes: Ints, position: Floats, stops: Mask, sharpest: float) -> Polylines:
    ends, node = continuations(nodes, position, stops, sharpest)
    joint, end = joined_ends(ends, len(node))
    polylines = trace_polylines(ends, joint, end // 2, np.ones(len(joint), bool))
    return polylines._replace(node=node[polylines.node].astype(np.int32))


def with_arcs_across_junctions(polylines: Polylines, segments: Segments, arcs: Floats) -> Segments:
    # Straight segments of one facet are changed to arcs, together if no junction is between them.
    arc = arcs[polylines.facet[segments.first]]
    accepted = []
    for first, last in runs_of_single_facets(segments, arc):
        loop = polylines.node[segments.first[first]] == polylines.node[segments.last[last]]
        cuts = [first, (first + last + 1) // 2, last + 1] if loop else [first, last + 1]
        accepted += [(begin, end - 1, arc[first]) for begin, end in pairwise(cuts)]
    return joined_segments(segments, accepted)


def centres_of(motions: Floats) -> Floats:
    rest = np.eye(2) - motions[:, :, :2]
    turns = (np.linalg.det(motions[:, :, :2]) > 0.0) & (np.abs(np.linalg.det(rest)) > ANGLE**2)
    return np.linalg.solve(rest[turns], motions[turns, :, 2:])[:, :, 0]


def arc_candidates(z: Points, node: Ints, segments: Segments) -> Iterator[tuple[int, int, Circle]]:
    # Fewer than FEWEST_FACETS facets are a candidate only from corner to corner.
    for first, last in runs_of_single_facets(segments, np.zeros((len(segments.first), 1))):
        own = z[node[segments.first[first] : segments.last[last] + 1]]
        at = 0
        if SHORTEST <= len(own) - 1 < FEWEST_FACETS:
            yield first, last, circle_of_part(own)
        while at + FEWEST_FACETS < len(own):
            count = arc_facets(own[at:])
            if count >= FEWEST_FACETS:
                yield first + at, first + at + count - 1, circle_of_part(own[at : at + count + 1])
            at += count if count >= FEWEST_FACETS else 1


def runs_of_single_facets(segments: Segments, key: Floats) -> Iterator[tuple[int, int]]:
    # First and last of consecutive straight segments of one facet, with equal rows of `key`, shape (p, k), none nan.
    single = (segments.facets == 1) & ~segments.is_round & ~np.isnan(key[:, 0])
    linked = single[1:] & single[:-1] & (segments.first[1:] == segments.last[:-1]) & np.all(key[1:] == key[:-1], axis=1)
    begins, ends = single & ~np.append(False, linked), single & ~np.append(linked, False)
    yield from zip(np.flatnonzero(begins).tolist(), np.flatnonzero(ends).tolist(), strict=True)
