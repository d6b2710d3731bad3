"""Field of coils and of a function, applied to a problem in space."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.coils.coil import Coil

__all__ = ["AppliedField", "Sources", "checked_field", "field_at", "sources_of"]

AppliedField = Callable[[Floats], ArrayLike]


def checked_field(value: Any) -> AppliedField | None:
    if value is None or callable(value):
        return value
    if callable(getattr(value, "getH", None)):
        return lambda x: np.reshape(value.getH(x.T), x.T.shape).T
    if isinstance(value, list | tuple) and value and all(callable(getattr(source, "getH", None)) for source in value):
        sources = [checked_field(source) for source in value]
        return lambda x: sum(np.asarray(source(x)) for source in sources if source is not None)
    if np.shape(value) == (3,) and np.asarray(value).dtype.kind in "iuf" and np.all(np.isfinite(value)):
        vector = np.array(value, dtype=float)
        return lambda x: np.tile(vector[:, None], x.shape[1])
    raise ValueError(
        "applied_field must be a function of x (3, n) in m that returns the field strength of the currents, (3, n) in "
        f"A/m, three finite numbers, magpylib's objects, or None; got {value!r}."
    )


def field_at(function: AppliedField, x: Floats) -> Floats:
    if not x.size:
        return np.zeros_like(x)
    values = np.asarray(function(x), dtype=float)
    if values.shape != x.shape:
        raise ValueError(f"applied_field must return the shape of x, (3, n) = {x.shape}; got {values.shape}.")
    bad = np.flatnonzero(~np.isfinite(values).all(axis=0))
    if bad.size:
        raise ValueError(
            f"applied_field must be finite; it is not at {bad.size} points, first {tuple(x[:, bad[0]].tolist())}. A "
            "node or the centroid of an element is on a wire: give the wire a cross-section, or keep nodes off the "
            "wire."
        )
    return values


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


def sources_of(coils: Mapping[str, Coil] | None, applied_field: Any) -> AppliedField | None:
    applied = checked_field(applied_field)
    return Sources(coils, applied) if coils else applied
