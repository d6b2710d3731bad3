"""Values of a field at points, by the flux density or by the field strength."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Function, Ints
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.mesh.curved import all_points
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.measures import unit_vectors

__all__ = ["PointField", "PointValues", "Points", "Strength", "tangent_product"]


class Points(NamedTuple):
    # points of elements, with a quick way to the slopes of a function there
    element: Ints  # (n,)
    x: Floats  # (d, n) in m
    off_axis: Floats  # x, of a point on an axis a point beside
    slope: Function  # of a function by its unknowns
    share: Any = None  # (d + 1, n): barycentric coordinates, not of quadrature points
    given: str = ""  # attribute of `Drive` with its field at these points, each evaluated once

    @classmethod
    def of(cls, elements: Space, element: Ints, share: Floats, x: Floats | None = None) -> "Points":
        limit = elements.limit_points(element, share)
        x = elements.shape.points(element, share) if x is None else x
        off_axis = elements.shape.points(element, limit) if elements.axis else x
        return cls(element, x, off_axis, lambda u: elements.gradient_at(u, element, limit), share)

    @classmethod
    def in_each(cls, elements: Space, share: Floats, x: Floats | None = None, given: str = "") -> "Points":
        # at barycentric coordinates (d + 1, k) of every element, in the order (k, nelements)
        at = cls.of(elements, *all_points(np.arange(elements.kind.size), share.T), x)._replace(given=given)
        return at if elements.axis else at._replace(slope=lambda u: elements.gradient_in_each(u, share.T))


@dataclass(frozen=True, eq=False)
class PointValues:
    element: Ints  # (n,): element of every point
    x: Floats  # (d, n) in m
    vectors: Floats  # (d, n): B in T, or H in A/m with a scalar potential
    coefficients: Coefficients  # of the points
    flux_density: ClassVar[Any]  # (d, n) in T
    field_strength: ClassVar[Any]  # (d, n) in A/m

    @cached_property
    def energy_density(self) -> Floats:
        return self.coefficients.energy_density(self.flux_density)

    @property
    def coenergy_density(self) -> Floats:
        return np.sum(self.field_strength * self.flux_density, axis=0) - self.energy_density

    @property
    def magnetisation(self) -> Any:
        # mu0 M in T
        return self.flux_density - VACUUM_PERMEABILITY * self.field_strength

    @property
    def reluctivities(self) -> FloatsPair:
        # secant and differential, (n,) each in m/H
        secant, differential = self.permeabilities
        return 1.0 / secant, 1.0 / differential

    @property
    def permeabilities(self) -> FloatsPair:
        secant, differential = self.reluctivities
        return 1.0 / secant, 1.0 / differential


class PointField(PointValues):
    # values by B, of a vector potential
    @property
    def flux_density(self) -> Floats:
        return self.vectors

    @cached_property
    def field_strength(self) -> Floats:
        return self.coefficients.field_strength(self.vectors)

    @cached_property
    def reluctivities(self) -> FloatsPair:
        return self.coefficients.reluctivities(self.vectors)

    def change_of_strength(self, change: Floats) -> Floats:
        """Return the change of H in A/m by a small change of B in T, both (d, n)."""
        return tangent_product(*self.reluctivities, self.vectors, change)


class Strength(PointValues):
    # values by H, of a scalar potential
    @property
    def field_strength(self) -> Floats:
        return self.vectors

    @cached_property
    def permeabilities(self) -> FloatsPair:
        return self.coefficients.permeabilities(self.vectors)

    @cached_property
    def flux_density(self) -> Floats:
        return self.permeabilities[0] * (self.vectors + self.coefficients.coercivity)

    def change_of_flux_density(self, change: Floats) -> Floats:
        """Return the change of B in T by a small change of H in A/m, both (d, n)."""
        return tangent_product(*self.permeabilities, self.vectors + self.coefficients.coercivity, change)


def tangent_product(secant: Floats, differential: Floats, direction: Floats, change: Floats) -> Floats:
    """Return the product of the tensor of a linearised law and a small change (d, n).

    The coefficient is `differential` along `direction` (d, n), and `secant` across.
    """
    along = unit_vectors(direction)
    return secant * change + (differential - secant) * np.sum(change * along, axis=0) * along
