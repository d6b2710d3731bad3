"""Cubic splines through points, and the projection onto them."""

from collections.abc import Sequence
from itertools import chain
from math import factorial
from typing import NamedTuple

import numpy as np
import scipy  # loads `scipy.interpolate` at its first use
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree
from skfem import MeshTri
from skfem.mesh import MeshTri1

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import checked_points
from kohonen_adapt.geometry.circles import sphere_through
from kohonen_adapt.geometry.plane.curves import Arc
from kohonen_adapt.geometry.plane.polylines import polylines_of
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.names import named

__all__ = ["Spline"]

SAME = 1e-14  # maximum distance of equal points, relative to the length of the spline
FLAT = 1.0 / 100.0  # maximum distance of the curve from the chord between two samples, relative to the chord
FEWEST, CIRCULAR = 4, 1e-6  # minimum number of points of a circle, and their maximum distance relative to the radius
HALVINGS = 20  # maximum number of halvings, reached at a cusp
CHUNK = 256  # number of points per call: each may have many samples that are almost equally near
EPSILON = np.finfo(float).eps
STEPS = 100  # maximum iterations of Newton's method; bisection alone takes 53


class Spline:
    """Cubic spline through points in order, or several splines as one curve.

    First and second derivative are continuous. The parameter is the length of the chords. At open ends the third
    derivative is continuous at the second point ("not a knot"; C. de Boor, *A Practical Guide to Splines*, Springer
    2001, chapter IV). So two points make a straight line, three a parabola, and the distance to a smooth curve
    decreases with the fourth power of the spacing.

    Parameters
    ----------
    points
        At least two points, shape (2, n), each different from the next.
    closed
        Continue smoothly from the last point to the first. At least three points are required then.

    Attributes
    ----------
    pieces
        Points of every piece, shape (2, n). A spline made from points has one piece.
    closed
        Tuple of bool, True for closed pieces.

    Raises
    ------
    ValueError
        If there are too few points, a coordinate is not finite, or two successive points are equal.

    Examples
    --------
    >>> import numpy as np, kohonen_adapt as ka
    >>> angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    >>> circle = ka.Spline([np.cos(angle), np.sin(angle)], closed=True)
    >>> np.hypot(*circle.project([[2.0], [1.0]])).round(6).tolist()
    [1.0]
    """

    def __init__(self, points: ArrayLike, *, closed: bool = False) -> None:
        self._lay([(points, closed)])

    @classmethod
    def of_pieces(cls, pieces: Sequence[tuple[ArrayLike, bool]]) -> "Spline":
        """Return one curve of several splines.

        The pieces may be apart from each other or meet at corners.

        Parameters
        ----------
        pieces
            At least one piece: its points, shape (2, n), and True if closed.

        Returns
        -------
        Spline
            Curve that projects onto the nearest piece.

        Raises
        ------
        ValueError
            If there is no piece, or if the points of a piece are not valid for a `Spline`.
        """
        spline = object.__new__(cls)
        spline._lay(pieces)
        return spline

    @classmethod
    def through(cls, mesh: MeshTri, name: str) -> "Spline":
        """Return the spline through the nodes of a named boundary.

        The midside nodes of a `skfem.MeshTri2` are included. A spline through the nodes of the first mesh preserves
        the geometry however often nodes slide on the spline.

        The facets of the boundary may be on the outer boundary or inside the mesh. There are several pieces if the
        facets are not connected, turn by 35 degrees or more, or if other than two of them meet in a node. A loop
        without such a corner is closed.

        Parameters
        ----------
        mesh
            Mesh of triangles.
        name
            Name of a boundary.

        Returns
        -------
        Spline
            Curve for the argument `curves` of `kohonen_adapt.relocate` and `kohonen_adapt.adapt`.

        Raises
        ------
        ValueError
            If `mesh` is no `MeshTri` or `MeshTri2`, or if the boundary does not exist or is empty.
        """
        if not (type(mesh) is MeshTri1 or is_second_order(mesh)):
            raise ValueError(f"mesh must be a skfem.MeshTri or MeshTri2; got {type(mesh).__name__}.")
        facets = np.unique(np.asarray(named(mesh.boundaries, name, "boundary"), np.int64))
        if len(facets) == 0:
            raise ValueError(f"boundary {name!r} has no facets, so there is no curve through their nodes.")
        number_facets(mesh)
        start, end = mesh.facets[:, facets]
        nodes = (start, mesh.nvertices + facets, end) if is_second_order(mesh) else (start, end)
        polylines = polylines_of(np.column_stack(nodes), mesh.p)
        return cls.of_pieces([(mesh.p[:, line.nodes], line.closed) for line in polylines])

    def as_arc(self) -> Arc | None:
        """Return the circle on which all points lie, or None.

        Returns
        -------
        Arc or None
            None if there are fewer than four points, or if one is farther from the circle than 1e-6 of the radius.
        """
        points = np.concatenate(self.pieces, axis=1).T
        circle = sphere_through(points, CIRCULAR) if len(points) >= FEWEST else None
        return circle and Arc(tuple(circle[0]), circle[1])

    def __repr__(self) -> str:
        count = sum(points.shape[1] for points in self.pieces)
        return f"<Spline of {len(self.pieces)} piece{'s' * (len(self.pieces) > 1)} through {count} points>"

    def _lay(self, pieces: Sequence[tuple[ArrayLike, bool]]) -> None:
        if len(pieces) == 0:
            raise ValueError("a Spline must have at least one piece; got none.")
        self.pieces = tuple(_checked_piece(points, closed) for points, closed in pieces)
        self.closed = tuple(bool(closed) for _, closed in pieces)
        # Relative to the first point, coordinates far from the origin lose no digits.
        self._origin = self.pieces[0][:, :1]
        self._samples = _sampled([points - self._origin for points in self.pieces], self.closed)

    def project(self, x: ArrayLike) -> Floats:
        """Return the points of the spline nearest to `x`, ends included.

        Points are exact to rounding. If two points of the spline are almost equally near, either is returned.

        Parameters
        ----------
        x
            Points, shape (2, n).

        Returns
        -------
        ndarray of shape (2, n)
            Points of the spline.

        Raises
        ------
        ValueError
            If `x` has another shape or a coordinate is not finite.

        Notes
        -----
        Around every sample of the spline that is nearer to a point x than its neighbours, and near enough to matter,
        the root of ``(c(t) - x) . c'(t)`` is found by Newton's method, with bisection where Newton's method fails.
        """
        offset = (checked_points(x, "x") - self._origin).T
        found = [_nearest(self._samples, offset[start : start + CHUNK]) for start in range(0, len(offset), CHUNK)]
        return np.concatenate([np.empty((0, 2)), *found]).T + self._origin


class Samples(NamedTuple):
    curve: "scipy.interpolate.PPoly"  # pieces in a row, each followed by an interval that is no part of the curve
    t: Floats  # (s,) ascending
    before: Ints  # (s,) neighbours on the same piece; at its ends the sample itself
    after: Ints
    point: Floats  # (s, 2)
    reach: float  # largest distance of a point of the curve from the nearest sample
    tree: cKDTree


def _sampled(pieces: Sequence[Floats], closed: Sequence[bool]) -> Samples:
    points = [np.append(piece, piece[:, : int(loop)], axis=1).T for piece, loop in zip(pieces, closed, strict=True)]
    chords = [np.sqrt(_squared(np.diff(piece, axis=0))) for piece in points]
    total = np.sum(np.concatenate(chords))
    start = 0.0
    cubics = []
    knots = []
    parameters = []
    reach = 0.0
    for piece, chord, loop in zip(points, chords, closed, strict=True):
        own = np.append(0.0, np.cumsum(chord)) / total
        spline = scipy.interpolate.CubicSpline(own, piece, bc_type="periodic" if loop else "not-a-knot")
        at_end = [spline(own[-1], order) / factorial(order) for order in (3, 2, 1)]
        cubics += [spline.c, np.stack([*at_end, piece[-1]])[:, None]]
        t, far = _refined(spline, own)
        knots.append(start + own)
        parameters.append(start + t)
        start = knots[-1][-1] + 1.0 / len(points)
        reach = max(reach, far)
    curve = scipy.interpolate.PPoly(np.concatenate(cubics, axis=1), np.append(np.concatenate(knots), start))
    t, first = np.concatenate(parameters), np.cumsum([0, *map(len, parameters)])
    before, after = np.arange(len(t)) - 1, np.arange(len(t)) + 1
    before[first[:-1]] += 1
    after[first[1:] - 1] -= 1
    return Samples(curve, t, before, after, curve(t), reach, cKDTree(curve(t)))


def _refined(spline: "scipy.interpolate.CubicSpline", t: Floats) -> tuple[Floats, float]:
    """Return parameters between which a piece is nearly straight, and the reach.

    The distance of the curve from a chord is at most an eighth of the second derivative times the squared interval. The
    reach is the largest distance of a point of the curve from the nearest sample.
    """
    for _ in range(HALVINGS):
        chord, second_derivative = np.sqrt(_squared(np.diff(spline(t), axis=0))), np.sqrt(_squared(spline(t, 2)))
        sagitta = 0.125 * np.diff(t) ** 2 * np.maximum(second_derivative[1:], second_derivative[:-1])
        coarse = sagitta > FLAT * chord
        if not coarse.any():
            break
        t = np.sort(np.append(t, 0.5 * (t[1:] + t[:-1])[coarse]))
    return t, float(np.max(0.5 * chord + sagitta))


def _nearest(samples: Samples, x: Floats) -> Floats:
    near, _ = samples.tree.query(x)
    within = samples.tree.query_ball_point(x, near + samples.reach)
    row = np.repeat(np.arange(len(x)), [len(found) for found in within])
    at = np.fromiter(chain.from_iterable(within), np.int64, len(row))
    here, *neighbours = (_squared(samples.point[i] - x[row]) for i in (at, samples.before[at], samples.after[at]))
    least = here <= np.minimum(*neighbours)
    row, at = row[least], at[least]
    foot = _feet(samples, at, x[row])
    order = np.lexsort((at, _squared(foot - x[row]), row))
    return foot[order[np.searchsorted(row, np.arange(len(x)))]]


def _feet(samples: Samples, at: Ints, x: Floats) -> Floats:
    low, t, high = samples.t[samples.before[at]], samples.t[at], samples.t[samples.after[at]]
    converged = np.zeros(len(at), bool)
    for _ in range(STEPS):
        offset = samples.curve(t) - x
        tangent = samples.curve(t, 1)
        second_derivative = samples.curve(t, 2)
        rate, change = np.sum(offset * tangent, axis=1), np.sum(tangent**2 + offset * second_derivative, axis=1)
        low, high = np.where(rate > 0.0, low, t), np.where(rate > 0.0, t, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = t - rate / change
        better = np.where((change > 0.0) & (low <= newton) & (newton <= high), newton, 0.5 * (low + high))
        # Converged parameters stay, so that no point influences the projection of another point.
        t, converged = np.where(converged, t, better), converged | (np.abs(better - t) <= EPSILON)
        if converged.all():
            break
    return samples.curve(t)


def _squared(vectors: Floats) -> Floats:
    return np.sum(vectors**2, axis=1)


def _checked_piece(points: ArrayLike, closed: bool) -> Floats:
    array = checked_points(points, "points of a Spline")
    least = 3 if closed else 2
    if array.shape[1] < least:
        kind = "a closed" if closed else "an open"
        raise ValueError(f"{kind} Spline must have at least {least} points; got {array.shape[1]}.")
    gap = np.sqrt(np.sum((np.roll(array, -1, axis=1) - array) ** 2, axis=0))
    same = (gap <= SAME * gap.sum())[: None if closed else -1]
    if same.any():
        first = int(np.argmax(same))
        raise ValueError(
            f"every point of a Spline must differ from the next; points {first} and {(first + 1) % array.shape[1]} are "
            f"both at {tuple(array[:, first].tolist())}. Leave one of them out."
        )
    array.flags.writeable = False
    return array
