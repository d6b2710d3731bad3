"""Closed polygons in the plane."""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Mask

__all__ = ["Sides", "crossing_sides", "is_inside", "sides_of"]


class Sides(NamedTuple):
    length: Floats  # (k,); side i begins at point i
    along: Floats  # (k, 2), unit vectors
    left: Floats  # (k, 2), unit vectors to the left
    turn: Floats  # (k,): angle from the side before point i to side i, positive to the left


def sides_of(points: Floats) -> Sides:
    edge = np.roll(points, -1, axis=0) - points
    length = np.hypot(*edge.T)
    along = edge / length[:, None]
    before = np.roll(along, 1, axis=0)
    left = np.stack((-along[:, 1], along[:, 0]), axis=1)
    turn = np.arctan2(before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], np.sum(before * along, axis=1))
    return Sides(length, along, left, turn)


def crossing_sides(points: Floats) -> tuple[int, int] | None:
    """Return the indices of two crossing sides, or None."""
    distinct = np.hypot(*(np.roll(points, -1, axis=0) - points).T) > 1e-12 * np.ptp(points, axis=0).max()
    rows = np.flatnonzero(distinct)
    if not rows.size:
        return None
    start, end = points[rows], points[rows][np.r_[1 : rows.size, 0]]
    first, second = np.triu_indices(rows.size, 2)
    apart = (first > 0) | (second < rows.size - 1)
    first, second = first[apart], second[apart]
    on_sides = [
        _cross(end[i] - start[i], point[j] - start[i])
        for i, j in ((first, second), (second, first))
        for point in (start, end)
    ]
    boxes = [
        np.all(np.minimum(start[i], end[i]) <= np.maximum(start[j], end[j]), axis=1)
        for i, j in ((first, second), (second, first))
    ]
    meets = (on_sides[0] * on_sides[1] <= 0.0) & (on_sides[2] * on_sides[3] <= 0.0) & boxes[0] & boxes[1]
    found = np.flatnonzero(meets)
    return (int(rows[first[found[0]]]), int(rows[second[found[0]]])) if found.size else None


def is_inside(points: Floats, x: Floats) -> Mask:
    inside = np.zeros(x.shape[1], dtype=bool)
    for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        between = (start[1] > x[1]) != (end[1] > x[1])
        side = (end[0] - start[0]) * (x[1] - start[1]) - (end[1] - start[1]) * (x[0] - start[0])
        inside ^= between & ((side > 0.0) == (end[1] > start[1]))
    return inside


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
