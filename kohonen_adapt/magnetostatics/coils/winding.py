"""Bars and arcs of a plane winding."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Mask

__all__ = ["Arc", "Bar", "Sides", "Winding", "crossing_sides", "sides_of"]

CHORD = np.deg2rad(6.0)  # angle of a chord of an arc in outlines
SAMPLES = (np.arange(61) + 0.317) / 61  # fractions of a closed line, uneven so that none is in a plane of symmetry
EDGE = 1e-12  # tolerance of points on surfaces, relative to the width


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


class Bar(NamedTuple):
    corner: Floats  # (4, 2): inner start, inner end, outer end, outer start
    along: Floats  # (2,), unit vector

    @property
    def left(self) -> Floats:
        return np.array([-self.along[1], self.along[0]])

    @property
    def middle(self) -> Floats:
        return self.corner.mean(axis=0)


class Arc(NamedTuple):
    centre: Floats  # (2,)
    radius: float
    start: float  # angle of the first point
    extent: float  # angle, negative where the path turns to the right

    @property
    def turn(self) -> float:
        return float(np.sign(self.extent))


@dataclass(frozen=True, eq=False)
class Winding:
    """Plane winding as bars and arcs, in the order of the path.

    The frame consists of the plane of the path, in which the path is counter-clockwise, and of the axis. Bars end at
    mitres if there are no arcs.
    """

    origin: Floats  # (3,)
    frame: Floats  # (3, 3): unit vectors as rows, the last along the axis
    pieces: tuple[Bar | Arc, ...]
    width: float
    height: float

    @property
    def bars(self) -> list[Bar]:
        return [piece for piece in self.pieces if isinstance(piece, Bar)]

    @property
    def arcs(self) -> list[Arc]:
        return [piece for piece in self.pieces if isinstance(piece, Arc)]

    def local(self, x: Floats) -> Floats:
        return self.frame @ (x - self.origin[:, None])

    def in_space(self, y: Floats, z: float) -> Floats:
        return self.origin[:, None] + self.frame[:2].T @ y.T + z * self.frame[2][:, None]

    def distance(self, x: Floats) -> Floats:
        # a lower bound of the distance of points (3, n) from the winding
        local = self.local(x)
        apart = np.min([least_distance(piece, local[:2], self.width) for piece in self.pieces], axis=0)
        return np.hypot(apart, np.maximum(np.abs(local[2]) - 0.5 * self.height, 0.0))

    @cached_property
    def _core(self) -> Floats:
        # The polygon between the bars. Sectors of arcs are added or removed by `turns`.
        return np.concatenate(
            [piece.corner[:2] if isinstance(piece, Bar) else piece.centre[None] for piece in self.pieces]
        )

    def turns(self, y: Floats) -> tuple[Floats, Floats]:
        """Return the fraction of turns around points, and the direction of current.

        `y` and the direction have shape (2, n). The fraction is 1 in the bore, 0 outside, and
        linear across the winding. The direction is 0 outside the winding.
        """
        fraction, direction = is_inside(self._core, y).astype(float), np.zeros_like(y)
        for arc in self.arcs:
            distance, sector = in_sector(arc, y)
            fraction[sector & (distance < arc.radius)] = 0.5 + 0.5 * arc.turn
            rows = np.flatnonzero(sector & (np.abs(distance - arc.radius) <= (0.5 + EDGE) * self.width))
            fraction[rows] = 0.5 + arc.turn * (arc.radius - distance[rows]) / self.width
            outward = (y[:, rows] - arc.centre[:, None]) / np.maximum(distance[rows], np.finfo(float).tiny)
            direction[:, rows] = arc.turn * np.stack((-outward[1], outward[0]))
        for bar in self.bars:
            rows = np.flatnonzero(in_bar(bar, y, EDGE * self.width))
            fraction[rows] = 0.5 + bar.left @ (y[:, rows] - bar.middle[:, None]) / self.width
            direction[:, rows] = bar.along[:, None]
        return np.clip(fraction, 0.0, 1.0), direction

    @cached_property
    def samples(self) -> Floats:
        """Points (3, n) in the winding and on its surface, none in a plane of symmetry."""
        levels, points = np.array([-0.5, -1.0 / 6.0, 1.0 / 6.0, 0.5]), []
        for depth in self.width * levels:
            line = self.offset_path(depth)
            line = np.concatenate((line, line[:1]))
            length = np.r_[0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))]
            points.append(np.stack([np.interp(SAMPLES * length[-1], length, part) for part in line.T], axis=1))
        plane = np.concatenate(points)
        return np.concatenate([self.in_space(plane, z) for z in self.height * levels], axis=1)

    def offset_path(self, depth: float) -> Floats:
        """Return a closed polygon (m, 2) parallel to the path, at a depth to the left."""
        line = self._line(depth)
        step = np.abs(line - np.roll(line, 1, axis=0)).max(axis=1)
        return line[step > EDGE * self.width] if np.any(step > EDGE * self.width) else line[:1]

    @cached_property
    def edges(self) -> Floats:
        # closed polygons (4, 3, m): inner low, outer low, outer high, inner high
        inner, outer = self._line(0.5 * self.width), self._line(-0.5 * self.width)
        low, high = -0.5 * self.height, 0.5 * self.height
        lines = ((inner, low), (outer, low), (outer, high), (inner, high))
        return np.stack([self.in_space(line, z) for line, z in lines])

    @property
    def surface(self) -> Floats:
        # triangles: (3 coordinates, 3 corners, n)
        here, after = self.edges, np.roll(self.edges, -1, axis=2)
        quads = np.stack((here, after, np.roll(after, -1, axis=0), np.roll(here, -1, axis=0)))
        triangles = np.concatenate((quads[[0, 1, 2]], quads[[0, 2, 3]]), axis=1)
        return np.moveaxis(triangles, 2, 0).reshape(3, 3, -1)

    def _line(self, depth: float) -> Floats:
        points = []
        for piece in self.pieces:
            if isinstance(piece, Bar):
                inner, outer = piece.corner[:2], piece.corner[[3, 2]]
                points.append(0.5 * (inner + outer) + depth / self.width * (inner - outer))
            else:
                count = max(2, round(abs(piece.extent) / CHORD))
                angle = piece.start + piece.extent * np.linspace(0.0, 1.0, count + 1)
                radius = piece.radius - piece.turn * depth
                points.append(piece.centre + radius * np.stack((np.cos(angle), np.sin(angle)), axis=1))
        return np.concatenate(points)


def least_distance(piece: Bar | Arc, y: Floats, width: float) -> Floats:
    # from the rectangle around a bar, or from the whole ring of an arc
    if isinstance(piece, Arc):
        radius = np.hypot(*(y - piece.centre[:, None]))
        return np.maximum(np.abs(radius - piece.radius) - 0.5 * width, 0.0)
    axes = np.stack((piece.along, piece.left))
    corners, at = piece.corner @ axes.T, axes @ y
    return np.hypot(*np.maximum(np.maximum(corners.min(axis=0)[:, None] - at, at - corners.max(axis=0)[:, None]), 0.0))


def in_bar(bar: Bar, y: Floats, tolerance: float = 0.0) -> Mask:
    inside = np.ones(y.shape[1], dtype=bool)
    for start, end in zip(bar.corner, np.roll(bar.corner, -1, axis=0), strict=True):
        edge = end - start
        outward = edge[0] * (y[1] - start[1]) - edge[1] * (y[0] - start[0])  # corners run clockwise
        inside &= outward <= tolerance * np.hypot(*edge)
    return inside


def in_sector(arc: Arc, y: Floats) -> tuple[Floats, Mask]:
    # Distances from the centre, and True within the angle of the arc.
    across = y - arc.centre[:, None]
    angle = np.arctan2(across[1], across[0]) - (arc.start + 0.5 * arc.extent)
    return np.hypot(*across), np.abs(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi) <= 0.5 * abs(arc.extent) + EDGE
