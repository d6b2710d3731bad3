"""Recognition of curves from midside nodes, and of concentric coarse arcs."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.cutting import (
    COLLINEAR,
    FEWEST_FACETS,
    FIRST,
    IS_ROUND,
    LAST,
    TURN,
    arc_end,
    circle_of_part,
    fitted_circle,
)
from kohonen_adapt.geometry.plane.polylines import BY_MIDSIDES, Facets, Joints, Segments, without_noise
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Midsides", "centres_of", "joints_on_curves", "midsides_of", "with_coarse_arcs"]

CIRCULAR = 1e-6  # maximum distance of corners and midside nodes from their circle, relative to the radius
ANGLE = 1e-6  # radians: a motion with a smaller angle is a translation
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
    # A circle is centre and radius, shape (f, 3), nan for facets on no circle. Joints between facets with a
    # user-defined curve remain.
    circle = np.full((len(facets.nodes), 3), np.nan)
    if not midsides.any_curved:
        return joints, circle
    curve_index, (one, other) = curve == BY_MIDSIDES, joints.facets.T
    on_circle = on_one_circle(facets, position, midsides, one, other) & on_one_circle(
        facets, position, midsides, other, one
    )
    group = groups_of(len(circle), joints.facets[joints.smooth & curve_index[one] & curve_index[other] & on_circle])
    for rows in members(group, curve_index):
        circle[rows] = circle_through(facets, position, midsides, rows)
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


def with_coarse_arcs(position: Floats, node: Ints, segments: Segments, centres: Floats) -> Segments:
    # Four or five nodes may lie on a circle by chance, as on a chamfer. They are an arc if their centre coincides
    # with the centre of an arc, of another candidate, or with one of `centres`, shape (k, 2).
    found = list(arc_candidates(position, node, segments))
    if not found:
        return segments
    circles = without_noise(np.array([candidate for _, _, candidate in found]))
    others = np.concatenate([circles[:, :2], segments.circle[segments.is_round, :2], centres.reshape(-1, 2)])
    remaining, rows, circle = np.ones(len(segments.rows), dtype=bool), segments.rows.copy(), segments.circle.copy()
    for number, (first, last, _) in enumerate(found):
        near = np.hypot(*(others - circles[number, :2]).T) <= CONCENTRIC * circles[number, 2]
        near[number] = False
        if near.any():
            rows[first, LAST], rows[first, IS_ROUND], circle[first] = rows[last, LAST], 1, circles[number]
            remaining[first + 1 : last + 1] = False
    return Segments(rows[remaining], circle[remaining], segments.curve[remaining])


def centres_of(motions: Floats) -> Floats:
    rest = np.eye(2) - motions[:, :, :2]
    turns = (np.linalg.det(motions[:, :, :2]) > 0.0) & (np.abs(np.linalg.det(rest)) > ANGLE**2)
    return np.linalg.solve(rest[turns], motions[turns, :, 2:])[:, :, 0]


def arc_candidates(
    position: Floats, node: Ints, segments: Segments
) -> Iterator[tuple[int, int, tuple[float, float, float]]]:
    rows, single = segments.rows, (segments.facets == 1) & ~segments.is_round & (segments.curve == -1)
    linked = np.append(single[1:] & single[:-1] & (rows[1:, FIRST] == rows[:-1, LAST]), False)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], linked]).astype(np.int8)))
    for first, last in ends.reshape(-1, 2).tolist():
        at, stop = int(rows[first, FIRST]), int(rows[last, LAST])
        segment_at = first - at
        while at + FEWEST_FACETS <= stop:
            end = arc_end(position, node, at, stop)
            if end - at >= FEWEST_FACETS:
                yield segment_at + at, segment_at + end - 1, circle_of_part(position, node, at, end)
            at = end if end - at >= FEWEST_FACETS else at + 1
