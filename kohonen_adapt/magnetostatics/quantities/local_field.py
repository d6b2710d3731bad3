"""Evaluate a solved field: B at points of its elements, what follows from it there, and the means of the elements."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.around_axis import elements_on
from kohonen_adapt.magnetostatics.equations.elements import Linear
from kohonen_adapt.magnetostatics.equations.higher import Elements
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR, Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.mesh.measures import area

__all__ = ["LocalField", "PointField"]


@dataclass(frozen=True, eq=False)
class PointField:
    """A field at points, each in one element whose material it has."""

    element: Ints  # (n,): of every point
    x: Floats  # (2, n) in m
    flux_density: Floats  # (2, n) in T
    coefficients: Coefficients  # of the points, in place of elements

    @cached_property
    def field_strength(self) -> Floats:
        """``H = nu B - Hc``, (2, n) in A/m."""
        return self.coefficients.field_strength(self.flux_density)

    @cached_property
    def energy_density(self) -> Floats:
        """``int H . dB`` since the remanent state, (n,) in J/m^3; linear: ``nu |B - Br|^2 / 2``."""
        return self.coefficients.energy_density(self.flux_density)

    @property
    def coenergy_density(self) -> Floats:
        """``H . B`` less the energy density, (n,) in J/m^3."""
        return np.sum(self.field_strength * self.flux_density, axis=0) - self.energy_density

    @cached_property
    def reluctivities(self) -> tuple[Floats, Floats]:
        """The secant one, ``|H + Hc| / |B|``, and the differential one along B, (n,) in m/H each."""
        return self.coefficients.reluctivities(self.flux_density)

    def change_of_strength(self, change: Floats) -> Floats:
        """How H changes, (2, n) in A/m, with a small change of B (2, n) in T: differential along B, secant across."""
        size = np.hypot(*self.flux_density)
        along = self.flux_density / np.where(size > 0.0, size, 1.0)
        secant, differential = self.reluctivities
        return secant * change + (differential - secant) * np.sum(change * along, axis=0) * along


@dataclass(frozen=True, eq=False, repr=False)
class LocalField:
    """A potential and what follows from it; see `Field`, which can tell more.

    B is a polynomial in every element, of one degree less than the potential: `at_shares` has it at any points of
    elements, from which everything is evaluated and integrated. What is (nelements,) is the mean of each element.
    """

    mesh: MeshTri
    potential: Floats
    coefficients: Coefficients
    symmetry: Symmetry = PLANAR
    depth: float | None = None
    order: ClassVar[int] = 1

    @property
    def axisymmetric(self) -> bool:
        """Whether x is the distance r from an axis, y the height z along it and the potential A_phi."""
        return self.symmetry is AXISYMMETRIC

    @cached_property
    def elements(self) -> Elements:
        """The elements whose functions the potential is one of."""
        return elements_on(self.mesh, self.order, self.symmetry, self.coefficients.lawful)

    @cached_property
    def unknown(self) -> Floats:
        """A, axisymmetric r A, at all places of unknowns, (nunknowns,): a polynomial in every element."""
        return self.symmetry.unknown(self.elements.places, self._values)

    @property
    def _values(self) -> Floats:
        """The potential at all places of unknowns, (nunknowns,)."""
        return self.potential

    @property
    def mean_unknown(self) -> Floats:
        """Mean of `unknown` over every element, (nelements,)."""
        return self.elements.mean_function(self.unknown)

    @cached_property
    def at_quadrature(self) -> PointField:
        """The field at the quadrature points of the elements, whose volumes are `point_volumes`."""
        elements = self.elements
        density = self.symmetry.flux_density(elements.points, elements.gradient(self.unknown))
        given = self.coefficients.at_quadrature(elements.element, elements.points)
        return PointField(elements.element, elements.points, density, given)

    @cached_property
    def point_volumes(self) -> Floats:
        """What the quadrature points stand for, (npoints,), in m^2 per metre of depth, else in m^3: see `volume`."""
        elements = self.elements
        return self.symmetry.volume(elements.points, elements.weights) * (1.0 if self.depth is None else self.depth)

    def load_of(self, weight: Floats) -> Floats:
        """The load of which a change w of `unknown` makes ``int load . grad w`` over the plane.

        That is ``int weight . dB`` over the volume, (2, npoints) each, the weight in A/m.
        """
        return self.symmetry.flux(weight * (1.0 if self.depth is None else self.depth))

    def at_shares(self, element: Ints, share: Floats) -> PointField:
        """The field at points of these elements (n,) that have these barycentric coordinates (3, n).

        B is that of the elements there are: in the plane constant in those of order 1, a polynomial in others; on an
        axis what it tends to in the element.
        """
        x = self.elements.shape.points(element, share)
        density = self._density_of(self.unknown, element, share)
        return PointField(element, x, density, self._coefficients_at(element, x))

    def _coefficients_at(self, element: Ints, x: Floats) -> Coefficients:
        """The materials at points x (2, n) of these elements; of order 1 magnets have means, as B has."""
        linear = isinstance(self.elements, Linear)
        return (replace(self.coefficients, turning=()) if linear else self.coefficients).at_points(element, x)

    def _density_of(self, unknown: Floats, element: Ints, share: Floats) -> Floats:
        """B of a function like `unknown` at such points, (2, n)."""
        if isinstance(self.elements, Linear):
            slope = self.elements.gradient(unknown)
            return self.symmetry.flux_density(self.elements.points, slope)[:, element]
        there = self.elements.inside(element, share)
        slope = self.elements.gradient_at(unknown, element, there)
        return self.symmetry.flux_density(self.elements.shape.points(element, there), slope)

    def strength_at_corners(self, other: Floats) -> tuple[Floats, Floats]:
        """H at the corners of the elements, and how another unknown, (nunknowns,), would change it.

        (2, 3, nelements) in A/m each.
        """
        at = self.at_corners
        change = self.change_at_each(np.eye(3), other, at)
        return at.field_strength.reshape(2, 3, -1), change.reshape(2, 3, -1)

    def change_at_each(self, share: Floats, other: Floats, at: PointField) -> Floats:
        """How another unknown, (nunknowns,), would change H at the points `at` that `at_each` has, (2, n)."""
        return at.change_of_strength(self._density_of(other, *self._in_each(share)))

    def at_each(self, share: Floats) -> PointField:
        """The field at the points of these barycentric coordinates (3, k) in every element, from inside it.

        The points are in the order of (k, nelements).
        """
        return self.at_shares(*self._in_each(share))

    def potential_at_each(self, share: Floats) -> Floats:
        """The potential at such points, (k, nelements)."""
        return self._potential_at(*self._in_each(share)).reshape(share.shape[1], -1)

    def _potential_at(self, element: Ints, share: Floats) -> Floats:
        """The potential at points of these elements, (n,): of the unknown, which is a polynomial there."""
        x = self.elements.shape.points(element, share)
        return self.symmetry.potential(x, self.elements.at(self.unknown, element, share))

    def _in_each(self, share: Floats) -> tuple[Ints, Floats]:
        count = self.mesh.t.shape[1]
        return np.tile(np.arange(count), share.shape[1]), np.repeat(share, count, axis=1)

    @cached_property
    def at_corners(self) -> PointField:
        """The field at the corners of the elements, in the order of ``mesh.t.ravel()``."""
        return self.at_each(np.eye(3))

    @cached_property
    def flux_density(self) -> Floats:
        """``B = (dA/dy, -dA/dx)``; axisymmetric ``(-dA/dz, d(r A)/dr / r)``: (2, nelements) in T, the mean of each."""
        return self.elements.mean(self.at_quadrature.flux_density)

    @cached_property
    def field_strength(self) -> Floats:
        """``H = nu B - Hc``, (2, nelements) in A/m, the mean of each."""
        return self.elements.mean(self.at_quadrature.field_strength)

    @cached_property
    def _reluctivities(self) -> tuple[Floats, Floats]:
        return self.coefficients.reluctivities(self.flux_density)

    @property
    def reluctivity(self) -> Floats:
        """The secant one, ``|H + Hc| / |B|``, (nelements,) in m/H."""
        return self._reluctivities[0]

    @property
    def differential_reluctivity(self) -> Floats:
        """``d|H + Hc| / d|B|``: how H follows a change of B along B, (nelements,) in m/H; across it is the secant."""
        return self._reluctivities[1]

    @property
    def remanence(self) -> Floats:
        """B at which H = 0, (2, nelements) in T."""
        return self.coefficients.remanence

    @property
    def current_density(self) -> Floats:
        """Out of the page, or along phi: (nelements,) in A/m^2."""
        return self.coefficients.current_density

    @cached_property
    def volume(self) -> Floats:
        """Of every element, (nelements,): in m^2, its area, per metre of depth; else in m^3."""
        middle = self.elements.middles
        return self.symmetry.volume(middle, area(self.mesh)) * (1.0 if self.depth is None else self.depth)

    @cached_property
    def energy_density(self) -> Floats:
        """``int H . dB`` since the remanent state, (nelements,) in J/m^3; linear: ``nu |B - Br|^2 / 2``."""
        return self.elements.mean(self.at_quadrature.energy_density)

    @cached_property
    def coenergy_density(self) -> Floats:
        """``H . B`` less the energy density, (nelements,) in J/m^3."""
        return self.elements.mean(self.at_quadrature.coenergy_density)

    @property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh, in J/m whatever the depth; axisymmetric in J."""
        volume = self.symmetry.volume(self.elements.points, self.elements.weights)
        at = self.at_quadrature
        return float(np.sum(volume * at.reluctivities[0] * at.flux_density**2))

    @property
    def energy(self) -> float:
        """Energy stored since the remanent state, ``int of H . dB``, in J/m; a total in J, see `Field`."""
        return float(np.sum(self.volume * self.energy_density))

    @property
    def coenergy(self) -> float:
        """``int H . B`` less the energy, in J/m; a total in J, see `Field`."""
        return float(np.sum(self.volume * self.coenergy_density))
