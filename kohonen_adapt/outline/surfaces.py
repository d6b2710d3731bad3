"""Project points on the surfaces that nodes may slide on: planes, spheres, cylinders, cones and any with `project`."""

from dataclasses import dataclass
from math import isfinite, pi
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import checked_points, finite_triple, is_number

__all__ = [
    "Cone",
    "Cylinder",
    "Plane",
    "Sphere",
    "Surface",
    "across",
    "on_cone",
    "on_cylinder",
    "on_plane",
    "on_sphere",
]

ROUNDING = 1e-15  # of the distance along an axis: a point nearer to it is on it


class Surface(Protocol):
    """A surface that a boundary may be given."""

    def project(self, x: Floats) -> Floats:
        """The points of the surface nearest to x, (3, n)."""


@dataclass(frozen=True)
class Plane:
    """A plane, without end.

    Attributes
    ----------
    point
        Any point (x, y, z) of it.
    normal
        A vector across it, of any length but zero.

    Raises
    ------
    ValueError
        If they are not three finite numbers each, or the normal is zero.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Plane(point=(0.0, 0.0, 1.0), normal=(0.0, 0.0, 1.0)).project([[0.3], [0.2], [0.1]]).tolist()
    [[0.3], [0.2], [1.0]]
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", finite_triple(self.point, "point of a Plane"))
        object.__setattr__(self, "normal", direction(self.normal, "normal of a Plane"))

    def project(self, x: ArrayLike) -> Floats:
        """The nearest points of the plane, ``x - n ((x - a) . n)`` with the unit normal n.

        Parameters
        ----------
        x
            (3, n): any points.

        Returns
        -------
        ndarray (3, n)
            Points of the plane.

        Raises
        ------
        ValueError
            If `x` has another shape or holds a value that is not finite.
        """
        return on_plane(checked_points(x, "x", 3).T, np.array(self.point), np.array(self.normal)).T


@dataclass(frozen=True)
class Sphere:
    """A sphere; on it, a patch ends where its faces do.

    Attributes
    ----------
    centre
        (x, y, z).
    radius
        Above zero.

    Raises
    ------
    ValueError
        If the centre is not finite, or the radius not a positive number.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Sphere(centre=(0.0, 0.0, 0.0), radius=1.0).project([[2.0], [0.0], [0.0]]).tolist()
    [[1.0], [0.0], [0.0]]
    """

    centre: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", finite_triple(self.centre, "centre of a Sphere"))
        object.__setattr__(self, "radius", positive(self.radius, "radius of a Sphere"))

    def project(self, x: ArrayLike) -> Floats:
        """The nearest points of the sphere, ``c + r (x - c) / |x - c|``.

        Parameters
        ----------
        x
            (3, n): any points. From the centre all points of the sphere are equally near; it goes to ``c + (r, 0, 0)``.

        Returns
        -------
        ndarray (3, n)
            Points of the sphere.

        Raises
        ------
        ValueError
            If `x` has another shape or holds a value that is not finite.
        """
        return on_sphere(checked_points(x, "x", 3).T, np.array(self.centre), self.radius).T


@dataclass(frozen=True)
class Cylinder:
    """A circular cylinder, without end on both sides.

    Attributes
    ----------
    point
        Any point (x, y, z) of its axis.
    axis
        Direction of the axis, of any length but zero.
    radius
        Above zero.

    Raises
    ------
    ValueError
        If point and axis are not three finite numbers each, the axis is zero, or the radius not a positive number.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Cylinder(point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0), radius=1.0).project([[3.0], [0.0], [7.0]]).tolist()
    [[1.0], [0.0], [7.0]]
    """

    point: tuple[float, float, float]
    axis: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", finite_triple(self.point, "point of a Cylinder"))
        object.__setattr__(self, "axis", direction(self.axis, "axis of a Cylinder"))
        object.__setattr__(self, "radius", positive(self.radius, "radius of a Cylinder"))

    def project(self, x: ArrayLike) -> Floats:
        """The nearest points of the cylinder, ``f + r (x - f) / |x - f|`` with the point f of the axis nearest to x.

        Parameters
        ----------
        x
            (3, n): any points. Those on the axis all go the same way.

        Returns
        -------
        ndarray (3, n)
            Points of the cylinder.

        Raises
        ------
        ValueError
            If `x` has another shape or holds a value that is not finite.
        """
        rows = checked_points(x, "x", 3).T
        return on_cylinder(rows, np.array(self.point), np.array(self.axis), self.radius).T


@dataclass(frozen=True)
class Cone:
    """A circular cone from its apex on, without end on the other side.

    Attributes
    ----------
    apex
        (x, y, z).
    axis
        Direction from the apex into the cone, of any length but zero.
    half_angle
        Between the axis and the cone, in radians, above 0 and below pi/2.

    Raises
    ------
    ValueError
        If apex and axis are not three finite numbers each, the axis is zero, or the angle out of range.

    Examples
    --------
    >>> import numpy as np, kohonen_adapt as ka
    >>> cone = ka.Cone(apex=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), half_angle=np.pi / 4)
    >>> cone.project([[2.0], [0.0], [0.0]]).round(12).tolist()
    [[1.0], [0.0], [1.0]]
    """

    apex: tuple[float, float, float]
    axis: tuple[float, float, float]
    half_angle: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "apex", finite_triple(self.apex, "apex of a Cone"))
        object.__setattr__(self, "axis", direction(self.axis, "axis of a Cone"))
        angle = self.half_angle
        if not (is_number(angle) and 0.0 < angle < 0.5 * pi):
            raise ValueError(f"half_angle of a Cone must be in radians, above 0 and below pi/2; got {angle!r}.")
        object.__setattr__(self, "half_angle", float(angle))

    def project(self, x: ArrayLike) -> Floats:
        """The nearest points of the cone, on the generator in the plane of x and the axis; the apex, if behind it.

        Parameters
        ----------
        x
            (3, n): any points. Those on the axis all go the same way.

        Returns
        -------
        ndarray (3, n)
            Points of the cone.

        Raises
        ------
        ValueError
            If `x` has another shape or holds a value that is not finite.
        """
        rows = checked_points(x, "x", 3).T
        return on_cone(rows, np.array(self.apex), np.array(self.axis), self.half_angle).T


def direction(vector: ArrayLike, what: str) -> tuple[float, float, float]:
    """A vector of length 1 along one that is not zero; `what` it is begins the message."""
    given = np.array(finite_triple(vector, what))
    largest = np.abs(given).max()
    if largest == 0.0:
        raise ValueError(f"{what} must not be zero.")
    given /= largest  # so that no square overflows
    x, y, z = (given / np.linalg.norm(given)).tolist()
    return x, y, z


def positive(number: Any, what: str) -> float:
    """A number above zero; `what` it is begins the message."""
    if not (is_number(number) and isfinite(number) and number > 0.0):
        raise ValueError(f"{what} must be a positive number; got {number!r}.")
    return float(number)


# Of points x (k, 3), of one surface or of one for each: origin and axis (3,) or (k, 3), size a number or (k,).


def on_plane(x: Floats, origin: Floats, axis: Floats) -> Floats:
    """The points of planes nearest to x."""
    return x - axis * np.sum((x - origin) * axis, axis=1, keepdims=True)


def on_sphere(x: Floats, origin: Floats, size: Floats | float) -> Floats:
    """The points of spheres nearest to x."""
    return origin + np.reshape(size, (-1, 1)) * unit(x - origin, np.array([1.0, 0.0, 0.0]))


def on_cylinder(x: Floats, origin: Floats, axis: Floats, size: Floats | float) -> Floats:
    """The points of cylinders nearest to x."""
    along, out = along_and_out(x, origin, axis)
    return origin + axis * along + np.reshape(size, (-1, 1)) * out[1]


def on_cone(x: Floats, origin: Floats, axis: Floats, size: Floats | float) -> Floats:
    """The points of cones nearest to x."""
    along, (distance, out) = along_and_out(x, origin, axis)
    cos, sin = np.cos(np.reshape(size, (-1, 1))), np.sin(np.reshape(size, (-1, 1)))
    length = np.maximum(along * cos + distance * sin, 0.0)
    return origin + axis * (length * cos) + out * (length * sin)


def along_and_out(x: Floats, origin: Floats, axis: Floats) -> tuple[Floats, tuple[Floats, Floats]]:
    """How far points are along axes, (k, 1), how far off them, (k, 1), and the directions away from them, (k, 3)."""
    along = np.sum((x - origin) * axis, axis=1, keepdims=True)
    off = x - origin - axis * along
    off[np.linalg.norm(off, axis=1) <= ROUNDING * np.abs(along[:, 0])] = 0.0
    off -= axis * np.sum(off * axis, axis=1, keepdims=True)
    return along, (np.linalg.norm(off, axis=1, keepdims=True), unit(off, across(axis)))


def across(axis: Floats) -> Floats:
    """A direction at right angles to each of these, of (3,) or (k, 3)."""
    least = np.argmin(np.abs(axis), axis=-1)
    found = np.cross(axis, np.eye(3)[least])
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def unit(vectors: Floats, instead: Floats) -> Floats:
    """Vectors (k, 3) of length 1, others instead of zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0.0, vectors, instead) / np.where(length > 0.0, length, 1.0)
