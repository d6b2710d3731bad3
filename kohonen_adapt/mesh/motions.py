"""Rigid motions of the plane, for pairs of periodic boundaries."""

from dataclasses import dataclass
from math import cos, hypot, isfinite, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import check_fields, finite_point, is_number

__all__ = ["Motion", "Pair", "Reflection", "Rotation", "Translation", "inverse", "is_proper", "motion_of", "moved"]

ROUNDING = 1e-12  # rounding error of a computed motion, in radians and relative to the size of the mesh
GLIDE = 1e-8  # maximum glide of a reflection along its line, relative to the size of the mesh


@dataclass(frozen=True)
class Rotation:
    """Rotation by an angle about a point.

    A point x is mapped to ``c + R (x - c)``.

    Attributes
    ----------
    angle
        In radians, counter-clockwise positive.
    centre
        Point (x, y), in mesh units.

    Raises
    ------
    ValueError
        If the angle is not a finite number, or the centre not two finite numbers.

    Examples
    --------
    >>> import numpy as np, kohonen_adapt as ka
    >>> ka.Rotation(np.pi / 2, centre=(1.0, 0.0)).matrix.round(12).tolist()  # [R | c - R c]
    [[0.0, -1.0, 1.0], [1.0, 0.0, -1.0]]
    """

    angle: float
    centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not is_number(self.angle) or not isfinite(self.angle):
            raise ValueError(f"angle of a Rotation must be a finite number in radians; got {self.angle!r}.")
        object.__setattr__(self, "angle", float(self.angle))
        check_fields(self, centre=finite_point)

    @property
    def matrix(self) -> Floats:
        """Matrix [A | b] of ``x -> A x + b``, (2, 3)."""
        cosine, sine = cos(self.angle), sin(self.angle)
        turn = np.array([[cosine, -sine], [sine, cosine]])
        return np.column_stack([turn, self.centre - turn @ self.centre])


@dataclass(frozen=True)
class Translation:
    """Translation by a vector.

    A point x is mapped to ``x + v``.

    Attributes
    ----------
    vector
        Vector (x, y), in mesh units.

    Raises
    ------
    ValueError
        If the vector is not two finite numbers.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Translation((2.0, 0.0)).matrix.tolist()
    [[1.0, 0.0, 2.0], [0.0, 1.0, 0.0]]
    """

    vector: tuple[float, float]

    def __post_init__(self) -> None:
        check_fields(self, vector=finite_point)

    @property
    def matrix(self) -> Floats:
        """Matrix [A | b] of ``x -> A x + b``, (2, 3)."""
        return np.column_stack([np.eye(2), self.vector])


@dataclass(frozen=True)
class Reflection:
    """Reflection in the line through a point.

    A point x is mapped to ``x - 2 n n . (x - p)`` with the unit normal n.

    Attributes
    ----------
    point
        Point (x, y) on the line, in mesh units.
    normal
        Vector (x, y) normal to the line, of any length above zero.

    Raises
    ------
    ValueError
        If an attribute is not two finite numbers, or if the normal is zero.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Reflection(point=(1.0, 0.0), normal=(2.0, 0.0)).matrix.tolist()
    [[-1.0, 0.0, 2.0], [0.0, 1.0, 0.0]]
    """

    point: tuple[float, float]
    normal: tuple[float, float]

    def __post_init__(self) -> None:
        check_fields(self, point=finite_point, normal=finite_point)
        if hypot(*self.normal) == 0.0:
            raise ValueError("normal of a Reflection must have a direction; got (0, 0).")

    @property
    def matrix(self) -> Floats:
        """Matrix [A | b] of ``x -> A x + b``, (2, 3)."""
        normal = np.array(self.normal) / hypot(*self.normal)
        return np.column_stack([np.eye(2) - 2.0 * np.outer(normal, normal), 2.0 * normal * (normal @ self.point)])


Motion = Rotation | Translation | Reflection

# Names of two boundaries, with the motion that maps the first onto the second if several motions would.
Pair = tuple[str, str] | tuple[str, str, Motion]


def moved(matrix: Floats, points: ArrayLike) -> Floats:
    return matrix[:, :-1] @ np.asarray(points, np.float64) + matrix[:, -1:]


def inverse(matrix: Floats) -> Floats:
    back = matrix[:, :2].T
    return np.column_stack([back, -back @ matrix[:, 2]])


def is_proper(matrix: Floats) -> bool:
    return bool(np.linalg.det(matrix[:, :2]) > 0.0)


def motion_of(matrix: Floats, size: float) -> Motion | None:
    """Return the object for a motion [A | b], None for a glide reflection."""
    turn, shift, angle = matrix[:, :2], matrix[:, 2], float(np.arctan2(matrix[1, 0], matrix[0, 0]))
    if not is_proper(matrix):
        along = np.array([np.cos(0.5 * angle), np.sin(0.5 * angle)])
        glides = abs(along @ shift) > GLIDE * size
        return None if glides else Reflection(_plain(0.5 * shift, size), _plain(np.array([along[1], -along[0]]), 1.0))
    if abs(angle) < ROUNDING:
        return Translation(_plain(shift, size))
    return Rotation(float(f"{angle:.12g}"), _plain(np.linalg.solve(np.eye(2) - turn, shift), size))


def _plain(point: NDArray[np.floating[Any]], size: float) -> tuple[float, float]:
    x, y = (float(f"{value:.12g}") if abs(value) > ROUNDING * size else 0.0 for value in point.tolist())
    return x, y
