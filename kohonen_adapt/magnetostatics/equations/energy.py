"""Energy of a plane field and co-energy of a field in space."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.materials.laws import reluctivities
from kohonen_adapt.mesh.elements.assembly import Reduced
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.measures import magnitude, unit_vectors
from kohonen_adapt.problem.energy import Energy

__all__ = ["CoEnergy", "PlaneEnergy", "Tangent", "coenergy"]


@dataclass(frozen=True, kw_only=True)
class PlaneEnergy(Energy):
    """Energy functional ``int (int H . dB) - J A``, with the data of the field."""

    symmetry: Symmetry
    coefficients: Coefficients

    @classmethod
    def of(cls, elements: Space, symmetry: Symmetry, coefficients: Coefficients, conditions: Conditions) -> Self:
        points = elements.points
        at = coefficients.at_quadrature(elements.element, points)
        densities = at.densities(elements.weights, symmetry.extent, points[0] if symmetry.axis else 1.0)
        load = elements.loads(symmetry.source(coefficients.current_density), symmetry.flux(at.coercivity))
        at_rest = at.energy_density(np.zeros_like(at.remanence))
        constant = float(np.sum(symmetry.volume(points, elements.weights) * at_rest))
        parts = elements, densities, load, conditions, None, 1.0, constant
        return cls(*parts, symmetry=symmetry, coefficients=coefficients)


@dataclass(frozen=True, kw_only=True)
class CoEnergy(Energy):
    """Co-energy ``int (int_0^|H + Hc| B dh) - load . u``.

    The field strength is ``H = T - grad u``. The derivatives are ``-int B . grad v``, so that div B = 0 at the minimum.
    """

    drive: Drive

    def vector_of(self, lower: Energy, u: Floats) -> Floats:
        # Outside iron u is the potential less chi, which each order interpolates.
        found, drive = super().vector_of(lower, u), self.drive
        if drive.function is None or not isinstance(lower, CoEnergy):
            return found
        change = self.space.interpolated(lower.space, lower.drive.potential) - drive.potential
        return found + np.where(drive.iron[self.space.groups.element], 0.0, self.space.gradient(change))


def coenergy(drive: Drive, coefficients: Coefficients, conditions: Conditions) -> CoEnergy:
    elements = drive.elements
    if elements.order > 1:
        coefficients = coefficients.at_points(elements.element, elements.points)
    densities, given = (
        coefficients.coenergy_densities(elements.gradient_weights),
        drive.inside + coefficients.coercivity,
    )
    return CoEnergy(elements, densities, drive.load, conditions, given, -1.0, drive=drive)


@dataclass(frozen=True, kw_only=True)
class Tangent(Energy):
    """Co-energy with the tangents of H(B) at given B in place of the laws."""

    about: Floats  # B, (3, n) in T
    secant: Floats  # (n,) in m/H, with the differential reluctivity
    differential: Floats

    @classmethod
    def of(cls, energy: Energy, flux_density: Floats) -> Self:
        secant = 1.0 / energy.densities.coefficient
        differential, size = secant.copy(), magnitude(flux_density)
        for law, rows in energy.densities.laws:
            secant[rows], differential[rows] = reluctivities(law.law, size[rows])
        common = {each.name: getattr(energy, each.name) for each in fields(Energy)}
        return cls(**common, about=flux_density, secant=secant, differential=differential)

    def flux(self, u: Floats) -> Floats:
        change = self.vector(u) - self.secant * self.about
        unit = unit_vectors(self.about)
        along = np.sum(unit * change, axis=0) * unit
        return self.about + (change - along) / self.secant + along / self.differential

    def hessian(self, u: Floats) -> Reduced:
        along = 1.0 / self.differential, unit_vectors(self.about)
        return self.space.stiffness(1.0 / self.secant, self.conditions.free, along)
