"""Values of a solved field in the plane and in space."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.estimators.recovery_estimator import corner_averages
from kohonen_adapt.magnetostatics.equations.given_field import Sources
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR, Mirror, Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.point_values import PointField, Points
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.locate import Locator, as_rows, locator_of
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.names import regions_of

__all__ = ["MagneticField"]

PLAIN = 1e-6  # largest difference of relative permeabilities without magnetisation


class MagneticField(ABC):
    """Field with its means over elements and its values at points.

    B is a polynomial in every element. Arrays of shape (nelements,) hold means over elements. Fields of triangles and
    tetrahedra differ in the vectors that the slope of the unknown gives, B or H, and in the volumes of the plane.
    """

    mesh: Any  # triangles or tetrahedra
    unknown: Any  # at the degrees of freedom of the elements
    coefficients: Coefficients
    symmetry: Symmetry = PLANAR
    depth: float | None = None
    kind: ClassVar[Any] = PointField  # of values at points, by their vectors
    far: bool  # True if the potential is 0 far away, of fields with coils
    _reaction: Any

    @property
    @abstractmethod
    def elements(self) -> Space:
        """Finite elements of the potential."""

    @abstractmethod
    def _vectors(self, at: Points, unknown: Floats) -> Floats:
        """Return the vectors of `kind` of a solution at points, (d, n)."""

    @abstractmethod
    def _against(self, at: Any, weight: Floats) -> Floats:
        """Return the vectors whose products with grad w are ``weight . dB`` at points."""

    def _text(self, size: str, flux_density: Floats, unit: str = "J") -> str:
        largest = np.max(magnitude(flux_density))
        return f"<{type(self).__name__}{size}: |B| up to {largest:.4g} T, energy {self.energy:.4g} {unit}>"

    @property
    def order(self) -> int:
        """Order of the elements."""
        return self.elements.order

    @property
    def axisymmetric(self) -> bool:
        """True if x is the radius r, y the height z, and A_phi the potential."""
        return self.symmetry is AXISYMMETRIC

    @property
    def depth_factor(self) -> float:
        # of volumes in the plane
        return 1.0 if self.depth is None else self.depth

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

    # in elements

    def at(self, x: Floats, element: Ints) -> Any:
        """Return the values at points of elements, from inside each element."""
        return self._values(Points.of(self.elements, element, self.elements.barycentric(x, element), x))

    def at_shares(self, element: Ints, share: Floats) -> Any:
        """Return the values at barycentric coordinates (d + 1, n) of elements (n,)."""
        return self._values(Points.of(self.elements, element, share))

    def at_each(self, share: Floats) -> Any:
        """Return the values at coordinates (d + 1, k) of every element, (k, nelements)."""
        return self._values(Points.in_each(self.elements, share))

    def potential_at_each(self, share: Floats) -> Floats:
        """Return the potential at the points of `at_each`, shape (k, nelements)."""
        return self._potential_in(Points.in_each(self.elements, share)).reshape(share.shape[1], -1)

    def change_at_each(self, share: Floats, other: Floats, at: PointField) -> Floats:
        """Return the change of H in the plane by the unknown `other`, at `at_each`."""
        return at.change_of_strength(self._vectors(Points.in_each(self.elements, share), other))

    @cached_property
    def at_corners(self) -> Any:
        """Values at the corners of the elements, in the order of ``mesh.t.ravel()``."""
        corners = self.elements.corners
        x, share = corners.p[:, corners.t.ravel()], np.eye(len(corners.t))
        return self._values(Points.in_each(self.elements, share, x, "at_corners"))

    @cached_property
    def at_quadrature(self) -> Any:
        """Values at the quadrature points."""
        return self._at_quadrature("at_points")

    def _at_quadrature(self, given: str) -> Any:
        elements, x = self.elements, self.elements.points
        at = Points(elements.element, x, x, elements.gradient_at_points, given=given)
        return self._values(at, self.coefficients.at_quadrature(at.element, x))

    def _values(self, at: Points, coefficients: Coefficients | None = None) -> Any:
        # In the plane B is constant where gradients are, and takes the means of magnets.
        means = self.elements.dim == 2 and self.elements.has_constant_gradients
        coefficients = coefficients or self.coefficients.at_points(at.element, at.x, means)
        return self.kind(at.element, at.x, self._vectors(at, self.unknown), coefficients)

    def _potential_in(self, at: Points) -> Floats:
        return self.symmetry.potential(at.x, self.elements.at(self.unknown, at.element, at.share))

    def reaction_at(self, x: Floats, element: Ints) -> Any:
        """Return B in air less the field of coils in free space, at points of elements."""
        return self._reaction(x, element)

    # derivatives

    @property
    def _in_laws(self) -> Any:
        # values at the quadrature points for derivatives of laws
        return self.at_quadrature

    def change_of_flux_density(self, change: Floats) -> Any:
        """Return the change of B by a change of H at the quadrature points in space."""
        return self._in_laws.change_of_flux_density(change)

    def load_of(self, weight: Floats) -> Floats:
        """Return the load whose ``int load . grad w`` is ``int weight . dB``.

        w is a change of `unknown`, and dB the change of B by w. The first integral is over the plane or the volume, the
        second over the volume. Both arrays have shape (d, npoints), and the weight is in A/m.
        """
        return self._volumes(self.elements.points, self._against(self._in_laws, weight))

    def load_at(self, x: Floats, element: Ints, weight: Floats) -> Floats:
        """Return the load of the sum of ``weight . dB`` over points in elements."""
        elements = self.elements
        share = elements.limit_points(element, elements.barycentric(x, element))
        return elements.load_at(element, share, self._against(self.at_shares(element, share), weight))

    # at points

    @cached_property
    def _locator(self) -> Locator:
        return locator_of(self.elements.corners)

    def elements_at(self, x: ArrayLike) -> Ints:
        """Return the elements of points, -1 outside."""
        points = as_rows(x, dim=self.elements.dim)
        return self.elements.located(points.T, self._locator.find(points).astype(np.int64))

    def _at_points(self, given: ArrayLike, values: Callable[[Points], Floats]) -> Floats:
        element = self.elements_at(given)
        inside = element >= 0
        x, own = np.asarray(given, float)[:, inside], element[inside]
        found = values(Points.of(self.elements, own, self.elements.barycentric(x, own), x))
        result = np.full((*found.shape[:-1], inside.size), np.nan)
        result[..., inside] = found
        return result

    def interpolated(self, x: ArrayLike, corners: Floats) -> Floats:
        """Return values (c, n) from values at corners of elements (c, d + 1, nelements)."""
        return self._at_points(x, lambda at: np.einsum("cin,in->cn", corners[:, :, at.element], at.share))

    def flux_density_at(self, x: ArrayLike, *, recovered: bool = False) -> Floats:
        """Return the flux density at points.

        B of an element is constant at order 1, unless a field is applied, and linear at order 2.

        Parameters
        ----------
        x : (d, n)
            Points in metres, of d = 2 or, in space, 3 components; along a line ``np.linspace(start, end, n, axis=1)``.
        recovered
            True to interpolate `corner_flux_density` in place of the field of the elements.

        Returns
        -------
        ndarray (d, n)
            In T; nan outside the mesh.

        Raises
        ------
        ValueError
            If `x` is not of shape (d, n).

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> mesh = skfem.MeshTri().refined(3).with_defaults().with_subdomains({"air": lambda x: x[0] > 0.0})
        >>> problem = Magnetostatics({"air": Material()}, potential={"left": 0.0, "right": 1.0})
        >>> field = problem.solve(mesh)
        >>> line = np.linspace([0.1, 0.5], [0.9, 0.5], 5, axis=1)
        >>> np.allclose(field.flux_density_at(line), [[0.0], [-1.0]])
        True
        """
        if recovered:
            return self.interpolated(x, self.corner_flux_density)
        return self._at_points(x, lambda at: self._values(at).flux_density)

    def field_strength_at(self, x: ArrayLike, *, recovered: bool = False) -> Floats:
        """Return the field strength at points.

        Parameters
        ----------
        x, recovered
            As in `flux_density_at`, with `corner_field_strength` interpolated.

        Returns
        -------
        ndarray (d, n)
            In A/m; nan outside the mesh. Errors are as in `flux_density_at`.
        """
        if recovered:
            return self.interpolated(x, self.corner_field_strength)
        return self._at_points(x, lambda at: self._values(at).field_strength)

    def potential_at(self, x: ArrayLike) -> Floats:
        """Return the potential at points, a polynomial in every element.

        Parameters
        ----------
        x : (d, n)
            Points in metres.

        Returns
        -------
        ndarray (n,)
            A in Wb/m, in space the reduced potential in A; nan outside the mesh. Errors are as in `flux_density_at`.
        """
        return self._at_points(x, self._potential_in)

    # over elements

    @cached_property
    def volume(self) -> Floats:
        """Volumes of the elements, shape (nelements,).

        In m^2 (the area) per metre of depth; with `depth`, axisymmetric and in space in m^3.
        """
        return self._volumes(self.elements.centroids, self.elements.volumes)

    @cached_property
    def point_volumes(self) -> Floats:
        """Volumes of the quadrature points, shape (npoints,), in units of `volume`."""
        return self._volumes(self.elements.points, self.elements.weights)

    def _volumes(self, x: Floats, size: Floats) -> Floats:
        return self.symmetry.volume(x, size) * self.depth_factor

    def points_in(self, inside: Mask) -> tuple[Floats, Ints, Floats]:
        # points (d, n) of a quadrature in some elements, with their elements and volumes
        rows = inside[self.elements.element]
        return self.elements.points[:, rows], self.elements.element[rows], self.point_volumes[rows]

    @cached_property
    def magnetised(self) -> Mask:
        return (np.abs(self.reluctivity * VACUUM_PERMEABILITY - 1.0) > PLAIN) | self.remanence.any(axis=0)

    @cached_property
    def magnetisation(self) -> FloatsPair:
        # points (d, n) in magnetised elements, with mu0 M in T times the volumes of the points
        x, element, volumes = self.points_in(self.magnetised)
        return x, self.at(x, element).magnetisation * volumes

    @cached_property
    def corner_flux_density(self) -> Floats:
        """B recovered at the corners of the elements, (d, d + 1, nelements) in T.

        The corners are in the order of ``mesh.t``. At every node B is the average over the elements around the node,
        weighted by their size, separately for each region (connected, with the same subdomain names), so that B jumps
        between materials. Of order 1 this average is more accurate than the constants of the elements, except at sharp
        corners of iron and magnets.
        """
        return self._recovered(self.at_corners.flux_density)

    @cached_property
    def corner_field_strength(self) -> Floats:
        """H recovered as `corner_flux_density`, (d, d + 1, nelements) in A/m."""
        return self._recovered(self.at_corners.field_strength)

    def _recovered(self, at_corners: Floats) -> Floats:
        return corner_averages(self.mesh, at_corners.reshape(-1, *self.mesh.t.shape), self._regions)

    @cached_property
    def _regions(self) -> Ints:
        return regions_of(self.elements.corners).astype(np.int64)

    @cached_property
    def flux_density(self) -> Floats:
        """Mean B of every element, shape (d, nelements) in T.

        In the plane ``B = (dA/dy, -dA/dx)``, axisymmetric ``(-dA/dz, d(r A)/dr / r)``, in space ``mu (H + Hc)``.
        """
        return self.elements.mean(self.at_quadrature.flux_density)

    @cached_property
    def field_strength(self) -> Floats:
        """Mean H of every element, shape (d, nelements) in A/m.

        In the plane ``H = nu B - Hc``, in space ``Hs - grad phi``.
        """
        return self.elements.mean(self.at_quadrature.field_strength)

    @cached_property
    def _means(self) -> Any:
        vectors, elements = self.elements.mean(self._in_laws.vectors), np.arange(self.mesh.nelements)
        return self.kind(elements, self.elements.centroids, vectors, self.coefficients)

    @property
    def permeabilities(self) -> FloatsPair:
        """Secant ``|B| / |H + Hc|`` and differential one, (nelements,) each in H/m."""
        return self._means.permeabilities

    @property
    def reluctivity(self) -> Floats:
        """Secant reluctivity ``|H + Hc| / |B|``, shape (nelements,) in m/H."""
        return self._means.reluctivities[0]

    @property
    def differential_reluctivity(self) -> Floats:
        """Differential reluctivity ``d|H + Hc| / d|B|`` along B, (nelements,) in m/H."""
        return self._means.reluctivities[1]

    @property
    def current_density(self) -> Floats:
        """Current density out of the page, or along phi, shape (nelements,) in A/m^2."""
        return self.coefficients.current_density

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
        """Co-energy, ``int H . B`` less the energy, in the unit of `energy`."""
        return float(np.sum(self.volume * self.coenergy_density))

    @property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh in J/m, also with `depth`, else in J."""
        at = self.at_quadrature
        return float(np.sum(self.point_volumes * at.reluctivities[0] * at.flux_density**2)) / self.depth_factor
