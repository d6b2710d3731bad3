"""Cutting of polylines of facets into straight segments and arcs of circles.

Points are complex numbers x + i y in the order of the polyline. Closed polylines repeat the first point at the end.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.geometry.circles import fitted_sphere

__all__ = [
    "Circle",
    "Points",
    "angles",
    "arc_facets",
    "as_complex",
    "as_rows",
    "bends",
    "circle_near",
    "circle_of_part",
    "circle_through",
    "cut_polyline",
    "is_full_turn",
    "square",
    "straight_end",
    "turning_angles",
]

TURN = 1e-6  # radians: maximum turn between facets of a straight segment
COLLINEAR = 1e-9  # maximum distance of the nodes of a straight segment from its chord, relative to the chord
FEWEST = 6  # fewest nodes of an arc
FEWEST_FACETS = 3  # fewest facets of a coarse arc, with four nodes: any three nodes are on a circle
CLOSE = 0.05  # maximum distance of a node that lies on a circle, in sagittas of its facet
LEAVING = 0.5  # distance of the next node above which an arc ends, in sagittas; 4 if a tangent follows
ROUNDING = 1e-15  # rounding error of distances, relative to the coordinates
LOOSE = 1e-3  # maximum distance from a circle if a whole polyline is an arc, relative to the radius
DISTINCT = 10.0  # minimum extent of an arc across its chord, relative to the largest distance from the circle
MOST = 1.8 * math.pi  # radians: a longer arc is halved, so that the nearer end of a node is unique

Points = NDArray[np.complex128]


def as_complex(x: Floats) -> Points:
    return x[..., 0] + 1j * x[..., 1]


def as_rows(z: Points) -> Floats:
    return np.stack([z.real, z.imag], axis=-1)


def angles(z: Points) -> Floats:
    """Return the angles from each of complex numbers to the next."""
    return np.angle(z[1:] * z[:-1].conj())


def turning_angles(z: Points) -> Floats:
    return angles(np.diff(z))


class Circle(NamedTuple):
    centre: Points
    radius: Any

    def angle(self, z: Points) -> float:
        """Return the angle of a polyline around the centre, 0 if its sense changes."""
        found = angles(z - self.centre)
        return float(found.sum()) if np.all((found > 0.0) == (found[0] > 0.0)) else 0.0

    def distances(self, z: Points) -> Floats:
        return np.abs(np.abs(z - self.centre) - self.radius)

    def sagittas(self, z: Points, neighbour: Points) -> Floats:
        """Return distances from the circle in sagittas of facets.

        A facet ends at a point of `neighbour`, on the circle. Hence |v - c|^2 - r^2 is computed without r, which may be
        large, and the ratio is 4 | |v - c|^2 - r^2 | / |v - neighbour|^2.
        """
        facet = z - neighbour
        squared = square(facet)
        twice = np.abs(squared - 2.0 * (facet.conj() * (self.centre - neighbour)).real)
        noise = 2.0 * self.radius * ROUNDING * (np.abs(z.real) + np.abs(z.imag))
        return 4.0 * np.maximum(0.0, twice - noise) / squared


def square(z: Points) -> Floats:
    return z.real**2 + z.imag**2


@np.errstate(invalid="ignore")
def circle_through(a: Points, b: Points, c: Points) -> Circle:
    # not a number for points on a line
    u, w = b - a, c - a
    doubled = 2.0 * (u.conj() * w).imag
    out = 1j * (u * square(w) - w * square(u)) / np.where(doubled == 0.0, np.nan, doubled)
    return Circle(a + out, np.abs(out))


def circle_of_part(z: Points) -> Circle:
    count = len(z) - 1
    return circle_through(*z[[0, count // 3, 2 * (count // 3)] if z[0] == z[-1] else [0, count // 2, count]])


def circle_near(z: Points) -> Circle | None:
    # the circle of a polyline with noise
    own = z[:-1] if z[0] == z[-1] else z
    if len(own) < FEWEST:
        return None
    centre, radius = fitted_sphere(as_rows(z))
    circle = Circle(as_complex(centre), radius)
    chord = own[-1] - own[0]
    height = np.ptp((chord.conj() * (z - own[0])).imag) / abs(chord)
    distance = circle.distances(z).max()
    return circle if distance <= LOOSE * radius and DISTINCT * distance <= height else None


def is_full_turn(angle: float) -> bool:
    return abs(abs(angle) - 2.0 * math.pi) < 1.0


class Part(NamedTuple):
    first: int  # index of the first and last point
    last: int
    circle: Circle | None = None
    closed: bool = False


def cut_polyline(z: Points, closed: bool) -> tuple[list[Part], int]:
    """Cut a polyline into straight segments, arcs and single facets.

    Also returns the number of points by which a closed polyline is rotated, to begin where a segment begins.
    """
    shift = 0
    whole = circle_of_loop(z) if closed else None
    if closed and not whole:
        shift = first_joint(z)
        whole = None if shift else circle_near(z)
    if closed and whole and is_full_turn(whole.angle(z)):
        return [Part(0, len(z) - 1, whole, closed=True)], 0
    z = np.append(z[shift:], z[1 : shift + 1])
    parts = cut_open(z)
    if all(part.last == part.first + 1 for part in parts):
        whole = circle_near(z)
        if whole and 0.0 < abs(whole.angle(z)) <= MOST:
            return [Part(0, len(z) - 1, whole)], shift
    return parts, shift


def circle_of_loop(z: Points) -> Circle | None:
    if len(z) <= FEWEST:
        return None
    circle = circle_of_part(z)
    return circle if np.all(circle.sagittas(z[:-1], z[1:]) <= CLOSE) and is_full_turn(circle.angle(z)) else None


def first_joint(z: Points) -> int:
    # where the first segment of several facets ends
    turning = bends(z)
    at = 0
    end = 0
    while end <= at + 1 and end < len(z) - 1:
        at, end = end, next_part(z, turning, end, end).last
    return end % (len(z) - 1)


def cut_open(z: Points) -> list[Part]:
    turning = bends(z)
    parts = list[Part]()
    at = 0
    begin = 0
    while at < len(z) - 1:
        part = next_part(z, turning, at, begin)
        if part.circle and abs(part.circle.angle(z[at : part.last + 1])) > MOST:
            part = part._replace(last=(at + part.last) // 2)
        begin = part.last if part.last > at + 1 else begin
        at = part.last
        parts.append(part)
    return parts


def next_part(z: Points, turning: Mask, at: int, begin: int) -> Part:
    """Return the segment that begins at a point.

    Nodes on another smooth curve nearly fit a circle, too. Therefore the neighbouring nodes must be clearly off the
    circle, except at an end of the polyline and at `begin`, where the last segment of several facets ends.
    """
    end = straight_end(turning, at)
    if end > at + 1 and on_chord(z[at : end + 1]):
        return Part(at, end)
    end = at + arc_facets(z[at:])
    if end - at + 1 >= FEWEST:
        circle = circle_of_part(z[at : end + 1])
        beside = [(at - 1, at)] * (at > begin) + [(end + 1, end)] * (end < len(z) - 1)
        if not any(circle.sagittas(z[other], z[own]) <= LEAVING for other, own in beside):
            return Part(at, end, circle)
    return Part(at, at + 1)


def bends(z: Points) -> Mask:
    # True for points at which a straight segment ends, from the second on
    return np.append(np.abs(turning_angles(z)) > TURN, True)


def straight_end(turning: Mask, at: int) -> int:
    return at + 1 + int(np.argmax(turning[at:]))


def on_chord(z: Points) -> bool:
    chord, out = z[-1] - z[0], z[1:] - z[0]
    return bool(np.all(np.abs((out.conj() * chord).imag) <= COLLINEAR * square(chord)))


def arc_facets(z: Points) -> int:
    """Return the number of facets on one circle from the first point on."""
    if len(z) < 3:
        return 0
    end = 2
    left = turning_angles(z[:3]) > 0.0
    while end < len(z) - 1:
        circle = circle_through(*z[[0, end // 2, end]])
        turns_back = (turning_angles(z[end - 1 : end + 2]) > 0.0) != left
        if turns_back or not circle.sagittas(z[end + 1], z[end]) <= CLOSE:
            break
        end += 1
    return end
