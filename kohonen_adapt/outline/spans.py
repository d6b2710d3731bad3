"""Short, hardly bent cubics that make a spline, and the nearest of all their points."""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree

from kohonen_adapt.arrays import Floats, Ints, Mask

__all__ = ["Spans", "cubics_through"]

SPANS = 4  # how many spans a stretch of mean length between two points is cut into
FLAT = 1.0 / 16.0  # of its chord: a span that may be farther off it is halved
HALVINGS = 20  # at most, should the spline have a cusp
CHUNK = 256  # points that are looked up together: many spans may be about as near to each of them
STEPS = 100  # of Newton's method; bisection alone takes 53
EPSILON = np.finfo(float).eps


@dataclass(frozen=True)
class Spans:
    """Short cubics c(v), v from 0 to 1, each near its chord.

    Attributes
    ----------
    coefficient
        (4, 2, s): of v^3, v^2, v and 1.
    chord
        (2, s): from beginning to end.
    middle
        (2, s): of the chord.
    bulge
        (s,): no point of a span is farther off its chord.
    reach
        The nearest span to any point has its middle at most so much farther away than the nearest middle is.
    size
        Of all spans together.
    tree
        Of the middles.
    """

    coefficient: Floats
    chord: Floats
    middle: Floats
    bulge: Floats
    reach: float
    size: float
    tree: KDTree

    @classmethod
    def of(cls, cubics: Floats) -> "Spans":
        """Cut the cubics between neighbouring points, (4, 2, m), until they are short and hardly bent."""
        length = np.sqrt(np.sum(_chord(cubics) ** 2, axis=0))
        spans = _cut(cubics, np.ceil(SPANS * length / length.mean()).astype(np.int64))
        for _ in range(HALVINGS):
            bent = _bulge(spans) > FLAT * np.sqrt(np.sum(_chord(spans) ** 2, axis=0))
            if not bent.any():
                break
            spans = _cut(spans, 1 + bent)
        chord, bulge = _chord(spans), _bulge(spans)
        middle = spans[3] + 0.5 * chord
        reach = 0.5 * float(np.sqrt(np.sum(chord**2, axis=0).max())) + 2.0 * float(bulge.max())
        size = float(np.ptp(middle, axis=1).max()) + 2.0 * reach
        return cls(spans, chord, middle, bulge, reach, size, KDTree(middle.T))

    def nearest(self, x: Floats) -> Floats:
        """The nearest points of all spans to given ones, (2, n) for (2, n)."""
        found = np.empty_like(x)
        for start in range(0, x.shape[1], CHUNK):
            found[:, start : start + CHUNK] = self._nearest(x[:, start : start + CHUNK])
        return found

    def _nearest(self, x: Floats) -> Floats:
        near, _ = self.tree.query(x.T)
        within = self.tree.query_ball_point(x.T, near + self.reach)
        point = np.repeat(np.arange(len(within)), [len(row) for row in within])
        span = np.fromiter(chain.from_iterable(within), dtype=np.int64, count=len(point))
        possible = self._may_be_nearest(point, span, x)
        point, span = point[possible], span[possible]
        foot = self._feet(span, x[:, point])
        distance = np.sum((foot - x[:, point]) ** 2, axis=0)
        order = np.lexsort((span, distance, point))
        return foot[:, order[np.searchsorted(point, np.arange(len(within)))]]

    def _may_be_nearest(self, point: Ints, span: Ints, x: Floats) -> Mask:
        """Which pairs of a point and a span are left when every chord is surrounded by what its span may reach."""
        off = x[:, point] - self.middle[:, span]
        chord = self.chord[:, span]
        along = np.clip(np.sum(off * chord, axis=0) / np.sum(chord**2, axis=0), -0.5, 0.5)
        distance = np.sqrt(np.sum((off - along * chord) ** 2, axis=0))
        most = np.full(x.shape[1], np.inf)
        np.minimum.at(most, point, distance + self.bulge[span])
        return distance - self.bulge[span] <= most[point]

    def _feet(self, span: Ints, x: Floats) -> Floats:
        """The nearest point of each span to the point that stands with it, (2, k) for (k,) and (2, k)."""
        cubic = self.coefficient[:, :, span]
        start = cubic[3].copy()
        cubic[3] -= x
        step = EPSILON * self.size / np.sqrt(np.sum(self.chord[:, span] ** 2, axis=0))
        low, high = _brackets(cubic)
        v = 0.5 * (low + high)
        settled = np.zeros(len(span), dtype=bool)
        for _ in range(STEPS):
            rate, change = _slope(cubic, v)
            low, high = np.where(rate > 0.0, low, v), np.where(rate > 0.0, v, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                newton = v - rate / change
            better = np.where((change > 0.0) & (low <= newton) & (newton <= high), newton, 0.5 * (low + high))
            # What has settled stays, so that no pair has a say in what becomes of another.
            v, settled = np.where(settled, v, better), settled | (np.abs(better - v) <= step)
            if settled.all():
                break
        return ((cubic[0] * v + cubic[1]) * v + cubic[2]) * v + start


def cubics_through(points: Floats, closed: bool) -> Floats:
    """The cubics of a spline between neighbouring points, each over 0 to 1: coefficients (4, 2, m) as in `Spans`.

    The parameter is the length of the chords as parts of their sum, so that nothing depends on the unit of length.
    """
    points = np.append(points, points[:, :1], axis=1) if closed else points
    chord = np.sqrt(np.sum(np.diff(points, axis=1) ** 2, axis=0))
    parameter = np.append(0.0, np.cumsum(chord)) / np.sum(chord)
    spline = CubicSpline(parameter, points.T, bc_type="periodic" if closed else "not-a-knot")
    power = np.arange(3, -1, -1)[:, None]
    return np.moveaxis(spline.c, 2, 1) * (np.diff(parameter) ** power)[:, None]


def _cut(cubics: Floats, parts: Ints) -> Floats:
    """Every cubic in that many parts of equal parameter, each again over 0 to 1, by Taylor's formula."""
    a, b, c, d = np.repeat(cubics, parts, axis=2)
    width = 1.0 / np.repeat(parts, parts)
    at = width * (np.arange(len(width)) - np.repeat(np.cumsum(parts) - parts, parts))
    slope = (3.0 * a * at + 2.0 * b) * at + c
    return np.stack([width**3 * a, width**2 * (3.0 * a * at + b), width * slope, ((a * at + b) * at + c) * at + d])


def _chord(cubics: Floats) -> Floats:
    """From the beginning to the end of every cubic, (2, m)."""
    return np.sum(cubics[:3], axis=0)


def _bulge(cubics: Floats) -> Floats:
    """How far a cubic may be off its chord, (m,): an eighth of the largest second derivative, which is at an end."""
    return 0.25 * np.sqrt(
        np.maximum(np.sum(cubics[1] ** 2, axis=0), np.sum((3.0 * cubics[0] + cubics[1]) ** 2, axis=0))
    )


def _brackets(cubic: Floats) -> tuple[Floats, Floats]:
    """Between which v the distance of a cubic from the origin falls first and rises last; an end alone if none."""
    at_start, at_end = _slope(cubic, 0.0)[0] >= 0.0, _slope(cubic, 1.0)[0] <= 0.0
    end_is_nearer = np.sum(np.sum(cubic, axis=0) ** 2, axis=0) < np.sum(cubic[3] ** 2, axis=0)
    low = np.where(at_end & (end_is_nearer | ~at_start), 1.0, 0.0)
    high = np.where(at_start & ~(end_is_nearer & at_end), 0.0, 1.0)
    return low, high


def _slope(cubic: Floats, v: Floats | float) -> tuple[Floats, Floats]:
    """First and second derivative of half the squared distance of a cubic from the origin."""
    a, b, c, d = cubic
    place, first, second = ((a * v + b) * v + c) * v + d, (3.0 * a * v + 2.0 * b) * v + c, 6.0 * a * v + 2.0 * b
    return np.sum(place * first, axis=0), np.sum(first**2 + place * second, axis=0)
