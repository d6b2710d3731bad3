"""Bars and arcs of a plane winding.

Points and directions in the plane of a winding are complex numbers.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints, Mask

__all__ = ["Arc", "Bar", "Plane", "Sides", "Winding", "cross", "crossing_side", "sides_of"]

CHORD = np.deg2rad(6.0)  # angle of a chord of an arc in outlines
SAMPLES = (np.arange(61) + 0.317) / 61  # fractions of a closed line, uneven so that none is in a plane of symmetry
EDGE = 1e-12  # tolerance of points on surfaces, relative to the width
ENDS = np.array([0.0, 1.0])

Plane = NDArray[np.complex128]


class Sides(NamedTuple):
    length: Floats  # (k,); side i begins at point i
    along: Plane  # (k,), unit vectors
    turn: Floats  # (k,): angle from the side before point i to side i, positive to the left


def sides_of(points: Plane) -> Sides:
    edge = np.roll(points, -1) - points
    length = np.abs(edge)
    along = edge / length
    return Sides(length, along, np.angle(along * np.roll(along, 1).conj()))


def cross(a: Any, b: Any) -> Any:
    return a.real * b.imag - a.imag * b.real


def crossing_side(points: Plane) -> int | None:
    rows = np.flatnonzero(np.abs(np.roll(points, -1) - points) > 1e-12 * np.abs(points - points.mean()).max())
    start, end = points[rows], np.roll(points[rows], -1)
    edge, from_start = (end - start)[:, None], start[:, None]
    meets = cross(edge, start - from_start) * cross(edge, end - from_start) <= 0.0
    box = np.array([[start.real, start.imag], [end.real, end.imag]])
    meets &= np.all(box.min(axis=0)[..., None] <= box.max(axis=0)[:, None], axis=0)
    both = np.triu(meets & meets.T, 2)
    both[:1, -1:] = False  # the last side ends where the first begins
    return int(rows[np.argmax(both.any(axis=1))]) if both.any() else None


def is_inside(points: Plane, y: Plane) -> Mask:
    inside = np.zeros(y.size, bool)
    for start, end in zip(points, np.roll(points, -1), strict=True):
        between = (start.imag > y.imag) != (end.imag > y.imag)
        inside ^= between & ((cross(end - start, y - start) > 0.0) == (end.imag > start.imag))
    return inside


class Bar(NamedTuple):
    corner: Plane  # (4,): inner start, inner end, outer end, outer start

    @property
    def along(self) -> complex:
        """Unit vector of the direction of the path."""
        edge = complex(self.corner[1] - self.corner[0])
        return edge / abs(edge)

    @property
    def core(self) -> Plane:
        return self.corner[:2]

    @property
    def chords(self) -> Floats:
        return ENDS

    def sides(self, t: Floats) -> tuple[Plane, Plane]:
        """Return points (2, n) of the inner and outer side, and their derivatives.

        The parameters `t` are from 0 to 1.
        """
        start, end = self.corner[[[0], [3]]], self.corner[[[1], [2]]]
        return start + t * (end - start), (end - start) * np.ones(t.size)

    def least_distance(self, y: Plane) -> Floats:
        # from the rectangle around the bar
        corner, at = self.corner / self.along, y / self.along
        low, high = (np.array([each(corner.real), each(corner.imag)])[:, None] for each in (np.min, np.max))
        local = np.stack((at.real, at.imag))
        return np.hypot(*np.maximum(np.maximum(low - local, local - high), 0.0))

    def across(self, y: Plane, width: float) -> tuple[Ints, Floats, Plane]:
        """Return the rows of points on the bar, their depths and the directions.

        A depth is the distance from the middle of the bar to the left.
        """
        start = self.corner[:, None]
        edge = np.roll(start, -1) - start  # clockwise
        rows = np.flatnonzero(np.all(cross(edge, y - start) <= EDGE * width * np.abs(edge), axis=0))
        return rows, cross(self.along, y[rows] - self.corner.mean()), np.full(rows.size, self.along)


class Arc(NamedTuple):
    centre: complex
    radius: float
    start: float  # angle of the first point
    extent: float  # angle, negative where the path turns to the right
    width: float

    @property
    def turn(self) -> float:
        return float(np.sign(self.extent))

    @property
    def core(self) -> Plane:
        return np.array([self.centre])

    @property
    def chords(self) -> Floats:
        return np.linspace(0.0, 1.0, max(2, round(abs(self.extent) / CHORD)) + 1)

    def sides(self, t: Floats) -> tuple[Plane, Plane]:
        """Return points as `Bar.sides`."""
        radius = self.radius + 0.5 * self.turn * self.width * np.array([[-1.0], [1.0]])
        outward = radius * np.exp(1j * (self.start + self.extent * t))
        return self.centre + outward, 1j * self.extent * outward

    def least_distance(self, y: Plane) -> Floats:
        # from the whole ring
        return np.maximum(np.abs(np.abs(y - self.centre) - self.radius) - 0.5 * self.width, 0.0)

    def across(self, y: Plane, width: float) -> tuple[Ints, Floats, Plane]:
        """Return points from the centre to the outer circle as `Bar.across`."""
        outward = y - self.centre
        angle, distance = np.angle(outward) - (self.start + 0.5 * self.extent), np.abs(outward)
        inside = np.abs(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi) <= 0.5 * abs(self.extent) + EDGE
        rows = np.flatnonzero(inside & (distance <= self.radius + (0.5 + EDGE) * width))
        unit = outward[rows] / np.maximum(distance[rows], np.finfo(float).tiny)
        return rows, self.turn * (self.radius - distance[rows]), 1j * self.turn * unit


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

    def local(self, x: Floats) -> tuple[Plane, Floats]:
        along, across, z = self.frame @ (x - self.origin[:, None])
        return along + 1j * across, z

    def vectors(self, y: Plane) -> Floats:
        """Return directions of the plane in space, (3, ...)."""
        return np.tensordot(self.frame[:2].T, np.stack((y.real, y.imag)), 1)

    def in_space(self, y: Plane, z: Floats | float) -> Floats:
        shape = 3, *[1] * np.ndim(y)
        return self.origin.reshape(shape) + self.vectors(y) + z * self.frame[2].reshape(shape)

    def distance(self, x: Floats) -> Floats:
        # a lower bound of the distance of points (3, n) from the winding
        y, z = self.local(x)
        apart = np.min([piece.least_distance(y) for piece in self.pieces], axis=0)
        return np.hypot(apart, np.maximum(np.abs(z) - 0.5 * self.height, 0.0))

    def turns(self, y: Plane) -> tuple[Floats, Plane]:
        """Return the fraction of turns around points (n,), and the direction of current.

        The fraction is 1 in the bore, 0 outside, and linear across the winding. The direction is 0 outside the winding.
        """
        # The polygon between the bars, and the sectors of arcs that are added or removed.
        core = np.concatenate([piece.core for piece in self.pieces])
        fraction, direction = is_inside(core, y).astype(float), np.zeros_like(y)
        pieces: list[Bar | Arc] = [*self.arcs, *self.bars]
        for piece in pieces:
            rows, depth, along = piece.across(y, self.width)
            fraction[rows] = 0.5 + depth / self.width
            wound = np.abs(depth) <= (0.5 + 2.0 * EDGE) * self.width
            direction[rows[wound]] = along[wound]
        return np.clip(fraction, 0.0, 1.0), direction

    @cached_property
    def samples(self) -> Floats:
        """Points (3, n) in the winding and on its surface, none in a plane of symmetry."""
        levels, points = np.array([-0.5, -1.0 / 6.0, 1.0 / 6.0, 0.5]), []
        for depth in self.width * levels:
            line = self.offset_path(depth)
            line = np.append(line, line[0])
            length = np.append(0.0, np.cumsum(np.abs(np.diff(line))))
            points.append(np.interp(SAMPLES * length[-1], length, line))
        plane = np.concatenate(points)
        return np.concatenate([self.in_space(plane, z) for z in self.height * levels], axis=1)

    def offset_path(self, depth: float) -> Plane:
        """Return a closed polygon (m,) parallel to the path, at a depth to the left."""
        line = self._line(depth)
        apart = np.abs(line - np.roll(line, 1)) > EDGE * self.width
        return line[apart] if apart.any() else line[:1]

    @cached_property
    def edges(self) -> Floats:
        # closed polygons (4, 3, m): inner low, outer low, outer high, inner high
        places = ((0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5))
        return np.stack([self.in_space(self._line(left * self.width), up * self.height) for left, up in places])

    @property
    def surface(self) -> Floats:
        # triangles: (3 coordinates, 3 corners, n)
        here, after = self.edges, np.roll(self.edges, -1, axis=2)
        quads = np.stack((here, after, np.roll(after, -1, axis=0), np.roll(here, -1, axis=0)))
        triangles = np.concatenate((quads[[0, 1, 2]], quads[[0, 2, 3]]), axis=1)
        return np.moveaxis(triangles, 2, 0).reshape(3, 3, -1)

    def _line(self, depth: float) -> Plane:
        fraction = np.array([0.5, 0.5]) + depth / self.width * np.array([1.0, -1.0])
        return np.concatenate([fraction @ piece.sides(piece.chords)[0] for piece in self.pieces])
