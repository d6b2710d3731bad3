"""Values of a plane field at points of elements, and their means."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR, Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField, PointValues, tangent_product
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.space import Space

__all__ = ["LocalField", "PointField"]


@dataclass(frozen=True, eq=False)
class PointField(PointValues):
    element: Ints  # (n,): element of every point
    x: Floats  # (2, n) in m
    flux_density: Floats  # (2, n) in T
    coefficients: Coefficients  # of the points

    @cached_property
    def field_strength(self) -> Floats:
        return self.coefficients.field_strength(self.flux_density)

    @cached_property
    def reluctivities(self) -> tuple[Floats, Floats]:
        return self.coefficients.reluctivities(self.flux_density)

    def change_of_strength(self, change: Floats) -> Floats:
        """Return the change of H in A/m by a small change of B in T, both (2, n).

        The reluctivity is differential along B and secant across.
        """
        return tangent_product(*self.reluctivities, self.flux_density, change)


@dataclass(frozen=True, eq=False, repr=False)
class LocalField(MagneticField):
    """Potential of a plane problem with derived quantities per element.

    B is a polynomial in every element, of one degree less than the potential. `at_shares` evaluates B at any points of
    elements, for all evaluations and integrals. Arrays of shape (nelements,) hold means over elements. See `Field`,
    which adds forces and values at points.
    """

    mesh: MeshTri
    potential: Floats
    coefficients: Coefficients
    symmetry: Symmetry = PLANAR
    depth: float | None = None

    @property
    def order(self) -> int:
        """Order of the elements."""
        return 1

    @property
    def axisymmetric(self) -> bool:
        """True if x is the radius r, y the height z, and A_phi the potential."""
        return self.symmetry is AXISYMMETRIC

    @cached_property
    def elements(self) -> Space:
        return Space(self.mesh, self.order, self.coefficients.nonlinear, self.axisymmetric)

    @cached_property
    def unknown(self) -> Floats:
        """A, axisymmetric r A, at all degrees of freedom, shape (nunknowns,)."""
        return self.symmetry.unknown(self.elements.doflocs, self._values)

    @property
    def _values(self) -> Floats:
        return self.potential

    @property
    def mean_unknown(self) -> Floats:
        return self.elements.mean_function(self.unknown)

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
        return self.symmetry.volume(elements.points, elements.weights) * (1.0 if self.depth is None else self.depth)

    def load_of(self, weight: Floats) -> Floats:
        """Return the load whose ``int load . grad w`` is ``int weight . dB``.

        w is a change of `unknown`, and dB the change of B by w. The first integral is over the plane, the second over
        the volume. Both arrays have shape (2, npoints), and the weight is in A/m.
        """
        return self.symmetry.flux(weight * (1.0 if self.depth is None else self.depth))

    def load_at(self, x: Floats, weight: Floats) -> Floats:
        # at quadrature points, with ``int load . grad w`` equal to the sum of ``weight . dB`` over points, (2, n)
        elements = self.elements
        element, barycentric = elements.shape.locate(x, find_elements(elements.corners, x))
        limit = elements.limit_points(element, barycentric)
        of_volume = self.symmetry.volume(elements.shape.points(element, limit), np.ones(element.size))
        return elements.load_at(element, limit, self.symmetry.flux(weight) / of_volume)

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
    def flux_density(self) -> Floats:
        """Mean B of every element, shape (2, nelements) in T.

        ``B = (dA/dy, -dA/dx)``; axisymmetric ``(-dA/dz, d(r A)/dr / r)``.
        """
        return self.elements.mean(self.at_quadrature.flux_density)

    @cached_property
    def field_strength(self) -> Floats:
        """Mean ``H = nu B - Hc`` of every element, shape (2, nelements) in A/m."""
        return self.elements.mean(self.at_quadrature.field_strength)

    @cached_property
    def _reluctivities(self) -> tuple[Floats, Floats]:
        return self.coefficients.reluctivities(self.flux_density)

    @property
    def reluctivity(self) -> Floats:
        """Secant reluctivity ``|H + Hc| / |B|``, shape (nelements,) in m/H."""
        return self._reluctivities[0]

    @property
    def differential_reluctivity(self) -> Floats:
        """Differential reluctivity ``d|H + Hc| / d|B|`` along B, (nelements,) in m/H."""
        return self._reluctivities[1]

    @property
    def current_density(self) -> Floats:
        """Current density out of the page, or along phi, shape (nelements,) in A/m^2."""
        return self.coefficients.current_density

    @cached_property
    def volume(self) -> Floats:
        """Volumes of the elements, shape (nelements,).

        In m^2 (the area) per metre of depth; with `depth`, and axisymmetric, in m^3.
        """
        middle = self.elements.centroids
        return self.symmetry.volume(middle, area(self.mesh)) * (1.0 if self.depth is None else self.depth)

    @property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh in J/m, also with `depth`, axisymmetric in J."""
        volume = self.symmetry.volume(self.elements.points, self.elements.weights)
        at = self.at_quadrature
        return float(np.sum(volume * at.reluctivities[0] * at.flux_density**2))
