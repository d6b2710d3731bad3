"""Field of coils and of a function, applied to a problem in space."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from kohonen_adapt.arrays import DataFunction, Floats, FloatsPair, Ints
from kohonen_adapt.checks import finite_values
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.coils.rules import gauss
from kohonen_adapt.mesh.elements.functions import positions
from kohonen_adapt.mesh.measures import magnitude

__all__ = [
    "FACET_SIGNS",
    "AppliedField",
    "Sources",
    "checked_field",
    "circulations",
    "field_at",
]

AppliedField = DataFunction

FACET_SIGNS = np.array([1.0, 1.0, -1.0])
# Points of Lobatto's rules along a segment: seven have an error of 5e-5 at half its length from a wire. Fewer suffice
# farther away, where the distance from the middle to all currents is at least a number of half lengths.
LOBATTO_POINTS = {7: 0.0, 5: 2.2, 4: 3.5, 3: 9.0}


def checked_field(value: Any) -> AppliedField | None:
    if value is None or callable(value):
        return value
    sources = value if isinstance(value, list | tuple) else [value]
    if sources and all(callable(getattr(source, "getH", None)) for source in sources):
        return lambda x: np.sum([np.reshape(source.getH(x.T), x.T.shape).T for source in sources], axis=0)
    if np.shape(value) == (3,) and np.asarray(value).dtype.kind in "iuf" and np.all(np.isfinite(value)):
        vector = np.array(value, float)
        return lambda x: np.tile(vector[:, None], x.shape[1])
    raise ValueError(
        "applied_field must be a function of x (3, n) in m that returns the field strength of the currents, (3, n) in "
        f"A/m, three finite numbers, magpylib's objects, or None; got {value!r}."
    )


def field_at(function: AppliedField, x: Floats) -> Floats:
    if not x.size:
        return np.zeros_like(x)
    remedy = (
        " A node or the centroid of an element is on a wire: give the wire a cross-section, or keep nodes off the wire."
    )
    return finite_values("applied_field", function, x, x.shape, remedy)


@dataclass(frozen=True, eq=False)
class Sources:
    coils: Mapping[str, Coil]
    applied: AppliedField | None

    def __call__(self, x: Floats) -> Floats:
        fields = [coil.field_strength(x) for coil in self.coils.values()]
        return np.sum(fields if self.applied is None else [*fields, field_at(self.applied, x)], axis=0)

    @property
    def parts(self) -> tuple[AppliedField, ...]:
        return (self,) if self.applied is None else (Sources(self.coils, None), self.applied)

    def distance(self, x: Floats) -> Floats:
        # a lower bound of the distance from all coils
        return np.min([coil.winding.distance(x) for coil in self.coils.values()], axis=0)

    def without(self, name: str) -> AppliedField | None:
        rest = {other: coil for other, coil in self.coils.items() if other != name}
        return Sources(rest, self.applied) if rest else self.applied


class Rule(NamedTuple):
    # on [0, 1]
    inner: Floats
    weights: Floats
    at_ends: float

    @classmethod
    def lobatto(cls, count: int) -> "Rule":
        inner, at_ends = positions(count - 1, spread=True)[1:-1], 1.0 / (count * (count - 1))
        return cls(inner, at_ends / legendre.Legendre.basis(count - 1, [0.0, 1.0])(inner) ** 2, at_ends)


# A function may be infinite at nodes. The fields of coils there serve several edges.
OF_FUNCTIONS, OF_COILS = Rule(*gauss(6), 0.0), [Rule.lobatto(count) for count in LOBATTO_POINTS]


def circulations(x: Floats, ends: Ints, function: AppliedField) -> FloatsPair:
    """Return ``int Hs . dl`` and ``int |Hs| dl`` along segments, shape (n,) in A.

    `ends` (2, n) are columns of the points x. The second integral has the terms of coils and of a further function
    added.
    """
    parts = function.parts if isinstance(function, Sources) else (function,)
    circulation, absolute = np.sum([_circulations_of(x, ends, part) for part in parts], axis=0)
    return circulation, absolute


def _circulations_of(x: Floats, ends: Ints, function: AppliedField) -> Floats:
    start, edge = x[:, ends[0]], x[:, ends[1]] - x[:, ends[0]]
    size, found = magnitude(edge), np.zeros((2, edge.shape[1]))
    rules, group = [OF_FUNCTIONS], np.zeros(size.size, np.int64)
    if isinstance(function, Sources):
        distance = 2.0 * function.distance(start + 0.5 * edge)
        rules, group = OF_COILS, np.sum(np.outer(list(LOBATTO_POINTS.values()), size) <= distance, axis=0) - 1
        used, row = np.unique(ends, return_inverse=True)
        at_nodes, weight = field_at(function, x[:, used]), np.array([rule.at_ends for rule in rules])[group]
        for values in at_nodes[:, row.reshape(ends.shape)].swapaxes(0, 1):
            found += weight * _integrands(values, edge)
    for k, rule in enumerate(rules):
        rows = np.flatnonzero(group == k)
        first, along = start[:, rows], edge[:, rows]
        for at, part in zip(rule.inner, rule.weights, strict=True):
            found[:, rows] += part * _integrands(field_at(function, first + at * along), along)
    return found


def _integrands(values: Floats, edge: Floats) -> Floats:
    return np.stack((np.sum(values * edge, axis=0), magnitude(values) * magnitude(edge)))
