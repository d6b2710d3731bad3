"""Values of a plane field at points of elements, and their means."""

from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.newton import NewtonStep
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR, Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.magnetostatics.quantities.point_values import PointField
from kohonen_adapt.mesh.blended import Projections
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.measures import area

__all__ = ["LocalField"]


@dataclass(frozen=True, eq=False, repr=False)
class LocalField(MagneticField):
    """Potential of a plane problem with its values. See `Field`."""

    mesh: MeshTri
    potential: Floats
    coefficients: Coefficients
    symmetry: Symmetry = PLANAR
    depth: float | None = None
    newton: tuple[NewtonStep, ...] = ()
    _: KW_ONLY
    values: Floats | None = None
    degree: int = 1
    sides: Projections | None = None

    @property
    def axisymmetric(self) -> bool:
        """True if x is the radius r, y the height z, and A_phi the potential."""
        return self.symmetry is AXISYMMETRIC

    @property
    def depth_factor(self) -> float:
        return 1.0 if self.depth is None else self.depth

    @cached_property
    def elements(self) -> Space:
        """Finite elements of the potential."""
        return Space(self.mesh, self.degree, self.coefficients.nonlinear, self.axisymmetric, self.sides)

    @cached_property
    def unknown(self) -> Floats:
        """A, axisymmetric r A, at all degrees of freedom, shape (nunknowns,)."""
        values = self.potential if self.values is None else self.values
        return self.symmetry.unknown(self.elements.doflocs, values)

    @cached_property
    def at_quadrature(self) -> PointField:
        elements = self.elements
        density = self.symmetry.flux_density(elements.points, elements.gradient(self.unknown))
        coefficients = self.coefficients.at_quadrature(elements.element, elements.points)
        return PointField(elements.element, elements.points, density, coefficients)

    @cached_property
    def point_volumes(self) -> Floats:
        """Volumes of the quadrature points, shape (npoints,).

        In m^2 per metre of depth; with `depth`, and axisymmetric, in m^3.
        """
        elements = self.elements
        return self.symmetry.volume(elements.points, elements.weights) * self.depth_factor

    def load_of(self, weight: Floats) -> Floats:
        return self.symmetry.flux(weight * self.depth_factor)

    def load_at(self, x: Floats, weight: Floats) -> Floats:
        # at quadrature points, with ``int load . grad w`` equal to the sum of ``weight . dB`` over points, (2, n)
        elements = self.elements
        element = self.elements_at(x)
        limit = elements.limit_points(element, elements.barycentric(x, element))
        of_volume = self.symmetry.volume(elements.shape.points(element, limit), np.ones(element.size))
        return elements.load_at(element, limit, self.symmetry.flux(weight) / of_volume)

    def at(self, x: Floats, element: Ints) -> PointField:
        return self.at_shares(element, self.elements.barycentric(x, element))

    def _potential_in(self, x: Floats, element: Ints) -> Floats:
        return self._potential_at(element, self.elements.barycentric(x, element))

    def at_shares(self, element: Ints, share: Floats) -> PointField:
        """Return the field at barycentric coordinates `share` (3, n) of elements (n,).

        B at order 1 is constant in the plane, otherwise a polynomial. On an axis B is the limit from inside the
        element.
        """
        x = self.elements.shape.points(element, share)
        density = self._density_of(self.unknown, element, share)
        return PointField(element, x, density, self._coefficients_at(element, x))

    def _coefficients_at(self, element: Ints, x: Floats) -> Coefficients:
        linear = self.elements.has_constant_gradients
        return (replace(self.coefficients, varying_magnets=()) if linear else self.coefficients).at_points(element, x)

    def _density_of(self, unknown: Floats, element: Ints, barycentric: Floats) -> Floats:
        if self.elements.has_constant_gradients:
            slope = self.elements.gradient(unknown)
            return self.symmetry.flux_density(self.elements.points, slope)[:, element]
        limit = self.elements.limit_points(element, barycentric)
        slope = self.elements.gradient_at(unknown, element, limit)
        return self.symmetry.flux_density(self.elements.shape.points(element, limit), slope)

    def strength_at_corners(self, other: Floats) -> tuple[Floats, Floats]:
        """Return H at element corners, and its change by the unknown `other`.

        Both have shape (2, 3, nelements), in A/m; `other` has shape (nunknowns,).
        """
        at = self.at_corners
        change = self.change_at_each(np.eye(3), other, at)
        return at.field_strength.reshape(2, 3, -1), change.reshape(2, 3, -1)

    def change_at_each(self, share: Floats, other: Floats, at: PointField) -> Floats:
        """Return the change of H by the unknown `other`, at the points `at`, (2, n).

        `at` is the result of `at_each` for the same `share`.
        """
        return at.change_of_strength(self._density_in_each(other, share))

    def at_each(self, share: Floats) -> PointField:
        """Return the field at barycentric coordinates (3, k) of every element.

        Points are in the order (k, nelements), each evaluated from inside its element.
        """
        element, barycentric = self._in_each(share)
        x = self.elements.shape.points(element, barycentric)
        return PointField(element, x, self._density_in_each(self.unknown, share), self._coefficients_at(element, x))

    def _density_in_each(self, unknown: Floats, share: Floats) -> Floats:
        if self.axisymmetric:  # B on the axis is a limit
            return self._density_of(unknown, *self._in_each(share))
        return self.symmetry.flux_density(self.elements.points, self.elements.gradient_in_each(unknown, share.T))

    def potential_at_each(self, share: Floats) -> Floats:
        """Return the potential at the points of `at_each`, shape (k, nelements)."""
        return self._potential_at(*self._in_each(share)).reshape(share.shape[1], -1)

    def _potential_at(self, element: Ints, barycentric: Floats) -> Floats:
        x = self.elements.shape.points(element, barycentric)
        return self.symmetry.potential(x, self.elements.at(self.unknown, element, barycentric))

    def _in_each(self, barycentric: Floats) -> tuple[Ints, Floats]:
        count = self.mesh.t.shape[1]
        return np.tile(np.arange(count), barycentric.shape[1]), np.repeat(barycentric, count, axis=1)

    @cached_property
    def at_corners(self) -> PointField:
        """The field at the corners of the elements, in the order of ``mesh.t.ravel()``."""
        return self.at_each(np.eye(3))

    @cached_property
    def volume(self) -> Floats:
        """Volumes of the elements, shape (nelements,).

        In m^2 (the area) per metre of depth; with `depth`, and axisymmetric, in m^3.
        """
        return self.symmetry.volume(self.elements.centroids, area(self.mesh)) * self.depth_factor
