"""Potentials of boundaries as numbers, linear expressions or tables."""

import ast
from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.cases.readers import NUMBER, POINTS, Kind, call_checked, kinds_of, read_table
from kohonen_adapt.magnetostatics.equations.conditions import Value

__all__ = ["POTENTIAL", "LinearPotential", "TabulatedPotential"]

LONGEST = 1000  # characters
SIGNS = {ast.UAdd: 1.0, ast.Add: 1.0, ast.USub: -1.0, ast.Sub: -1.0}
SHOWN = 20  # characters of an invalid text in a message
END_TOLERANCE = 1e-9  # tolerance for rounding at the ends of a table, relative to its width
UNIT_RATIO = 100.0  # ratio of the widths of table and mesh that reveals a different unit

REMEDY = (
    'Write a sum of x and y (which are r and z around an axis) as "0.3*x - 0.1*y + 2e-3"; for curves give a table over '
    "x or y."
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


def linear_potential(text: str, location: str) -> Value:
    # a function, or a number without x and y
    bare = text.strip()

    def refusal(wanted: str, start: int) -> ValueError:
        came = repr(bare[start:][:SHOWN]) if start < len(bare) else "its end"
        return ValueError(f"{location} must have {wanted} at character {start + 1}; got {came}. {REMEDY}")

    def coefficients(node: ast.expr) -> Floats:  # the slopes over x and y and the constant, (3,)
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return np.array([0.0, 0.0, value], float)
            case ast.Name(id="x" | "y" as axis):
                return np.array([axis == "x", axis == "y", 0.0], float)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=inner):
                return SIGNS[type(sign)] * coefficients(inner)
            case ast.BinOp(op=ast.Add() | ast.Sub() as sign, left=left, right=right):
                return coefficients(left) + SIGNS[type(sign)] * coefficients(right)
            case ast.BinOp(op=ast.Mult() | ast.Div() as sign, left=left, right=right):
                first, second, divides = coefficients(left), coefficients(right), isinstance(sign, ast.Div)
                if second[:2].any() and (divides or first[:2].any()):
                    raise refusal("a number, as it must be linear in x and y,", right.col_offset)
                if divides and second[2] == 0.0:
                    raise refusal("a number other than 0", right.col_offset)
                with np.errstate(over="ignore", invalid="ignore"):
                    return first / second[2] if divides else first * second[2] + first[2] * second * [1.0, 1.0, 0.0]
        raise refusal("a number, x or y", node.col_offset)

    try:
        x, y, constant = coefficients(ast.parse(bare, mode="eval").body).tolist()
    except SyntaxError as error:
        raise refusal("an expression", (error.offset or 1) - 1) from None
    except (OverflowError, RecursionError, MemoryError) as error:
        raise ValueError(f"{location} must have an expression in x and y; got {bare[:SHOWN]!r}: {error}.") from None
    if not all(map(isfinite, (x, y, constant))):
        raise ValueError(f"{location} must have finite numbers; got {text!r}.")
    return LinearPotential(x, y, constant) if x or y else constant


TABLE = kinds_of(TabulatedPotential, {"points": POINTS})
del TABLE["location"]


def _read(given: Any, location: str) -> Value:
    if isinstance(given, str):
        return linear_potential(given, location)
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
