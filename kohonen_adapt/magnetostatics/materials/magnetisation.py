"""Directions of magnets that change from place to place: radial, and Halbach's."""

from collections.abc import Callable

import numpy as np

from kohonen_adapt.arrays import Floats

__all__ = ["halbach", "radial"]


def radial(magnitude: float, *, centre: tuple[float, float] = (0.0, 0.0)) -> Callable[[Floats], Floats]:
    """Away from a centre, for the remanence or coercivity of a `Material`.

    Parameters
    ----------
    magnitude
        In T or A/m; negative towards the centre.
    centre
        In metres.

    Returns
    -------
    callable
        Of x (2, n) in metres, giving (2, n).

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Material, radial
    >>> magnet = Material(permeability=1.05, remanence=radial(1.2))
    >>> radial(1.2)(np.array([[0.0], [0.5]])).round(9).tolist()
    [[0.0], [1.2]]
    """

    def direction(x: Floats) -> Floats:
        return magnitude * np.stack(_unit(np.arctan2(x[1] - centre[1], x[0] - centre[0])))

    return direction


def halbach(
    magnitude: float, pole_pairs: int, *, centre: tuple[float, float] = (0.0, 0.0)
) -> Callable[[Floats], Floats]:
    """At the polar angle phi in the direction ``(1 + pole_pairs) phi`` (Halbach, Nucl. Instrum. Methods 169, 1980).

    A ring of it has its field outside for negative `pole_pairs`, inside for positive ones; 1 gives a uniform field.

    Parameters
    ----------
    magnitude
        In T or A/m.
    pole_pairs
        Their number, with its sign.
    centre
        In metres.

    Returns
    -------
    callable
        Of x (2, n) in metres, giving (2, n).

    Examples
    --------
    >>> import numpy as np
    >>> from kohonen_adapt.magnetostatics import Material, halbach
    >>> ring = Material(permeability=1.05, remanence=halbach(1.2, 2))
    >>> halbach(1.2, 2)(np.array([[0.5], [0.0]])).round(9).tolist()
    [[1.2], [0.0]]
    """

    def direction(x: Floats) -> Floats:
        return magnitude * np.stack(_unit((1 + pole_pairs) * np.arctan2(x[1] - centre[1], x[0] - centre[0])))

    return direction


def _unit(angle: Floats) -> tuple[Floats, Floats]:
    return np.cos(angle), np.sin(angle)
