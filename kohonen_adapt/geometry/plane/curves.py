"""Lines, arcs and user-defined curves on which nodes slide."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import check_fields, checked_points, finite_point, positive_number

__all__ = ["NEAR", "Arc", "Curve", "Curves", "Line", "check_near", "curve_of_facets", "projected", "size_of"]

KINDS = {2: "curve", 3: "surface"}  # word for the shape of a boundary in messages, by dimension
NEAR = 1e-3  # maximum distance of nodes from their curve, relative to the size of the boundary


class Curve(Protocol):
    def project(self, x: Floats) -> Floats:
        """Return the points of the curve nearest to `x`, shape (2, n)."""


Curves = Mapping[str, Curve]  # by boundary name


@dataclass(frozen=True)
class Line:
    """Straight line through two points, infinite on both sides.

    Attributes
    ----------
    start, end
        Two different points (x, y).

    Raises
    ------
    ValueError
        If the points are equal or a coordinate is not finite.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Line((0.0, 0.0), (1.0, 0.0)).project([[0.3], [0.2]]).tolist()
    [[0.3], [0.0]]
    """

    start: tuple[float, float]
    end: tuple[float, float]

    def __post_init__(self) -> None:
        check_fields(self, start=finite_point, end=finite_point)
        if self.start == self.end:
            raise ValueError(f"start and end of a Line must be two different points; got {self.start} twice.")

    def project(self, x: ArrayLike) -> Floats:
        """Return the points of the line nearest to `x`.

        The projection is ``a + (b - a) ((x - a) . (b - a)) / |b - a|^2`` with a = `start`, b = `end`.

        Parameters
        ----------
        x
            Points, shape (2, n).

        Returns
        -------
        ndarray of shape (2, n)
            Points of the line, possibly outside the section from `start` to `end`.

        Raises
        ------
        ValueError
            If `x` has another shape or a coordinate is not finite.
        """
        x = checked_points(x, "x")
        start, end = np.array([self.start, self.end])[:, :, None]
        along = end - start
        return start + along * (np.sum((x - start) * along, axis=0) / np.sum(along**2))


@dataclass(frozen=True)
class Arc:
    """Circle that carries an arc of a boundary.

    The facets of the boundary determine where the arc begins and ends.

    Attributes
    ----------
    centre
        Point (x, y).
    radius
        Radius, positive.

    Raises
    ------
    ValueError
        If the centre is not finite, or the radius is not a positive number.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Arc(centre=(0.0, 0.0), radius=1.0).project([[2.0], [0.0]]).tolist()
    [[1.0], [0.0]]
    """

    centre: tuple[float, float]
    radius: float

    def __post_init__(self) -> None:
        check_fields(self, centre=finite_point, radius=positive_number)

    def project(self, x: ArrayLike) -> Floats:
        """Return the points of the circle nearest to `x`.

        The projection is ``c + r (x - c) / |x - c|`` with the centre c and the radius r.

        Parameters
        ----------
        x
            Points, shape (2, n). The centre, equally near to all points of the circle, is projected to ``c + (r, 0)``.

        Returns
        -------
        ndarray of shape (2, n)
            Points of the circle.

        Raises
        ------
        ValueError
            If `x` has another shape or a coordinate is not finite.
        """
        centre = np.array(self.centre)[:, None]
        offset = checked_points(x, "x") - centre
        distance = np.sqrt(np.sum(offset**2, axis=0))
        offset[:, distance == 0.0] = [[1.0], [0.0]]
        distance[distance == 0.0] = 1.0
        return centre + self.radius * (offset / distance)


def projected(curve: Curve, points: Floats, name: str) -> Floats:
    found = np.asarray(curve.project(points.T.copy()), np.float64)
    wrong = np.sum(~np.isfinite(found))
    if found.shape != points.shape[::-1] or wrong:
        raise ValueError(
            f"project of the {KINDS[points.shape[1]]} of boundary {name!r} must return finite points of shape "
            f"{points.shape[::-1]}; "
            f"got shape {found.shape}, {wrong} coordinates not finite."
        )
    return np.ascontiguousarray(found.T)


def check_near(nodes: Floats, curve: Curve, name: str) -> None:
    distance = np.sqrt(np.sum((nodes - projected(curve, nodes, name)) ** 2, axis=1))
    largest = distance.max()
    size = size_of(nodes)
    kind = KINDS[nodes.shape[1]]
    if largest > NEAR * size:
        text = ", ".join(f"{coordinate:.6g}" for coordinate in nodes[np.argmax(distance)])
        raise ValueError(
            f"the nodes of boundary {name!r} must lie on the {kind} given for it, within {NEAR:g} of its size, "
            f"{size:.6g} in units of the mesh; the one at ({text}) is {largest:.6g} away. Give the {kind} "
            "that the mesh was made with, in the same unit."
        )


def size_of(nodes: Floats) -> float:
    return float(np.max(np.ptp(nodes, axis=0)))


def curve_of_facets(sides: Mapping[str, Ints], count: int, curves: Curves, kind: str = "curve") -> Ints:
    """Return the index in `curves` of the shape of every facet, -1 for none, (f,)."""
    found, names = np.full(count, -1), list(curves)
    for number, name in enumerate(names):
        on = sides[name] > 0
        twice = on & (found >= 0)
        if twice.any():
            other = names[found[np.flatnonzero(twice)[0]]]
            raise ValueError(
                f"boundaries {other!r} and {name!r} share facets, so they cannot both have a {kind}; leave one out."
            )
        found[on] = number
    return found
