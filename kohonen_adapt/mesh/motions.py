"""State the motions of the plane that carry one boundary onto another: rotations, translations and reflections."""

from dataclasses import dataclass
from math import cos, hypot, isfinite, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import finite_point, is_number

__all__ = ["Motion", "Pair", "Reflection", "Rotation", "Translation", "inverse", "is_proper", "motion_of", "moved"]

ROUNDING = 1e-12  # radians, and of the size of the mesh: what a motion that was worked out owes to rounding
GLIDE = 1e-8  # of the size of the mesh: how far along its line a reflection may carry


@dataclass(frozen=True)
class Rotation:
    """The rotation by an angle about a point, ``x -> c + R (x - c)``.

    Attributes
    ----------
    angle
        In radians, counter-clockwise positive.
    centre
        (x, y), in the unit of the mesh.

    Raises
    ------
    ValueError
        If the angle is no finite number, or the centre no two of them.

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
        object.__setattr__(self, "centre", finite_point(self.centre, "centre of a Rotation"))

    @property
    def matrix(self) -> Floats:
        """``x -> A x + b`` as rows [A | b], (2, 3)."""
        cosine, sine = cos(self.angle), sin(self.angle)
        turn = np.array([[cosine, -sine], [sine, cosine]])
        return np.column_stack([turn, self.centre - turn @ self.centre])


@dataclass(frozen=True)
class Translation:
    """The translation by a vector, ``x -> x + v``.

    Attributes
    ----------
    vector
        (x, y), in the unit of the mesh.

    Raises
    ------
    ValueError
        If it is not two finite numbers.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Translation((2.0, 0.0)).matrix.tolist()
    [[1.0, 0.0, 2.0], [0.0, 1.0, 0.0]]
    """

    vector: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "vector", finite_point(self.vector, "vector of a Translation"))

    @property
    def matrix(self) -> Floats:
        """``x -> A x + b`` as rows [A | b], (2, 3)."""
        return np.column_stack([np.eye(2), self.vector])


@dataclass(frozen=True)
class Reflection:
    """The reflection in the line through a point, ``x -> x - 2 n n . (x - p)`` with the unit normal n.

    Attributes
    ----------
    point
        (x, y) on the line, in the unit of the mesh.
    normal
        (x, y) across the line, of any length above zero.

    Raises
    ------
    ValueError
        If one of them is not two finite numbers, or the normal zero.

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> ka.Reflection(point=(1.0, 0.0), normal=(2.0, 0.0)).matrix.tolist()
    [[-1.0, 0.0, 2.0], [0.0, 1.0, 0.0]]
    """

    point: tuple[float, float]
    normal: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", finite_point(self.point, "point of a Reflection"))
        object.__setattr__(self, "normal", finite_point(self.normal, "normal of a Reflection"))
        if hypot(*self.normal) == 0.0:
            raise ValueError("normal of a Reflection must have a direction; got (0, 0).")

    @property
    def matrix(self) -> Floats:
        """``x -> A x + b`` as rows [A | b], (2, 3)."""
        normal = np.array(self.normal) / hypot(*self.normal)
        return np.column_stack([np.eye(2) - 2.0 * np.outer(normal, normal), 2.0 * normal * (normal @ self.point)])


Motion = Rotation | Translation | Reflection

Pair = tuple[str, str] | tuple[str, str, Motion]
"""Names of two boundaries, and where more than one would do the motion that carries the first onto the second."""


def moved(matrix: Floats, points: ArrayLike) -> Floats:
    """Points (2, n) where a motion [A | b] carries them."""
    return matrix[:, :2] @ np.asarray(points, dtype=np.float64) + matrix[:, 2:]


def inverse(matrix: Floats) -> Floats:
    """The motion back."""
    back = matrix[:, :2].T
    return np.column_stack([back, -back @ matrix[:, 2]])


def is_proper(matrix: Floats) -> bool:
    """Whether a motion [A | b] is a rotation or translation, and no mirror image."""
    return bool(matrix[0, 0] * matrix[1, 1] > matrix[0, 1] * matrix[1, 0])


def motion_of(matrix: Floats, size: float) -> Motion | None:
    """The motion [A | b] by name, to 12 digits; None for a glide reflection, which has none. The mesh has that size."""
    turn, shift, angle = matrix[:, :2], matrix[:, 2], float(np.arctan2(matrix[1, 0], matrix[0, 0]))
    if not is_proper(matrix):
        along = np.array([np.cos(0.5 * angle), np.sin(0.5 * angle)])
        glides = abs(along @ shift) > GLIDE * size
        return None if glides else Reflection(_plain(0.5 * shift, size), _plain(np.array([along[1], -along[0]]), 1.0))
    if abs(angle) < ROUNDING:
        return Translation(_plain(shift, size))
    return Rotation(float(f"{angle:.12g}"), _plain(np.linalg.solve(np.eye(2) - turn, shift), size))


def _plain(point: NDArray[np.floating[Any]], size: float) -> tuple[float, float]:
    """A point without what is rounding."""
    x, y = (float(f"{value:.12g}") if abs(value) > ROUNDING * size else 0.0 for value in point.tolist())
    return x, y
