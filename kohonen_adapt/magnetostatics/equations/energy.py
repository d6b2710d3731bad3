"""Energy of a plane field and co-energy of a field in space."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.higher import Elements
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.equations.system import Reduced
from kohonen_adapt.magnetostatics.equations.tetrahedra import Tetrahedra
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.mesh.measures import magnitude, unit_vectors

__all__ = ["CoenergyFunctional", "EnergyFunctional", "Scalar", "scalar_problem"]


@dataclass(frozen=True)
class Scalar:
    """Scalar problem ``-div(reluctivity grad u - flux) = source`` in the plane."""

    reluctivity: Floats  # (nelements,)
    flux: Floats  # (2, nelements)
    source: Floats  # (nelements,)


def scalar_problem(elements: Elements, symmetry: Symmetry, coefficients: Coefficients) -> Scalar:
    return Scalar(
        symmetry.reluctivity(elements.points, coefficients.reluctivity),
        -symmetry.flux(-coefficients.coercivity),
        symmetry.source(coefficients.current_density),
    )


@dataclass(frozen=True)
class EnergyFunctional:
    """Energy functional ``int (int H . dB) - J A`` under boundary conditions.

    It is convex because H rises with B, so that its minimum is the solution.
    """

    elements: Elements
    symmetry: Symmetry
    coefficients: Coefficients
    conditions: Conditions

    @cached_property
    def _at_points(self) -> Coefficients:
        return self.coefficients.at_quadrature(self.elements.element, self.elements.points)

    def at_zero_field(self) -> Self:
        return replace(self, coefficients=replace(self.coefficients, nonlinear_materials=()))

    @property
    def _source(self) -> Floats:
        return self.symmetry.source(self.coefficients.current_density)

    def flux_density(self, u: Floats) -> Floats:
        return self.symmetry.flux_density(self.elements.points, self.elements.gradient(u))

    def value(self, u: Floats) -> tuple[float, float]:
        volume = self.symmetry.volume(self.elements.points, self.elements.weights)
        stored = volume * self._at_points.energy_density(self.flux_density(u))
        spent = self.elements.against_function(self._source, u)
        exterior, exterior_size = (
            (0.0, 0.0) if self.conditions.open_boundary is None else self.conditions.open_boundary.energy(u)
        )
        rounding = np.finfo(float).eps * (float(np.sum(stored)) + float(np.sum(np.abs(spent))) + exterior_size)
        return float(np.sum(stored) - np.sum(spent)) + exterior, rounding

    def residual(self, u: Floats) -> tuple[Floats, float]:
        density, load = self.flux_density(u), self.elements.against_functions(self._source)
        flux = self.symmetry.flux(self._at_points.field_strength(density))
        largest = self._at_points.largest_terms(density)
        sizes = np.hypot(*self.symmetry.flux(np.stack((largest, np.zeros_like(largest)))))
        total = self.elements.assemble_vector(self.elements.against_gradients(flux) - load)
        size = self.elements.assemble_vector(self.elements.against_slopes(sizes) + np.abs(load))
        return self._at_free(total, u), float(np.linalg.norm(size))

    def linear_residual(self, u: Floats) -> Floats:
        scalar = scalar_problem(self.elements, self.symmetry, self._at_points)
        with np.errstate(over="ignore", invalid="ignore"):
            flux = scalar.flux - scalar.reluctivity * self.elements.gradient(u)
            return self._at_free(-self.elements.loads(self._source, flux), u)

    def hessian(self, u: Floats) -> Reduced:
        points, free = self.elements.points, self.conditions.free
        if not self.coefficients.nonlinear_materials:
            return self.elements.stiffness(self.symmetry.reluctivity(points, self._at_points.reluctivity), free)
        slope = self.elements.gradient(u)
        pair = self._at_points.reluctivities(self.symmetry.flux_density(points, slope))
        across, along = (self.symmetry.reluctivity(points, each) for each in pair)
        return self.elements.stiffness(across, free, (along, unit_vectors(slope)))

    def _at_free(self, total: Floats, u: Floats) -> Floats:
        if self.conditions.open_boundary is not None:
            total = total + self.conditions.open_boundary.gradient(u)
        return total[self.conditions.free]


@dataclass(frozen=True)
class CoenergyFunctional:
    """Functional ``int (int_0^|H + Hc| B dh) - load . u`` with ``H = T - grad u``.

    It is convex because B rises with H. Its gradient is ``-int B . grad v``, so that div B = 0 at the minimum.
    """

    elements: Tetrahedra
    coefficients: Coefficients  # at the columns of `Tetrahedra.gradient`
    conditions: Conditions
    drive: Floats  # T without the part in the load, there, (3, n) in A/m
    load: Floats  # (nunknowns,) in Wb

    @classmethod
    def of(cls, drive: Drive, coefficients: Coefficients, conditions: Conditions) -> "CoenergyFunctional":
        elements = drive.elements
        if elements.order > 1:
            coefficients = coefficients.at_points(elements.element, elements.points)
        return cls(elements, coefficients, conditions, drive.inside, drive.load)

    def at_zero_field(self) -> Self:
        return replace(self, coefficients=replace(self.coefficients, nonlinear_materials=()))

    def value(self, u: Floats) -> tuple[float, float]:
        driven = magnitude(self._driven(u))
        stored = float(np.sum(self.elements.gradient_weights * self.coefficients.law_coenergy(driven[None])))
        work = self.load * u
        return stored - float(np.sum(work)), np.finfo(float).eps * (stored + float(np.sum(np.abs(work))))

    def residual(self, u: Floats) -> tuple[Floats, float]:
        strength, coercivity = self._strength(u), self.coefficients.coercivity
        secant, _ = self.coefficients.permeabilities(strength)
        total = self._against_gradients(-secant * (strength + coercivity)) - self.load
        largest = magnitude(self.drive) + magnitude(strength - self.drive) + magnitude(coercivity)
        size = self.elements.assemble_vector(self.elements.against_slopes(secant * largest)) + np.abs(self.load)
        return total[self.conditions.free], float(np.linalg.norm(size))

    def linear_residual(self, u: Floats) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            flux = self._driven(u) / self.coefficients.reluctivity
            return -(self._against_gradients(flux) + self.load)[self.conditions.free]

    def hessian(self, u: Floats) -> Reduced:
        """Return the second derivatives, ``dB/dH`` along H + Hc and ``B/H`` across."""
        free = self.conditions.free
        if not self.coefficients.nonlinear_materials:
            return self.elements.stiffness(1.0 / self.coefficients.reluctivity, free)
        strength = self._strength(u)
        secant, differential = self.coefficients.permeabilities(strength)
        return self.elements.stiffness(secant, free, (differential, unit_vectors(self._driven(u))))

    def flux_density(self, u: Floats) -> Floats:
        secant, _ = self.coefficients.permeabilities(self._strength(u))
        return secant * self._driven(u)

    def linearised(self, flux_density: Floats) -> "LinearisedCoenergy":
        return LinearisedCoenergy(self, flux_density, *self.coefficients.reluctivities(flux_density))

    def _strength(self, u: Floats) -> Floats:
        return self.drive - self.elements.gradient(u)

    def _driven(self, u: Floats) -> Floats:
        return self._strength(u) + self.coefficients.coercivity

    def _against_gradients(self, flux: Floats) -> Floats:
        return self.elements.assemble_vector(self.elements.against_gradients(flux))


@dataclass(frozen=True)
class LinearisedCoenergy:
    # The equations of a co-energy with the tangents of H(B) at a given B in place of the laws.

    energy: CoenergyFunctional
    given: Floats  # B at the columns of `Tetrahedra.gradient`, (3, n) in T
    secant: Floats  # (n,) in m/H, with the differential reluctivity
    differential: Floats

    @property
    def conditions(self) -> Conditions:
        return self.energy.conditions

    def flux_density(self, u: Floats) -> Floats:
        change = self.energy._driven(u) - self.secant * self.given
        unit = unit_vectors(self.given)
        along = np.sum(unit * change, axis=0) * unit
        return self.given + (change - along) / self.secant + along / self.differential

    def linear_residual(self, u: Floats) -> Floats:
        return -(self.energy._against_gradients(self.flux_density(u)) + self.energy.load)[self.conditions.free]

    def hessian(self, u: Floats) -> Reduced:
        tangent = (1.0 / self.differential, unit_vectors(self.given))
        return self.energy.elements.stiffness(1.0 / self.secant, self.conditions.free, tangent)
