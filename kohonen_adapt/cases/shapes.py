"""The curves that boundaries of a case are on: a circle, a line, or a spline through points."""

from collections.abc import Callable
from typing import Any

import numpy as np

from kohonen_adapt.cases.kinds import Kind, about, checked, choice, flag, number, table, vector
from kohonen_adapt.outline.curves import Arc, Line
from kohonen_adapt.outline.spline import Spline

__all__ = ["shape"]


def _points(given: Any, place: str) -> np.ndarray:
    if not isinstance(given, list):
        raise ValueError(f"{place} must be a list of points [x, y].")
    return np.array([vector(point, f"{place}[{k}]") for k, point in enumerate(given)]).reshape(-1, 2).T


SHAPES: dict[str, tuple[Callable[..., Any], dict[str, Kind], tuple[str, ...]]] = {
    "arc": (Arc, {"centre": vector, "radius": number(above=0.0)}, ("centre", "radius")),
    "line": (Line, {"start": vector, "end": vector}, ("start", "end")),
    "spline": (Spline, {"points": _points, "closed": flag}, ("points",)),
}
"""Name of a curve to what makes it, what its arguments may be, and which must be there."""


def shape(given: Any, place: str) -> Arc | Line | Spline:
    """What a table under ``adapt.curves`` may hold, in metres.

    Raises
    ------
    ValueError
        If the curve is not known, or an argument of it is not, is missing or wrong.
    """
    entries = table(given, place)
    make, kinds, required = SHAPES[choice(*SHAPES)(entries.pop("curve", None), f"{place}.curve")]
    values = checked(entries, kinds, place, required)
    with about(place):
        try:
            return make(**values)
        except ArithmeticError as error:  # points beyond all measure
            raise ValueError(str(error)) from None
