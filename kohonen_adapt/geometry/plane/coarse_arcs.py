"""Recognition of arcs of few nodes by a centre shared with other arcs."""

from collections.abc import Iterator

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.cutting import FEWEST_FACETS, FIRST, IS_ROUND, LAST, arc_end, circle_of_part
from kohonen_adapt.geometry.plane.polylines import Segments, without_noise

__all__ = ["centres_of", "with_coarse_arcs"]

ANGLE = 1e-6  # radians: a motion with a smaller angle is a translation
CONCENTRIC = 1e-3  # maximum distance of centres that coincide, relative to the radius


def with_coarse_arcs(position: Floats, node: Ints, segments: Segments, centres: Floats) -> Segments:
    """Return the curve segments with single facets joined into coarse arcs.

    Four or five nodes may lie on a circle by chance, as on a chamfer. They are an arc if their centre coincides with
    the centre of an arc, of another candidate, or with one of `centres`, shape (k, 2).
    """
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
    """Return the fixed points (k, 2) of the rotations among `motions` (m, 2, 3)."""
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
