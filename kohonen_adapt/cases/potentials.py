"""Potentials of boundaries as numbers, linear expressions or tables."""

import re
from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.cases.readers import NUMBER, POINTS, Kind, call_checked, kinds_of, read_table
from kohonen_adapt.magnetostatics.equations.conditions import Value

__all__ = ["POTENTIAL", "LinearPotential", "TabulatedPotential"]

TOKEN = re.compile(r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<axis>[xy]\b)|(?P<sign>[-+*/]))")
LONGEST = 1000  # characters
SHOWN = 20  # characters of an invalid text in a message
END_TOLERANCE = 1e-9  # tolerance for rounding at the ends of a table, relative to its width
UNIT_RATIO = 100.0  # ratio of the widths of table and mesh that reveals a different unit

REMEDY = (
    'Write a sum of x and y (which are r and z around an axis) as "0.3*x - 0.1*y + 2e-3", without brackets; for curves '
    "give a table over x or y."
)


@dataclass(frozen=True)
class LinearPotential:
    """Potential ``A = x_slope x + y_slope y + constant``, in Wb/m for x and y in m."""

    x_slope: float
    y_slope: float
    constant: float

    def __call__(self, x: Floats) -> Floats:
        return self.x_slope * x[0] + self.y_slope * x[1] + self.constant


@dataclass(frozen=True)
class TabulatedPotential:
    """Potential that is linear between the points of a table over x or y.

    Parameters
    ----------
    over
        The coordinate.
    points
        Pairs of the coordinate in m, in ascending order, and A in Wb/m.
    """

    over: Literal["x", "y"]
    points: list[tuple[float, float]]
    location: str  # dotted key, for messages

    def __post_init__(self) -> None:
        if len(self.points) < 2 or not (np.diff(self._columns[0]) > 0.0).all():
            raise ValueError(
                f"points must be two pairs [{self.over}, A] at least, {self.over} rising; got {self.points!r}."
            )

    @property
    def _columns(self) -> Floats:
        return np.reshape(self.points, (-1, 2)).T

    def check(self, mesh: MeshTri) -> None:
        wide, (low, high) = np.ptp(self._columns[0]), np.sort(mesh.p["xy".index(self.over)])[[0, -1]]
        if wide > UNIT_RATIO * (high - low):
            raise ValueError(
                f"{self.location}: the table is {wide:g} m wide, and the mesh reaches from {self.over} = {low:g} to "
                f"{high:g} m. Give its points in metres, whatever the unit of the mesh file."
            )

    def __call__(self, x: Floats) -> Floats:
        at, (places, values) = x["xy".index(self.over)], self._columns
        outside = np.maximum(places[0] - at, at - places[-1])
        if outside.max(initial=0.0) > END_TOLERANCE * (places[-1] - places[0]):
            raise ValueError(
                f"{self.location}: the table reaches from {self.over} = {places[0]:g} to {places[-1]:g} m, and the "
                f"boundary has a node at {at[np.argmax(outside)]:g} m. Add points, in metres."
            )
        return np.interp(at, places, values)


class _Expression:
    """Parser of linear expressions in x and y.

    The grammar is ``sum = product {("+" | "-") product}``, ``product = factor {("*" | "/") factor}``,
    ``factor = {"+" | "-"} (number | "x" | "y")``. At most one factor of a product has x or y, and none after "/" does.
    """

    def __init__(self, text: str, location: str) -> None:
        self._text, self._location, self._at = text.rstrip(), location, 0

    def function(self) -> Value:
        x, y, constant = self._sum().tolist()
        if not all(map(isfinite, (x, y, constant))):
            raise ValueError(f"{self._location} must have finite numbers; got {self._text!r}.")
        return LinearPotential(x, y, constant) if x or y else constant

    def _sum(self) -> Floats:
        # slopes over x and y and the constant, shape (3,)
        found = self._product()
        while self._at < len(self._text):
            sign = self._next_token("sign", "+-", wanted="+, -, * or /")
            found = found + (self._product() if sign == "+" else -self._product())
        return found

    def _product(self) -> Floats:
        found = self._factor()
        while sign := self._next_token("sign", "*/"):
            start = self._at
            other = self._factor()
            if other[:2].any() and (sign == "/" or found[:2].any()):
                raise self._refusal(start, "a number, as it must be linear in x and y")
            if sign == "/" and other[2] == 0.0:
                raise self._refusal(start, "a number other than 0")
            if other[:2].any():
                found, other = other, found
            with np.errstate(over="ignore", invalid="ignore"):
                found = found / other[2] if sign == "/" else found * other[2]
        return found

    def _factor(self) -> Floats:
        sign = 1.0
        while mark := self._next_token("sign", "+-"):
            sign = -sign if mark == "-" else sign
        if axis := self._next_token("axis"):
            return sign * np.array([axis == "x", axis == "y", 0.0])
        return np.array([0.0, 0.0, sign * float(self._next_token("number", wanted="a number, x or y"))])

    def _next_token(self, kind: str, these: str = "", wanted: str = "") -> str:
        """Return the next token if its kind and text fit, else an empty string.

        Raises
        ------
        ValueError
            If the token does not fit, and `wanted`, a description for the message, is not empty.
        """
        found = TOKEN.match(self._text, self._at)
        if found and found.lastgroup == kind and (not these or found[kind] in these):
            self._at = found.end()
            return found[kind]
        if wanted:
            raise self._refusal(self._at, wanted)
        return ""

    def _refusal(self, start: int, wanted: str) -> ValueError:
        rest = self._text[start:].lstrip()
        came = repr(rest[:SHOWN]) if rest else "its end"
        character = len(self._text) - len(rest) + 1
        return ValueError(f"{self._location} must have {wanted} at character {character}; got {came}. {REMEDY}")


TABLE = kinds_of(TabulatedPotential, {"points": POINTS})
del TABLE["location"]


def _read(given: Any, location: str) -> Value:
    if isinstance(given, str):
        return _Expression(given, location).function()
    if isinstance(given, dict):
        return call_checked(
            TabulatedPotential, {**read_table(given, TABLE, location, TABLE), "location": location}, location
        )
    return NUMBER(given, location)


POTENTIAL = Kind(
    (int, float, str, dict),
    'a finite number, a linear expression as "0.3*x + 2e-3", or a table as {over = "x", points = [[0.0, 0.0], ...]}',
    lambda given: not isinstance(given, str) or len(given) <= LONGEST,
    _read,
)
"""A number in Wb/m, an expression, or a table."""
