"""Field of order 2 in space with an estimate of its error added."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.estimators.hierarchical import cubic_slopes
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.local_solid import Strength
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField

__all__ = ["EnrichedField"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EnrichedField(SolidField):
    cubic: Floats  # (10, nelements): coefficients of `cubic_slopes`

    def at(self, x: Floats, element: Ints) -> Strength:
        return self._added(super().at(x, element), element)

    def reaction_at(self, x: Floats, element: Ints) -> Floats:
        return super().reaction_at(x, element) - VACUUM_PERMEABILITY * self.cubic_slope(x, element)

    @cached_property
    def at_quadrature(self) -> Strength:
        return self._added(super().at_quadrature, self.elements.element)

    @cached_property
    def at_corners(self) -> Strength:
        return self._added(super().at_corners, np.tile(np.arange(self.mesh.t.shape[1]), 4))

    def _added(self, at: Strength, element: Ints) -> Strength:
        return replace(at, field_strength=at.field_strength - self.cubic_slope(at.x, element))

    def cubic_slope(self, x: Floats, element: Ints) -> Floats:
        slopes = cubic_slopes(self.elements.barycentric(x, element))
        along = np.einsum("in,ian->an", self.cubic[:, element], slopes)
        return np.asarray(np.einsum("an,can->cn", along, self.elements.hats[:, :, element]))
