"""Values of a field in space at points of elements, and their means."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import checked_points
from kohonen_adapt.estimators.recovery_estimator import corner_averages
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.given_field import Sources
from kohonen_adapt.magnetostatics.equations.newton import NewtonStep
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.magnetic_field import (
    MagneticField,
    PointValues,
    WeightedPoints,
    tangent_product,
)
from kohonen_adapt.mesh.locate import Locator, as_rows, locator_of
from kohonen_adapt.mesh.space import Space
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization

__all__ = ["LocalSolid", "Strength"]


@dataclass(frozen=True, eq=False)
class Strength(PointValues):
    x: Floats  # (3, n) in m
    field_strength: Floats  # (3, n) in A/m
    coefficients: Coefficients  # of the points

    @cached_property
    def permeabilities(self) -> tuple[Floats, Floats]:
        return self.coefficients.permeabilities(self.field_strength)

    @cached_property
    def flux_density(self) -> Floats:
        return self.permeabilities[0] * (self.field_strength + self.coefficients.coercivity)

    @property
    def magnetisation(self) -> Floats:
        return self.flux_density - VACUUM_PERMEABILITY * self.field_strength

    def change_of_flux_density(self, change: Floats) -> Floats:
        """Return the change of B in T by a small change of H in A/m, both (3, n).

        The permeability is differential along H + Hc and secant across.
        """
        return tangent_product(*self.permeabilities, self.field_strength + self.coefficients.coercivity, change)


@dataclass(frozen=True, eq=False, repr=False)
class LocalSolid(MagneticField):
    """Potential of a problem in space with derived quantities per element.

    See `SolidField`, which adds forces, fluxes and values at points.
    """

    mesh: MeshTet
    unknown: Floats
    coefficients: Coefficients
    drive: Drive
    planes: Mapping[str, Mirror]
    newton: tuple[NewtonStep, ...] = ()
    far: bool = False

    @property
    def potential(self) -> Floats:
        """Reduced potential phi at the unknowns, shape (nunknowns,) in A.

        The unknowns are those of `skfem.ElementTetP1`, the nodes, or of `skfem.ElementTetP2`, the nodes and then the
        edges in the order of ``mesh.edges``. Without an applied field this is the total potential.
        """
        return self.unknown - self.drive.potential

    @property
    def elements(self) -> Space:
        return self.drive.elements

    @property
    def order(self) -> int:
        """Order of the elements."""
        return self.elements.order

    @property
    def mirrors(self) -> tuple[Mirror, ...]:
        return tuple(self.planes.values())

    @property
    def sources(self) -> Sources:
        return self.drive.sources

    @cached_property
    def _locator(self) -> Locator:
        return locator_of(self.mesh)

    def elements_at(self, x: ArrayLike) -> Ints:
        points = as_rows(x, dim=3)
        return self.elements.located(points.T, self._locator.find(points).astype(np.int64))

    def at(self, x: Floats, element: Ints) -> Strength:
        slope = self.elements.gradient_at(self.unknown, element, self.elements.barycentric(x, element))
        return Strength(x, self.drive.at(x, element) - slope, self.coefficients.at_points(element, x))

    def reaction_at(self, x: Floats, element: Ints) -> Floats:
        barycentric = self.elements.barycentric(x, element)
        return -VACUUM_PERMEABILITY * self.elements.gradient_at(self.potential, element, barycentric)

    @cached_property
    def at_quadrature(self) -> Strength:
        return self._at_quadrature(self.drive.at_points)

    @cached_property
    def _in_laws(self) -> Strength:
        # The field of coils takes time, and no linear material needs H.
        return self._at_quadrature(self.drive.inside_at_points)

    def _at_quadrature(self, given: Floats) -> Strength:
        elements = self.elements
        strength = given - elements.gradient_at_points(self.unknown)
        return Strength(elements.points, strength, self.coefficients.at_quadrature(elements.element, elements.points))

    def change_of_flux_density(self, change: Floats) -> Floats:
        # as of `Strength`, at the quadrature points
        return self._in_laws.change_of_flux_density(change)

    @property
    def point_volumes(self) -> Floats:
        return self.elements.weights

    @property
    def volume(self) -> Floats:
        return self.elements.volumes

    def points_in(self, inside: Mask) -> tuple[Floats, Ints, Floats]:
        # points (3, n) of a quadrature in some elements, with their elements and volumes
        rows = inside[self.elements.element]
        return self.elements.points[:, rows], self.elements.element[rows], self.point_volumes[rows]

    def weighted_points(self, inside: Mask, weight: Floats) -> WeightedPoints:
        x, element, volumes = self.points_in(inside)
        slope = self.elements.slope_of_corners_at(weight, element, x)
        return WeightedPoints(x, element, volumes, slope, self.at(x, element).flux_density)

    def magnetisation_in(self, inside: Mask) -> tuple[Floats, Floats]:
        # mu0 M in T times volumes at the points of a quadrature in some elements, with the points, (3, n) each
        rows, at = inside[self.elements.element], self.at_quadrature
        return at.x[:, rows], at.magnetisation[:, rows] * self.point_volumes[rows]

    def points_inside(self, x: ArrayLike) -> tuple[Floats, Ints, Mask]:
        # of x: points in the mesh, their elements, and where they are among all
        points = checked_points(x, "x", 3)
        element = self.elements_at(points)
        inside = element >= 0
        return points[:, inside], element[inside], inside

    def load_of(self, weight: Floats) -> Floats:
        """Return the load whose ``int load . grad w`` is ``int weight . dB``.

        w is a change of `unknown` and dB the change of B by w. Both arrays have shape (3, npoints), and the weight is
        in A/m.
        """
        return -self.change_of_flux_density(weight)

    def load_at(self, x: Floats, weight: Floats) -> Floats:
        return self.load_in(self.elements_at(x), x, weight)

    def load_in(self, element: Ints, x: Floats, weight: Floats) -> Floats:
        change = self.at(x, element).change_of_flux_density(weight)
        return -self.elements.load_at(element, self.elements.barycentric(x, element), change)

    @cached_property
    def at_corners(self) -> Strength:
        corners, count = self.mesh.t, self.mesh.t.shape[1]
        x, element = self.mesh.p[:, corners.ravel()], np.tile(np.arange(count), 4)
        slope = self.elements.gradient_in_each(self.unknown, np.eye(4))
        return Strength(x, self.drive.at_corners - slope, self.coefficients.at_points(element, x))

    @cached_property
    def corner_flux_density(self) -> Floats:
        """B recovered at the corners of the elements, shape (3, 4, nelements) in T.

        The corners are in the order of ``mesh.t``. At every node B is the volume-weighted average over the elements
        around the node, separately for each region (connected, with the same subdomain names), so that B jumps between
        materials.
        """
        region = Tetrahedralization.of(self.mesh).region_of_input.astype(np.int64)
        return corner_averages(self.mesh, self.at_corners.flux_density.reshape(3, 4, -1), region)

    @cached_property
    def field_strength(self) -> Floats:
        """Mean ``H = Hs - grad phi`` of every element, shape (3, nelements) in A/m."""
        return self.elements.mean(self.at_quadrature.field_strength)

    @cached_property
    def flux_density(self) -> Floats:
        """Mean ``B = mu (H + Hc)`` of every element, shape (3, nelements) in T."""
        return self.elements.mean(self.at_quadrature.flux_density)

    @cached_property
    def permeabilities(self) -> tuple[Floats, Floats]:
        """Secant ``|B| / |H + Hc|`` and differential permeability, in H/m.

        Shape (nelements,) each.
        """
        return self.coefficients.permeabilities(self.elements.mean(self._in_laws.field_strength))

    @property
    def reluctivity(self) -> Floats:
        """Secant reluctivity ``|H + Hc| / |B|``, shape (nelements,) in m/H."""
        return 1.0 / self.permeabilities[0]

    @property
    def current_density(self) -> Floats:
        """Magnitude of the curl of the applied field, shape (nelements,) in A/m^2."""
        return self.drive.current_density

    @property
    def current_in_shells(self) -> Floats:
        return self.drive.current_density_without_coils

    @property
    def squared_norm(self) -> float:
        at = self.at_quadrature
        return float(np.sum(self.point_volumes * at.flux_density**2 / at.permeabilities[0]))
