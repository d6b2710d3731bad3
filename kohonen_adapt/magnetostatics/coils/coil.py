"""Coils of rectangular section in space."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.checks import checked_points, is_number, point_text, positive_number
from kohonen_adapt.magnetostatics.coils.layout import laid_out, rectangle
from kohonen_adapt.magnetostatics.coils.source import Source, field_of, source_of
from kohonen_adapt.magnetostatics.coils.winding import Plane, Winding

__all__ = ["Coil"]


@dataclass(frozen=True, eq=False, repr=False)
class Coil:
    """Winding of rectangular section along a plane closed path.

    The current density is uniform. The path is the middle of the winding. `width` is in the plane of the path, across
    the path; `height` is along the axis, the normal of the plane around which the path runs counter-clockwise.

    Parameters
    ----------
    path : (3, k)
        Corners of a polygon in m; the last side leads back to the first corner. A positive current flows in this order.
    width, height
        Of the section, in m.
    ampere_turns
        Current times turns, in A.
    radius
        Radius of the path at its corners in m, at least half the width. 0 for mitred corners.

    Raises
    ------
    ValueError
        For numbers out of range, and for paths that have fewer than three points, repeat a point, are not plane, cross
        themselves or are too narrow for the winding.

    Examples
    --------
    >>> from kohonen_adapt.magnetostatics import Coil
    >>> square = [[0.0, 0.1, 0.1, 0.0], [0.0, 0.0, 0.1, 0.1], [0.0, 0.0, 0.0, 0.0]]
    >>> coil = Coil(square, width=0.01, height=0.02, ampere_turns=1000.0)
    >>> coil.field_strength([[0.05], [0.05], [0.0]])[2].round().tolist()  # 9003 A/m for a thin wire
    [8884.0]
    """

    path: Any
    width: float
    height: float
    ampere_turns: float
    radius: float = 0.0

    def __post_init__(self) -> None:
        path = np.array(self.path, float) if np.ndim(self.path) == 2 else np.zeros((0, 0))
        if path.shape[0] != 3 or path.shape[1] < 3 or not np.all(np.isfinite(path)):
            remedy = " Transpose it: the rows are x, y and z." if path.shape[1:] == (3,) else ""
            raise ValueError(
                f"path must be three or more points of shape (3, k), finite, in m; got shape {np.shape(self.path)}."
                f"{remedy}"
            )
        path.setflags(write=False)
        own = vars(self)
        own["path"] = path
        for name in ("width", "height"):
            own[name] = positive_number(own[name], f"{name} of a coil, in m,")
        for name, unit, least in (("ampere_turns", "A", -np.inf), ("radius", "m", 0.0)):
            value = own[name]
            if not (is_number(value) and np.isfinite(value) and value >= least):
                raise ValueError(f"{name} of a coil must be a finite number in {unit}; got {value!r}.")
            own[name] = float(value)
        _ = self.winding

    def __repr__(self) -> str:
        section = f"section {self.width:g} x {self.height:g} m"
        return f"<Coil: {self.ampere_turns:g} A around {point_text(np.round(self.axis, 6) + 0.0)}, {section}>"

    @classmethod
    def circular(
        cls, centre: ArrayLike, axis: ArrayLike, radius: float, section: ArrayLike, ampere_turns: float
    ) -> "Coil":
        """Return a coil around a circle.

        Parameters
        ----------
        centre : (3,)
            In m.
        axis : (3,)
            Direction of the axis. A positive current flows counter-clockwise around the axis.
        radius
            Mean radius of the winding in m.
        section : (2,)
            Width, across the axis, and height, along the axis, in m.
        ampere_turns
            In A.

        Returns
        -------
        Coil

        Raises
        ------
        ValueError
            As in `Coil`.

        Examples
        --------
        >>> from kohonen_adapt.magnetostatics import Coil
        >>> coil = Coil.circular((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.02, (0.02, 0.04), 1000.0)
        >>> coil.field_strength([[0.0], [0.0], [0.0]])[2].round().tolist()
        [17839.0]
        """
        radius = positive_number(radius, "radius of a circular coil, in m,")
        path = rectangle(centre, axis, 2.0 * radius, 2.0 * radius, None)
        return cls(path, *_section(section), ampere_turns, radius)

    @classmethod
    def racetrack(
        cls,
        centre: ArrayLike,
        axis: ArrayLike,
        length: float,
        width: float,
        radius: float,
        section: ArrayLike,
        ampere_turns: float,
        *,
        along: ArrayLike | None = None,
    ) -> "Coil":
        """Return a coil around a rectangle with rounded corners.

        Parameters
        ----------
        centre, axis : (3,)
            As in `circular`.
        length, width
            Of the middle of the winding, from side to side, in m.
        radius
            Of the middle of the winding at corners, in m, from half the width of the section to half of `width`. 0 for
            mitred corners.
        section : (2,)
            As in `circular`.
        ampere_turns
            In A.
        along : (3,)
            Direction of `length`. None for the first of the x, y and z axes that is farthest from `axis`.

        Returns
        -------
        Coil

        Raises
        ------
        ValueError
            As in `Coil`.

        Examples
        --------
        >>> from kohonen_adapt.magnetostatics import Coil
        >>> coil = Coil.racetrack((0.0, 0.0, 0.1), (0.0, 0.0, 1.0), 0.08, 0.04, 0.02, (0.01, 0.02), 500.0)
        >>> coil.contains([[0.04, 0.0], [0.0, 0.0], [0.1, 0.1]]).tolist()
        [True, False]
        """
        length, width = (positive_number(value, "length and width of a coil, in m,") for value in (length, width))
        return cls(rectangle(centre, axis, length, width, along), *_section(section), ampere_turns, radius)

    @classmethod
    def straight_limb(
        cls,
        centre: ArrayLike,
        axis: ArrayLike,
        bore: ArrayLike,
        section: ArrayLike,
        ampere_turns: float,
        *,
        radius: float = 0.0,
        along: ArrayLike | None = None,
    ) -> "Coil":
        """Return a coil wound around a straight limb of rectangular section.

        The wire bends around the edges of the bore, so that the outer corners are round.

        Parameters
        ----------
        centre, axis : (3,)
            As in `circular`.
        bore : (2,)
            Lengths of the opening, the first in the direction `along`, in m.
        section : (2,)
            As in `circular`.
        ampere_turns
            In A.
        radius
            Of the corners of the bore in m.
        along : (3,)
            As in `racetrack`.

        Returns
        -------
        Coil

        Raises
        ------
        ValueError
            As in `Coil`.

        Examples
        --------
        >>> from kohonen_adapt.magnetostatics import Coil
        >>> coil = Coil.straight_limb((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.03, 0.02), (0.01, 0.05), 1000.0)
        >>> coil.contains([[0.0149, 0.0151], [0.0, 0.0], [0.0, 0.0]]).tolist()
        [False, True]
        """
        thickness, height = _section(section)
        length, width = _pair(bore, "bore of a coil must be two positive numbers, its lengths in m")
        path = rectangle(centre, axis, length + thickness, width + thickness, along)
        if not (is_number(radius) and radius >= 0.0):
            raise ValueError(f"radius of the bore of a coil must be a number >= 0, in m; got {radius!r}.")
        return cls(path, thickness, height, ampere_turns, radius + 0.5 * thickness)

    @cached_property
    def winding(self) -> Winding:
        return laid_out(self.path, self.width, self.height, self.radius)

    @property
    def axis(self) -> Floats:
        """Unit vector (3,) around which the path runs counter-clockwise."""
        return self.winding.frame[2]

    @cached_property
    def _source(self) -> Source:
        return source_of(self.winding, self.ampere_turns / (self.width * self.height))

    def field_strength(self, x: ArrayLike) -> Floats:
        """Return H of the coil in free space.

        H is finite everywhere, also in the winding. Straight bars are closed forms; arcs are integrated to 1e-5 of
        the largest value.

        Parameters
        ----------
        x : (3, n)
            Points in m.

        Returns
        -------
        ndarray (3, n)
            In A/m.

        Raises
        ------
        ValueError
            If `x` is not of shape (3, n), or not finite.
        """
        return field_of(self._source, checked_points(x, "x", 3))

    def current_density(self, x: ArrayLike) -> Floats:
        """Return the current density at points.

        Parameters
        ----------
        x : (3, n)
            Points in m.

        Returns
        -------
        ndarray (3, n)
            In A/m^2; 0 outside the winding.

        Raises
        ------
        ValueError
            As in `field_strength`.
        """
        density = self.ampere_turns / (self.width * self.height)
        return density * self.winding.vectors(self._direction(x))

    def contains(self, x: ArrayLike) -> Mask:
        """Return True for points in the winding.

        Parameters
        ----------
        x : (3, n)
            Points in m.

        Returns
        -------
        ndarray (n,)

        Raises
        ------
        ValueError
            As in `field_strength`.
        """
        return self._direction(x) != 0.0

    def _direction(self, x: ArrayLike) -> Plane:
        # of the current in the plane of the winding, 0 outside
        y, z = self.winding.local(checked_points(x, "x", 3))
        return np.where(np.abs(z) <= 0.5 * self.height, self.winding.turns(y)[1], 0.0)


def _section(section: ArrayLike) -> tuple[float, float]:
    return _pair(section, "section of a coil must be two positive numbers, width and height in m")


def _pair(values: ArrayLike, expected: str) -> tuple[float, float]:
    pair = list(values) if isinstance(values, list | tuple | np.ndarray) else []
    if len(pair) != 2 or not all(is_number(value) and 0.0 < value < np.inf for value in pair):
        raise ValueError(f"{expected}; got {values!r}.")
    return float(pair[0]), float(pair[1])
