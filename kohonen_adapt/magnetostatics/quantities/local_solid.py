"""Values of a field in space at points of elements, and their means."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.applied_field import Drive
from kohonen_adapt.magnetostatics.equations.given_field import Sources
from kohonen_adapt.magnetostatics.equations.newton import NewtonStep
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.magnetostatics.quantities.point_values import Strength, WeightedPoints
from kohonen_adapt.mesh.elements.space import Space

__all__ = ["LocalSolid"]


@dataclass(frozen=True, eq=False, repr=False)
class LocalSolid(MagneticField):
    """Potential of a problem in space with its values. See `SolidField`."""

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
    def mirrors(self) -> tuple[Mirror, ...]:
        return tuple(self.planes.values())

    @property
    def sources(self) -> Sources:
        return self.drive.sources

    def at(self, x: Floats, element: Ints) -> Any:  # `Strength`, of a vector potential `PointField`
        slope = self.elements.gradient_at(self.unknown, element, self.elements.barycentric(x, element))
        return Strength(x, self.drive.at(x, element) - slope, self.coefficients.at_points(element, x))

    def _potential_in(self, x: Floats, element: Ints) -> Floats:
        return self.elements.at(self.potential, element, self.elements.barycentric(x, element))

    def reaction_at(self, x: Floats, element: Ints) -> Floats:
        barycentric = self.elements.barycentric(x, element)
        return -VACUUM_PERMEABILITY * self.elements.gradient_at(self.potential, element, barycentric)

    @cached_property
    def at_quadrature(self) -> Any:  # as `at`
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
    def volume(self) -> Floats:
        return self.elements.volumes

    def weighted_points(self, inside: Mask, weight: Floats) -> WeightedPoints:
        x, element, volumes = self.points_in(inside)
        slope = self.elements.slope_of_corners_at(weight, element, x)
        return WeightedPoints(x, element, volumes, slope, self.at(x, element).flux_density)

    def load_of(self, weight: Floats) -> Floats:
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
    def permeabilities(self) -> tuple[Floats, Floats]:
        """Secant ``|B| / |H + Hc|`` and differential permeability, in H/m.

        Shape (nelements,) each.
        """
        return self.coefficients.permeabilities(self.elements.mean(self._in_laws.field_strength))

    @property
    def _reluctivities(self) -> tuple[Floats, Floats]:
        secant, differential = self.permeabilities
        return 1.0 / secant, 1.0 / differential

    @property
    def current_density(self) -> Floats:
        """Magnitude of the curl of the applied field, shape (nelements,) in A/m^2."""
        return self.drive.current_density

    @property
    def current_in_shells(self) -> Floats:
        return self.drive.current_density_without_coils
