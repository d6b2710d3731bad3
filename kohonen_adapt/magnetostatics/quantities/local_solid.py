"""Evaluate a field in space: H and B at points of its elements, energies, and the means of the elements."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.estimators.explicit import corner_averages
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.mirrors import Mirror
from kohonen_adapt.magnetostatics.equations.newton import NewtonStep
from kohonen_adapt.magnetostatics.equations.tetrahedra import Tetrahedra
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients, magnitude
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization

__all__ = ["LocalSolid", "Strength"]


@dataclass(frozen=True, eq=False)
class Strength:
    """The field strength at points, each in one element whose material it has, and what follows from it."""

    x: Floats  # (3, n) in m
    field_strength: Floats  # (3, n) in A/m
    coefficients: Coefficients  # of the points, in place of elements

    @cached_property
    def permeabilities(self) -> tuple[Floats, Floats]:
        """The secant one, ``|B| / |H + Hc|``, and the differential one, (n,) in H/m each."""
        return self.coefficients.permeabilities(self.field_strength)

    @cached_property
    def flux_density(self) -> Floats:
        """``B = mu (H + Hc)``, (3, n) in T."""
        return self.permeabilities[0] * (self.field_strength + self.coefficients.coercivity)

    def change_of_flux_density(self, change: Floats) -> Floats:
        """How B changes, (3, n) in T, with a small change of H, (3, n) in A/m: differential along H + Hc, secant
        across.
        """
        driven = self.field_strength + self.coefficients.coercivity
        size = magnitude(driven)
        along = driven / np.where(size > 0.0, size, 1.0)
        secant, differential = self.permeabilities
        return secant * change + (differential - secant) * np.sum(change * along, axis=0) * along

    @cached_property
    def energy_density(self) -> Floats:
        """``int H . dB`` since the remanent state, (n,) in J/m^3; linear: ``nu |B - Br|^2 / 2``."""
        return self.coefficients.energy_density(self.flux_density)


@dataclass(frozen=True, eq=False, repr=False)
class LocalSolid:
    """A potential in space and what follows from it; see `SolidField`, which can tell more."""

    mesh: MeshTet
    unknown: Floats
    coefficients: Coefficients
    drive: Drive
    planes: Mapping[str, Mirror]
    newton: tuple[NewtonStep, ...] = ()

    @property
    def potential(self) -> Floats:
        """The reduced potential phi at the nodes, (nnodes,) in A; without an applied field the total one."""
        return self.unknown - self.drive.potential

    @property
    def elements(self) -> Tetrahedra:
        """The elements whose functions the potential is one of."""
        return self.drive.elements

    @property
    def mirrors(self) -> tuple[Mirror, ...]:
        """The planes of symmetry."""
        return tuple(self.planes.values())

    def at(self, x: Floats, element: Ints) -> Strength:
        """The field at points x (3, n) of these elements."""
        slope = self.elements.gradient(self.unknown)[:, element]
        return Strength(x, self.drive.at(x, element) - slope, self.coefficients.at_points(element, x))

    @cached_property
    def at_quadrature(self) -> Strength:
        """The field at the quadrature points of the elements, whose volumes are `point_volumes`."""
        elements = self.elements
        strength = self.drive.at_points - elements.slope_of_corners(self.unknown)
        return Strength(elements.points, strength, self.coefficients.at_quadrature(elements.element, elements.points))

    @property
    def point_volumes(self) -> Floats:
        """What the quadrature points stand for, (npoints,) in m^3."""
        return self.elements.weights

    @property
    def volume(self) -> Floats:
        """Of every element, (nelements,) in m^3."""
        return self.elements.volumes

    def load_of(self, weight: Floats) -> Floats:
        """The load of which a change w of `unknown` makes ``int load . grad w``, which is ``int weight . dB``.

        (3, npoints) each, the weight in A/m.
        """
        return -self.at_quadrature.change_of_flux_density(weight)

    @cached_property
    def at_corners(self) -> Strength:
        """The field at the corners of the elements, in the order of ``mesh.t.ravel()``."""
        corners = self.mesh.t
        return self.at(self.mesh.p[:, corners.ravel()], np.tile(np.arange(corners.shape[1]), len(corners)))

    @cached_property
    def corner_flux_density(self) -> Floats:
        """B recovered at the corners of the elements in the order of ``mesh.t``, (3, 4, nelements) in T.

        At every node the average over the elements around it, weighted by volume, for each region (connected, with the
        same subdomain names) by itself, so that B still jumps between materials.
        """
        region = Tetrahedralization.of(self.mesh).region_of_input.astype(np.int64)
        return corner_averages(self.mesh, self.at_corners.flux_density.reshape(3, 4, -1), region)

    @cached_property
    def field_strength(self) -> Floats:
        """``H = Hs - grad phi``, (3, nelements) in A/m, the mean of each element."""
        return self.elements.mean(self.at_quadrature.field_strength)

    @cached_property
    def flux_density(self) -> Floats:
        """``B = mu (H + Hc)``, (3, nelements) in T, the mean of each element."""
        return self.elements.mean(self.at_quadrature.flux_density)

    @cached_property
    def permeabilities(self) -> tuple[Floats, Floats]:
        """The secant permeability ``|B| / |H + Hc|`` and the differential one, (nelements,) in H/m each."""
        return self.coefficients.permeabilities(self.field_strength)

    @property
    def reluctivity(self) -> Floats:
        """The secant one, ``|H + Hc| / |B|``, (nelements,) in m/H."""
        return 1.0 / self.permeabilities[0]

    @property
    def remanence(self) -> Floats:
        """B at which H = 0, (3, nelements) in T."""
        return self.coefficients.remanence

    @property
    def current_density(self) -> Floats:
        """The size of the curl of the applied field, (nelements,) in A/m^2."""
        return self.drive.current_density

    @cached_property
    def energy_density(self) -> Floats:
        """``int H . dB`` since the remanent state, (nelements,) in J/m^3; linear: ``nu |B - Br|^2 / 2``."""
        return self.elements.mean(self.at_quadrature.energy_density)

    @cached_property
    def coenergy_density(self) -> Floats:
        """``H . B`` less the energy density, (nelements,) in J/m^3."""
        at = self.at_quadrature
        return self.elements.mean(np.sum(at.field_strength * at.flux_density, axis=0) - at.energy_density)

    @property
    def energy(self) -> float:
        """Energy stored since the remanent state, ``int of H . dB``, in J."""
        return float(np.sum(self.elements.volumes * self.energy_density))

    @property
    def coenergy(self) -> float:
        """``int H . B`` less the energy, in J."""
        return float(np.sum(self.elements.volumes * self.coenergy_density))

    @property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh, in J."""
        at = self.at_quadrature
        return float(np.sum(self.point_volumes * at.flux_density**2 / at.permeabilities[0]))
