"""Interpolate points by a cubic spline, and project others on it."""

from collections.abc import Sequence
from itertools import chain
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PPoly
from scipy.spatial import cKDTree
from skfem import MeshTri
from skfem.mesh import MeshTri1

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import checked_points
from kohonen_adapt.mesh.curved import is_second_order
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.names import named
from kohonen_adapt.outline.curves import Arc
from kohonen_adapt.outline.cutting import fitted_circle
from kohonen_adapt.outline.polylines import polylines_of

__all__ = ["Spline"]

SAME = 1e-14  # of the length of a spline: points nearer to each other are one
FLAT = 1.0 / 100.0  # of its chord: what is between two samples is nowhere farther off it
FEWEST, CIRCULAR = 4, 1e-6  # points that show a circle, and how far off it they may be, of its radius
HALVINGS = 20  # at most, should the spline have a cusp
CHUNK = 256  # points that are looked up together: many samples may be about as near to each of them
EPSILON = np.finfo(float).eps
STEPS = 100  # of Newton's method; bisection alone takes 53


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
        """One curve of several pieces, not connected or with corners between them.

        Parameters
        ----------
        pieces
            At least one: its points (2, n) and whether it is closed.

        Returns
        -------
        Spline
            Which projects to the nearest of its pieces.

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
        """The spline through the nodes that a named boundary has now, of a `skfem.MeshTri2` mid-side nodes too.

        Made once from the first mesh, it keeps the geometry of that mesh however often nodes slide on it. The facets
        may lie on the rim or inside. They make several pieces where they are not connected, turn by 35 degrees or more,
        or where other than two of them meet; a loop without such a corner is closed.

        Parameters
        ----------
        mesh
            The mesh.
        name
            One of its boundaries.

        Returns
        -------
        Spline
            For `curves` of `kohonen_adapt.relocate` and `kohonen_adapt.adapt`.

        Raises
        ------
        ValueError
            If `mesh` is no `MeshTri` or `MeshTri2`, or the boundary is not there or empty.
        """
        if not (type(mesh) is MeshTri1 or is_second_order(mesh)):
            raise ValueError(f"mesh must be a skfem.MeshTri or MeshTri2; got {type(mesh).__name__}.")
        facets = np.unique(np.asarray(named(mesh.boundaries, name, "boundary"), dtype=np.int64))
        if len(facets) == 0:
            raise ValueError(f"boundary {name!r} has no facets, so there is no curve through their nodes.")
        number_facets(mesh)
        start, end = mesh.facets[:, facets]
        nodes = (start, mesh.nvertices + facets, end) if is_second_order(mesh) else (start, end)
        polylines = polylines_of(np.column_stack(nodes), mesh.p)
        return cls.of_pieces([(mesh.p[:, line.nodes], line.closed) for line in polylines])

    def as_arc(self) -> Arc | None:
        """The circle that all points are on, where there are four and more and they are.

        Returns
        -------
        Arc or None
            None where they are farther off it than 1e-6 of its radius.
        """
        points = np.concatenate(self.pieces, axis=1).T
        x, y, radius = fitted_circle(points, np.arange(len(points)), 0, len(points) - 1)
        off = np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius)
        return Arc((x, y), radius) if len(points) >= FEWEST and off.max() <= CIRCULAR * radius < np.inf else None

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
        self._samples = _sampled([points - self._origin for points in self.pieces], self.closed)

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
        Around every sample of the spline that is nearer than its neighbours, and not too far to matter, the root of
        ``(c(t) - x) . c'(t)`` is found by Newton's method, with bisection where that fails.
        """
        off = (checked_points(x, "x") - self._origin).T
        found = [_nearest(self._samples, off[start : start + CHUNK]) for start in range(0, len(off), CHUNK)]
        return np.concatenate([np.empty((0, 2)), *found]).T + self._origin


class Samples(NamedTuple):
    """Points all along a piecewise cubic curve c(t), which is nearly straight between neighbours."""

    curve: PPoly  # the pieces one after another, each with a stretch beyond its end that is not part of it
    t: Floats  # (s,) ascending
    before: Ints  # (s,) the neighbours on the same piece, a sample itself at its ends
    after: Ints
    point: Floats  # (s, 2)
    reach: float  # no point of the curve is farther from the nearest sample
    tree: cKDTree


def _sampled(pieces: Sequence[Floats], closed: Sequence[bool]) -> Samples:
    """The spline through all pieces, (2, n) each.

    The parameter is the length of the chords as part of all of them, so that nothing depends on the unit of length.
    """
    points = [
        np.append(piece, piece[:, :1], axis=1) if loop else piece for piece, loop in zip(pieces, closed, strict=True)
    ]
    chords = [np.sqrt(_squared(np.diff(piece.T, axis=0))) for piece in points]
    total, start = np.sum(np.concatenate(chords)), 0.0
    cubics, knots, parameters, reach = [], [], [], 0.0
    for piece, chord, loop in zip(points, chords, closed, strict=True):
        own = np.append(0.0, np.cumsum(chord)) / total
        spline = CubicSpline(own, piece.T, bc_type="periodic" if loop else "not-a-knot")
        beyond = [spline(own[-1], order) / factorial(order) for order in (3, 2, 1)]
        cubics += [spline.c, np.stack([*beyond, piece[:, -1]])[:, None]]
        t, far = _refined(spline, own)
        knots.append(start + own)
        parameters.append(start + t)
        start, reach = knots[-1][-1] + 1.0 / len(points), max(reach, far)
    curve = PPoly(np.concatenate(cubics, axis=1), np.append(np.concatenate(knots), start))
    t, first = np.concatenate(parameters), np.cumsum([0, *map(len, parameters)])
    before, after = np.arange(len(t)) - 1, np.arange(len(t)) + 1
    before[first[:-1]] += 1
    after[first[1:] - 1] -= 1
    return Samples(curve, t, before, after, curve(t), reach, cKDTree(curve(t)))


def _refined(spline: CubicSpline, t: Floats) -> tuple[Floats, float]:
    """Parameters between which a piece is nearly straight, halved from given ones, and its reach as of `Samples`.

    The curve is off a chord by an eighth of its second derivative at most, which is largest at an end.
    """
    for _ in range(HALVINGS):
        chord, bend = np.sqrt(_squared(np.diff(spline(t), axis=0))), np.sqrt(_squared(spline(t, 2)))
        bulge = 0.125 * np.diff(t) ** 2 * np.maximum(bend[1:], bend[:-1])
        bent = bulge > FLAT * chord
        if not bent.any():
            break
        t = np.sort(np.append(t, 0.5 * (t[1:] + t[:-1])[bent]))
    return t, float(np.max(0.5 * chord + bulge))


def _nearest(samples: Samples, x: Floats) -> Floats:
    """The nearest points of a curve to given ones, (n, 2) for (n, 2)."""
    near, _ = samples.tree.query(x)
    within = samples.tree.query_ball_point(x, near + samples.reach)
    row = np.repeat(np.arange(len(x)), [len(found) for found in within])
    at = np.fromiter(chain.from_iterable(within), np.int64, len(row))
    here, *beside = (_squared(samples.point[i] - x[row]) for i in (at, samples.before[at], samples.after[at]))
    least = here <= np.minimum(*beside)
    row, at = row[least], at[least]
    foot = _feet(samples, at, x[row])
    order = np.lexsort((at, _squared(foot - x[row]), row))
    return foot[order[np.searchsorted(row, np.arange(len(x)))]]


def _feet(samples: Samples, at: Ints, x: Floats) -> Floats:
    """The nearest point to x (k, 2) beside each of the samples `at` (k,)."""
    low, t, high = samples.t[samples.before[at]], samples.t[at], samples.t[samples.after[at]]
    settled = np.zeros(len(at), dtype=bool)
    for _ in range(STEPS):
        off, along, bend = samples.curve(t) - x, samples.curve(t, 1), samples.curve(t, 2)
        rate, change = np.sum(off * along, axis=1), np.sum(along**2 + off * bend, axis=1)
        low, high = np.where(rate > 0.0, low, t), np.where(rate > 0.0, t, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = t - rate / change
        better = np.where((change > 0.0) & (low <= newton) & (newton <= high), newton, 0.5 * (low + high))
        # What has settled stays, so that no point has a say in what becomes of another.
        t, settled = np.where(settled, t, better), settled | (np.abs(better - t) <= EPSILON)
        if settled.all():
            break
    return samples.curve(t)


def _squared(vectors: Floats) -> Floats:
    """Squares of the lengths of the rows."""
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
