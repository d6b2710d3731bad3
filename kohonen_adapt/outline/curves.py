"""Curves that nodes may slide on: lines, circles and splines, each with its nearest point to any point."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri
from skfem.mesh import MeshTri1

from kohonen_adapt.arrays import Floats
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.outline.polylines import polylines_of
from kohonen_adapt.outline.spans import Spans, cubics_through

__all__ = ["Arc", "Line", "Spline"]


SAME = 1e-14  # of the length of a spline: points nearer to each other are one


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

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Line((0.0, 0.0), (1.0, 0.0)).project([[0.3], [0.2]]).tolist()
    [[0.3], [0.0]]
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

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Arc(centre=(0.0, 0.0), radius=1.0).project([[2.0], [0.0]]).tolist()
    [[1.0], [0.0]]
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

        Returns
        -------
        Spline
            For `curves` of `kohonen_adapt.relocate` and `kohonen_adapt.adapt`.

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
        number_facets(mesh)
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
        pairs = zip(self.pieces, self.closed, strict=True)
        cubics = [cubics_through(points - self._origin, closed) for points, closed in pairs]
        self._spans = Spans.of(np.concatenate(cubics, axis=2))

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
        return self._spans.nearest(_checked_points(x, "x") - self._origin) + self._origin


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
