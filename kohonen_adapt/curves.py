"""Curves that nodes may slide on: lines, circles and splines, each with its nearest point to any point."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from math import isfinite
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree
from skfem import MeshTri
from skfem.mesh import MeshTri1

from .polylines import polylines_of

__all__ = ["Arc", "Line", "Spline"]

Floats = NDArray[np.float64]
Indices = NDArray[np.integer]

SPANS = 4  # how many spans a stretch of mean length between two points is cut into
FLAT = 1.0 / 16.0  # of its chord: a span that may be farther off it is halved
HALVINGS = 20  # at most, should the spline have a cusp
CHUNK = 1024  # points that are looked up together
STEPS = 100  # of Newton's method; bisection alone takes 53
EPSILON = np.finfo(float).eps


@dataclass(frozen=True)
class Line:
    """The straight line through two points, without end on both sides.

    Attributes
    ----------
    start, end
        Two different points (x, y).

    Raises
    ------
    ValueError
        If they are not two different points with finite coordinates.
    """

    start: tuple[float, float]
    end: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", _checked_point(self.start, "start of a Line"))
        object.__setattr__(self, "end", _checked_point(self.end, "end of a Line"))
        if self.start == self.end:
            raise ValueError(f"start and end of a Line must be two different points; got {self.start} twice.")

    def project(self, x: ArrayLike) -> Floats:
        """The nearest points of the line, ``a + (b - a) ((x - a) . (b - a)) / |b - a|^2``.

        Parameters
        ----------
        x
            (2, n): any points.

        Returns
        -------
        ndarray (2, n)
            They may lie beyond `start` or `end`.

        Raises
        ------
        ValueError
            If `x` has another shape or holds a value that is not finite.
        """
        x = _checked_points(x, "x")
        start, end = np.array([self.start, self.end])[:, :, None]
        along = end - start
        return start + along * (np.sum((x - start) * along, axis=0) / np.sum(along**2))


@dataclass(frozen=True)
class Arc:
    """A circle; on it, an arc ends where its chain of facets does.

    Attributes
    ----------
    centre
        (x, y).
    radius
        Above zero.

    Raises
    ------
    ValueError
        If the centre is not finite, or the radius not a positive number.
    """

    centre: tuple[float, float]
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _checked_point(self.centre, "centre of an Arc"))
        if not (isinstance(self.radius, Real) and isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"radius of an Arc must be a positive number; got {self.radius!r}.")
        object.__setattr__(self, "radius", float(self.radius))

    def project(self, x: ArrayLike) -> Floats:
        """The nearest points of the circle, ``c + r (x - c) / |x - c|``.

        Parameters
        ----------
        x
            (2, n): any points. From the centre all points of the circle are equally near; it goes to the one on its
            right, ``c + (r, 0)``.

        Returns
        -------
        ndarray (2, n)
            Points of the circle.

        Raises
        ------
        ValueError
            If `x` has another shape or holds a value that is not finite.
        """
        centre = np.array(self.centre)[:, None]
        off = _checked_points(x, "x") - centre
        distance = np.sqrt(np.sum(off**2, axis=0))
        off[:, distance == 0.0], distance[distance == 0.0] = [[1.0], [0.0]], 1.0
        return centre + self.radius * (off / distance)


class Spline:
    """A cubic spline with two continuous derivatives through points in order, or several of them.

    The parameter is the length of the chords; at open ends the third derivative does not jump at the second point ("not
    a knot"; C. de Boor, *A Practical Guide to Splines*, Springer 2001, chapter IV). So two points make a straight line,
    three a parabola, and the distance to a smooth curve falls with the fourth power of the spacing.

    Parameters
    ----------
    points
        (2, n): at least two, each different from the next.
    closed
        Go on from the last point to the first, smoothly there too; at least three points then.

    Attributes
    ----------
    pieces
        Points of every piece, (2, n); one piece if the spline was made from points.
    closed
        Whether every piece is closed.

    Raises
    ------
    ValueError
        If there are too few points, one is not finite, or one is where the next is.
    """

    def __init__(self, points: ArrayLike, *, closed: bool = False) -> None:
        self._lay([(points, closed)])

    @classmethod
    def of_pieces(cls, pieces: Sequence[tuple[ArrayLike, bool]]) -> "Spline":
        """One curve of several pieces, not connected or with corners between them.

        Parameters
        ----------
        pieces
            At least one: its points (2, n) and whether it is closed.

        Raises
        ------
        ValueError
            As for the points of one piece, or if there is no piece.
        """
        spline = object.__new__(cls)
        spline._lay(pieces)
        return spline

    @classmethod
    def through(cls, mesh: MeshTri, name: str) -> "Spline":
        """The spline through the nodes that a named boundary has now.

        Made once from the first mesh, it keeps the geometry of that mesh however often nodes slide on it. The facets
        may lie on the rim or inside. They make several pieces where they are not connected, turn by 35 degrees or more,
        or where other than two of them meet; a loop without such a corner is closed.

        Parameters
        ----------
        mesh
            The mesh.
        name
            One of its boundaries.

        Raises
        ------
        ValueError
            If `mesh` is no `MeshTri`, or the boundary is not there or empty.
        """
        if type(mesh) is not MeshTri1:
            raise ValueError(f"mesh must be a skfem.MeshTri; got {type(mesh).__name__}.")
        boundaries = mesh.boundaries or {}
        if name not in boundaries:
            known = ", ".join(repr(known) for known in sorted(boundaries)) or "none"
            raise ValueError(f"boundary {name!r} is not in the mesh; its boundaries are: {known}.")
        facets = np.unique(np.asarray(boundaries[name], dtype=np.int64))
        if len(facets) == 0:
            raise ValueError(f"boundary {name!r} has no facets, so there is no curve through their nodes.")
        polylines = polylines_of(mesh.facets[:, facets].T, mesh.p)
        return cls.of_pieces([(mesh.p[:, line.nodes], line.closed) for line in polylines])

    def __repr__(self) -> str:
        count = sum(points.shape[1] for points in self.pieces)
        return f"<Spline of {len(self.pieces)} piece{'s' * (len(self.pieces) > 1)} through {count} points>"

    def _lay(self, pieces: Sequence[tuple[ArrayLike, bool]]) -> None:
        if len(pieces) == 0:
            raise ValueError("a Spline must have at least one piece; got none.")
        self.pieces = tuple(_checked_piece(points, closed) for points, closed in pieces)
        self.closed = tuple(bool(closed) for _, closed in pieces)
        # From here on a point is what it is beyond the first one, so that a far origin takes no digits.
        self._origin = self.pieces[0][:, :1]
        stretches = [
            _stretches(points - self._origin, closed) for points, closed in zip(self.pieces, self.closed, strict=True)
        ]
        self._spans = Spans.of(np.concatenate(stretches, axis=2))
        self._tree = KDTree(self._spans.middle.T)

    def project(self, x: ArrayLike) -> Floats:
        """The nearest points of the spline, its ends included.

        To rounding, unless `x` is as good as equally far from two places: either of them may come then.

        Parameters
        ----------
        x
            (2, n): any points.

        Returns
        -------
        ndarray (2, n)
            Points of the spline.

        Raises
        ------
        ValueError
            If `x` has another shape or holds a value that is not finite.

        Notes
        -----
        The spline is cut into short spans. Those that may be nearest, by the distance of their chords, are found in a
        tree; on each, the root of ``(c(v) - x) . c'(v)`` is found by Newton's method, with bisection where that fails.
        """
        off = _checked_points(x, "x") - self._origin
        for start in range(0, off.shape[1], CHUNK):
            off[:, start : start + CHUNK] = self._nearest(off[:, start : start + CHUNK])
        return off + self._origin

    def _nearest(self, x: Floats) -> Floats:
        near, _ = self._tree.query(x.T)
        spans = self._tree.query_ball_point(x.T, near + self._spans.reach, return_sorted=True)
        point = np.repeat(np.arange(len(spans)), [len(row) for row in spans])
        span = np.fromiter(chain.from_iterable(spans), dtype=np.int64, count=len(point))
        possible = self._spans.may_be_nearest(point, span, x)
        point, span = point[possible], span[possible]
        foot = self._spans.feet(span, x[:, point])
        distance = np.sum((foot - x[:, point]) ** 2, axis=0)
        order = np.lexsort((distance, point))
        return foot[:, order[np.searchsorted(point, np.arange(len(spans)))]]


class Spans(NamedTuple):
    """Short cubics c(v), v from 0 to 1, that make a spline; their chords are near them."""

    coefficient: Floats  # (4, 2, s) of v^3, v^2, v and 1
    chord: Floats  # (2, s)
    middle: Floats  # (2, s) of the chord
    bulge: Floats  # (s,): no point is farther off the chord
    reach: float  # the nearest span to any point has its middle at most so much farther away than the nearest middle
    size: float  # of the whole spline

    @classmethod
    def of(cls, stretches: Floats) -> "Spans":
        """Cut the cubics between neighbouring points, (4, 2, m), until they are short and hardly bent."""
        length = np.sqrt(np.sum(_chord(stretches) ** 2, axis=0))
        spans = _cut(stretches, np.ceil(SPANS * length / length.mean()).astype(np.int64))
        for _ in range(HALVINGS):
            bent = _bulge(spans) > FLAT * np.sqrt(np.sum(_chord(spans) ** 2, axis=0))
            if not bent.any():
                break
            spans = _cut(spans, 1 + bent)
        chord, bulge = _chord(spans), _bulge(spans)
        middle = spans[3] + 0.5 * chord
        reach = 0.5 * float(np.sqrt(np.sum(chord**2, axis=0).max())) + 2.0 * float(bulge.max())
        return cls(spans, chord, middle, bulge, reach, float(np.ptp(middle, axis=1).max()) + 2.0 * reach)

    def may_be_nearest(self, point: Indices, span: Indices, x: Floats) -> NDArray[np.bool_]:
        """Which pairs of a point and a span are left when every chord is surrounded by what its span may reach."""
        off = x[:, point] - self.middle[:, span]
        chord = self.chord[:, span]
        along = np.clip(np.sum(off * chord, axis=0) / np.sum(chord**2, axis=0), -0.5, 0.5)
        distance = np.sqrt(np.sum((off - along * chord) ** 2, axis=0))
        most = np.full(x.shape[1], np.inf)
        np.minimum.at(most, point, distance + self.bulge[span])
        return distance - self.bulge[span] <= most[point]

    def feet(self, span: Indices, x: Floats) -> Floats:
        """The nearest point of each span to the point that stands with it, (2, k) for (k,) and (2, k)."""
        cubic = self.coefficient[:, :, span]
        cubic[3] -= x
        length = np.sqrt(np.sum(self.chord[:, span] ** 2, axis=0))
        low, high = _brackets(cubic)
        v = 0.5 * (low + high)
        for _ in range(STEPS):
            rate, change = _slope(cubic, v)
            high, low = np.where(rate > 0.0, v, high), np.where(rate > 0.0, low, v)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = v - rate / change
            step = np.where((change > 0.0) & (low <= step) & (step <= high), step, 0.5 * (low + high))
            settled = np.abs(step - v) * length <= EPSILON * self.size
            v = step
            if settled.all():
                break
        return ((cubic[0] * v + cubic[1]) * v + cubic[2]) * v + cubic[3] + x


def _cut(cubics: Floats, parts: Indices) -> Floats:
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


def _stretches(points: Floats, closed: bool) -> Floats:
    """The cubics between neighbouring points, each over 0 to 1: coefficients (4, 2, m) of v^3, v^2, v and 1."""
    points = np.append(points, points[:, :1], axis=1) if closed else points
    chord = np.sqrt(np.sum(np.diff(points, axis=1) ** 2, axis=0))
    parameter = np.append(0.0, np.cumsum(chord)) / np.sum(chord)
    spline = CubicSpline(parameter, points.T, bc_type="periodic" if closed else "not-a-knot")
    power = np.arange(3, -1, -1)[:, None]
    return np.moveaxis(spline.c, 2, 1) * (np.diff(parameter) ** power)[:, None]


def _checked_point(point: ArrayLike, what: str) -> tuple[float, float]:
    try:
        x, y = (float(coordinate) for coordinate in np.asarray(point, dtype=np.float64))
    except (TypeError, ValueError):
        x = y = np.nan
    if not (isfinite(x) and isfinite(y)):
        raise ValueError(f"{what} must be two finite numbers (x, y); got {point!r}.")
    return x, y


def _checked_points(points: ArrayLike, what: str) -> Floats:
    array = np.array(points, dtype=np.float64)
    if array.ndim != 2 or len(array) != 2:
        raise ValueError(f"{what} must have shape (2, n); got {array.shape}.")
    if not np.all(np.isfinite(array)):
        number = np.sum(~np.isfinite(array).all(axis=0))
        raise ValueError(f"{what} must be finite; {number} of {array.shape[1]} points are not.")
    return array


def _checked_piece(points: ArrayLike, closed: bool) -> Floats:
    array = _checked_points(points, "points of a Spline")
    least = 3 if closed else 2
    if array.shape[1] < least:
        kind = "a closed" if closed else "an open"
        raise ValueError(f"{kind} Spline must have at least {least} points; got {array.shape[1]}.")
    following = np.roll(array, -1, axis=1)
    same = np.all(array == following, axis=0)
    same[-1] &= closed
    if same.any():
        first = int(np.argmax(same))
        raise ValueError(
            f"every point of a Spline must differ from the next; points {first} and {(first + 1) % len(same)} are both "
            f"at {tuple(array[:, first].tolist())}. Leave one of them out."
        )
    array.flags.writeable = False
    return array
