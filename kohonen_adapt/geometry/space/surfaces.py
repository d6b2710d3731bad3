"""Surfaces on which nodes slide."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, FloatsPair
from kohonen_adapt.checks import check_fields, checked_points, finite_triple, is_number, positive_number

__all__ = [
    "Cone",
    "Cylinder",
    "NamedSurfaces",
    "Plane",
    "Sphere",
    "Surface",
    "across",
    "on_cone",
    "on_cylinder",
    "on_plane",
    "on_sphere",
]

ROUNDING = 1e-15  # distance below which points are on an axis, relative to the distance along the axis


class Surface(Protocol):
    def project(self, x: Floats) -> Floats:
        """Return the points of the surface nearest to `x`, shape (3, n)."""


NamedSurfaces = Mapping[str, Surface]  # by boundary name


@dataclass(frozen=True)
class Plane:
    """Infinite plane.

    Attributes
    ----------
    point
        Any point (x, y, z) of the plane.
    normal
        Normal vector of any length except 0.

    Raises
    ------
    ValueError
        If point or normal are not three finite numbers, or if the normal is zero.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Plane(point=(0.0, 0.0, 1.0), normal=(0.0, 0.0, 1.0)).project([[0.3], [0.2], [0.1]]).tolist()
    [[0.3], [0.2], [1.0]]
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def __post_init__(self) -> None:
        check_fields(self, point=finite_triple, normal=direction)

    def project(self, x: ArrayLike) -> Floats:
        """Return the points of the plane nearest to `x`.

        The projection is ``x - n ((x - a) . n)`` with the point a and the unit normal n.

        Parameters
        ----------
        x
            Points, shape (3, n).

        Returns
        -------
        ndarray of shape (3, n)
            Points of the plane.

        Raises
        ------
        ValueError
            If `x` has another shape or a coordinate is not finite.
        """
        return on_plane(checked_points(x, "x", 3).T, np.array(self.point), np.array(self.normal)).T


@dataclass(frozen=True)
class Sphere:
    """Sphere that carries faces of a boundary.

    The boundary may be a part of the sphere and ends where its faces end.

    Attributes
    ----------
    centre
        Point (x, y, z).
    radius
        Radius, positive.

    Raises
    ------
    ValueError
        If the centre is not finite, or the radius is not a positive number.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Sphere(centre=(0.0, 0.0, 0.0), radius=1.0).project([[2.0], [0.0], [0.0]]).tolist()
    [[1.0], [0.0], [0.0]]
    """

    centre: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        check_fields(self, centre=finite_triple, radius=positive_number)

    def project(self, x: ArrayLike) -> Floats:
        """Return the points of the sphere nearest to `x`.

        The projection is ``c + r (x - c) / |x - c|`` with the centre c and the radius r.

        Parameters
        ----------
        x
            Points, shape (3, n). The centre, equally near to all points of the sphere, is projected to ``c + (r, 0,
            0)``.

        Returns
        -------
        ndarray of shape (3, n)
            Points of the sphere.

        Raises
        ------
        ValueError
            If `x` has another shape or a coordinate is not finite.
        """
        return on_sphere(checked_points(x, "x", 3).T, np.array(self.centre), self.radius).T


@dataclass(frozen=True)
class Cylinder:
    """Circular cylinder, infinite on both sides.

    Attributes
    ----------
    point
        Any point (x, y, z) of the axis.
    axis
        Direction of the axis, a vector of any length except 0.
    radius
        Radius, positive.

    Raises
    ------
    ValueError
        If point or axis are not three finite numbers, the axis is zero, or the radius is not a positive number.

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
        check_fields(self, point=finite_triple, axis=direction, radius=positive_number)

    def project(self, x: ArrayLike) -> Floats:
        """Return the points of the cylinder nearest to `x`.

        The projection is ``f + r (x - f) / |x - f|`` with the radius r and the point f of the axis nearest to x.

        Parameters
        ----------
        x
            Points, shape (3, n). Points on the axis are all projected in the same direction.

        Returns
        -------
        ndarray of shape (3, n)
            Points of the cylinder.

        Raises
        ------
        ValueError
            If `x` has another shape or a coordinate is not finite.
        """
        rows = checked_points(x, "x", 3).T
        return on_cylinder(rows, np.array(self.point), np.array(self.axis), self.radius).T


@dataclass(frozen=True)
class Cone:
    """Circular cone from its apex to infinity.

    Attributes
    ----------
    apex
        Point (x, y, z).
    axis
        Direction from the apex into the cone, a vector of any length except 0.
    half_angle
        Angle between the axis and the cone in radians, above 0 and below pi/2.

    Raises
    ------
    ValueError
        If apex or axis are not three finite numbers, the axis is zero, or the angle is out of range.

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
        check_fields(self, apex=finite_triple, axis=direction)
        angle = self.half_angle
        if not (is_number(angle) and 0.0 < angle < 0.5 * pi):
            raise ValueError(f"half_angle of a Cone must be in radians, above 0 and below pi/2; got {angle!r}.")
        object.__setattr__(self, "half_angle", float(angle))

    def project(self, x: ArrayLike) -> Floats:
        """Return the points of the cone nearest to `x`.

        A point is projected onto the generator in the half-plane of the point and the axis, or onto the apex if the
        foot would be behind the apex.

        Parameters
        ----------
        x
            Points, shape (3, n). Points on the axis are all projected in the same direction.

        Returns
        -------
        ndarray of shape (3, n)
            Points of the cone.

        Raises
        ------
        ValueError
            If `x` has another shape or a coordinate is not finite.
        """
        rows = checked_points(x, "x", 3).T
        return on_cone(rows, np.array(self.apex), np.array(self.axis), self.half_angle).T


def direction(vector: ArrayLike, what: str) -> tuple[float, float, float]:
    direction_vector = np.array(finite_triple(vector, what))
    largest = np.abs(direction_vector).max()
    if largest == 0.0:
        raise ValueError(f"{what} must not be zero.")
    direction_vector /= largest  # no square may overflow
    x, y, z = (direction_vector / np.linalg.norm(direction_vector)).tolist()
    return x, y, z


# Projections of points x, (k, 3): origin and axis (3,) and a number as size, or (k, 3) and (k,) for k surfaces.


def on_plane(x: Floats, origin: Floats, axis: Floats) -> Floats:
    return x - axis * np.sum((x - origin) * axis, axis=1, keepdims=True)


def on_sphere(x: Floats, origin: Floats, size: Floats | float) -> Floats:
    return origin + np.reshape(size, (-1, 1)) * unit(x - origin, np.array([1.0, 0.0, 0.0]))


def on_cylinder(x: Floats, origin: Floats, axis: Floats, size: Floats | float) -> Floats:
    along, out = along_and_out(x, origin, axis)
    return origin + axis * along + np.reshape(size, (-1, 1)) * out[1]


def on_cone(x: Floats, origin: Floats, axis: Floats, size: Floats | float) -> Floats:
    along, (distance, out) = along_and_out(x, origin, axis)
    cos, sin = np.cos(np.reshape(size, (-1, 1))), np.sin(np.reshape(size, (-1, 1)))
    length = np.maximum(along * cos + distance * sin, 0.0)
    return origin + axis * (length * cos) + out * (length * sin)


def along_and_out(x: Floats, origin: Floats, axis: Floats) -> tuple[Floats, FloatsPair]:
    """Return coordinates along axes, distances from axes, and outward vectors.

    The shapes are (k, 1), (k, 1) and (k, 3). Outward vectors have length 1, also for points on the axis.
    """
    along = np.sum((x - origin) * axis, axis=1, keepdims=True)
    outward = x - origin - axis * along
    outward[np.linalg.norm(outward, axis=1) <= ROUNDING * np.abs(along[:, 0])] = 0.0
    outward -= axis * np.sum(outward * axis, axis=1, keepdims=True)
    return along, (np.linalg.norm(outward, axis=1, keepdims=True), unit(outward, across(axis)))


def across(axis: Floats) -> Floats:
    least = np.argmin(np.abs(axis), axis=-1)
    found = np.cross(axis, np.eye(3)[least])
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def unit(vectors: Floats, instead: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0.0, vectors, instead) / np.where(length > 0.0, length, 1.0)
