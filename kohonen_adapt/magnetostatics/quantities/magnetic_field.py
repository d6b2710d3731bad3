"""Field in the plane or in space, with its energies at points and per element."""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.given_field import Sources
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.mesh.measures import unit_vectors

__all__ = ["MagneticField", "PointValues", "WeightedPoints", "tangent_product"]


class PointValues:
    x: Floats  # (d, n) in m
    coefficients: Coefficients  # of the points
    flux_density: Any  # (d, n) in T
    field_strength: Any  # (d, n) in A/m

    @cached_property
    def energy_density(self) -> Floats:
        return self.coefficients.energy_density(self.flux_density)

    @property
    def coenergy_density(self) -> Floats:
        return np.sum(self.field_strength * self.flux_density, axis=0) - self.energy_density


def tangent_product(secant: Floats, differential: Floats, direction: Floats, change: Floats) -> Floats:
    """Return the product of the tensor of a linearised law and a small change (d, n).

    The coefficient is `differential` along `direction` (d, n), and `secant` across.
    """
    along = unit_vectors(direction)
    return secant * change + (differential - secant) * np.sum(change * along, axis=0) * along


class WeightedPoints(NamedTuple):
    # points of a quadrature, with the gradient of a weight that is linear in elements
    x: Floats  # (d, n) in m
    element: Ints  # (n,)
    volumes: Floats  # (n,)
    slope: Floats  # (d, n) in 1/m
    flux_density: Floats  # (d, n) in T


class MagneticField:
    mesh: Mesh
    coefficients: Coefficients
    elements: Any  # `FiniteElements` with their quadrature points
    at_quadrature: Any  # `PointValues` at the quadrature points
    point_volumes: Any  # (npoints,): volumes of the quadrature points
    volume: Any  # (nelements,)
    reluctivity: Any  # (nelements,) in m/H
    current_density: Any  # (nelements,) in A/m^2
    load_of: Any  # load (d, npoints) whose ``int load . grad w`` is ``int weight . dB``
    # of fields with coils
    far: bool  # True if the potential is 0 far away
    elements_at: Any  # elements of points x, (n,)
    magnetisation_in: Any  # points of some elements, and mu0 M in T times volumes
    reaction_at: Any  # flux density less the field of coils in free space, at x in elements
    load_in: Any  # load of a weight in A/m times volumes, at x in elements

    @property
    def axisymmetric(self) -> bool:
        return False

    @property
    def mirrors(self) -> tuple[Mirror, ...]:
        return ()

    @property
    def sources(self) -> Sources:
        # the coils that are not meshed
        return Sources({}, None)

    @cached_property
    def kept(self) -> dict[Any, Any]:
        # results common to several quantities of a body or a goal
        return {}

    def weighted_points(self, inside: Mask, weight: Floats) -> WeightedPoints:
        """Return the points in some elements, with the gradient of a weight by nodes."""
        elements, rows = self.elements, inside[self.elements.element]
        slope, density = elements.slope_of_corners(weight), self.at_quadrature.flux_density
        x, element, volumes = elements.points[:, rows], elements.element[rows], self.point_volumes[rows]
        return WeightedPoints(x, element, volumes, slope[:, rows], density[:, rows])

    @property
    def current_in_shells(self) -> Floats:
        # currents that the stress around a body does not allow for
        return self.current_density

    @property
    def remanence(self) -> Floats:
        """B at which H = 0, (d, nelements) in T."""
        return self.coefficients.remanence

    @cached_property
    def energy_density(self) -> Floats:
        """Mean energy density of every element, shape (nelements,) in J/m^3.

        ``int H . dB`` since the remanent state; linear: ``nu |B - Br|^2 / 2``.
        """
        return self.elements.mean(self.at_quadrature.energy_density)

    @cached_property
    def coenergy_density(self) -> Floats:
        """``H . B`` less the energy density, mean, shape (nelements,) in J/m^3."""
        return self.elements.mean(self.at_quadrature.coenergy_density)

    @property
    def energy(self) -> float:
        """Energy ``int H . dB`` since the remanent state, in J/m.

        With `depth`, axisymmetric and in space, the total in J.
        """
        return float(np.sum(self.volume * self.energy_density))

    @property
    def coenergy(self) -> float:
        """Co-energy, ``int H . B`` less the energy, in J/m.

        With `depth`, axisymmetric and in space, the total in J.
        """
        return float(np.sum(self.volume * self.coenergy_density))
