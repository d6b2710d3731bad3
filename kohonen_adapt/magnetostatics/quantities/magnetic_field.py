"""Values of a solved field at points and per element, in the plane or in space."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.estimators.recovery_estimator import corner_averages
from kohonen_adapt.magnetostatics.equations.given_field import Sources
from kohonen_adapt.magnetostatics.equations.symmetry import Mirror
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.quantities.point_values import PointValues, WeightedPoints
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.locate import Locator, as_rows, locator_of
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["MagneticField"]


class MagneticField(ABC):
    """Field with its means over elements and its values at points.

    B is a polynomial in every element. Arrays of shape (nelements,) hold means over elements.
    """

    mesh: Any  # triangles or tetrahedra
    coefficients: Coefficients
    at_quadrature: Any  # `PointValues` at the quadrature points
    at_corners: Any  # `PointValues` at the corners of elements, in the order of ``mesh.t.ravel()``
    volume: Any  # (nelements,)
    # of fields with coils
    far: bool  # True if the potential is 0 far away
    reaction_at: Any  # flux density less the field of coils in free space, at x in elements
    load_in: Any  # load of a weight in A/m times volumes, at x in elements

    @property
    @abstractmethod
    def elements(self) -> Space:
        """Finite elements of the potential."""

    @abstractmethod
    def at(self, x: Floats, element: Ints) -> PointValues:
        """Return the values at points of elements, from inside each element."""

    @abstractmethod
    def _potential_in(self, x: Floats, element: Ints) -> Floats:
        """Return the potential at points of elements."""

    @abstractmethod
    def load_of(self, weight: Floats) -> Floats:
        """Return the load whose ``int load . grad w`` is ``int weight . dB``.

        w is a change of `unknown`, and dB the change of B by w. The first integral is over the plane or the volume, the
        second over the volume. Both arrays have shape (d, npoints), and the weight is in A/m.
        """

    @property
    def order(self) -> int:
        """Order of the elements."""
        return self.elements.order

    @property
    def axisymmetric(self) -> bool:
        """True if x is the radius r, y the height z, and A_phi the potential."""
        return False

    @property
    def depth_factor(self) -> float:
        # of volumes in the plane
        return 1.0

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

    # at points

    @cached_property
    def _locator(self) -> Locator:
        return locator_of(self.elements.corners)

    def elements_at(self, x: ArrayLike) -> Ints:
        """Return the elements of points, -1 outside."""
        points = as_rows(x, dim=self.elements.dim)
        return self.elements.located(points.T, self._locator.find(points).astype(np.int64))

    def _values_at(self, x: ArrayLike, values: Callable[[Floats, Ints], Floats]) -> Floats:
        element = self.elements_at(x)
        inside = element >= 0
        found = values(np.asarray(x, dtype=float)[:, inside], element[inside])
        result = np.full((*found.shape[:-1], inside.size), np.nan)
        result[..., inside] = found
        return result

    def _recovered_at(self, x: ArrayLike, corners: Floats) -> Floats:
        def values(x: Floats, element: Ints) -> Floats:
            return np.einsum("cin,in->cn", corners[:, :, element], self.elements.barycentric(x, element))

        return self._values_at(x, values)

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
            return self._recovered_at(x, self.corner_flux_density)
        return self._values_at(x, lambda x, element: self.at(x, element).flux_density)

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

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> mesh = skfem.MeshTri().refined(3).with_defaults().with_subdomains({"iron": lambda x: x[0] > 0.0})
        >>> problem = Magnetostatics({"iron": Material(1000.0)}, potential={"left": 0.0, "right": 1.0})
        >>> problem.solve(mesh).field_strength_at([[0.3], [0.5]])[1].round(1).tolist()  # B / mu, of -1 T along y
        [-795.8]
        """
        if recovered:
            return self._recovered_at(x, self.corner_field_strength)
        return self._values_at(x, lambda x, element: self.at(x, element).field_strength)

    def potential_at(self, x: ArrayLike) -> Floats:
        """Return the potential at points.

        It is a polynomial of the order of the elements in each.

        Parameters
        ----------
        x : (d, n)
            Points in metres.

        Returns
        -------
        ndarray (n,)
            A in Wb/m, in space the reduced potential in A; nan outside the mesh.

        Raises
        ------
        ValueError
            If `x` is not of shape (d, n).
        """
        return self._values_at(x, self._potential_in)

    # over elements

    @property
    def point_volumes(self) -> Floats:
        """Volumes of the quadrature points, shape (npoints,)."""
        return self.elements.weights

    def points_in(self, inside: Mask) -> tuple[Floats, Ints, Floats]:
        # points (d, n) of a quadrature in some elements, with their elements and volumes
        rows = inside[self.elements.element]
        return self.elements.points[:, rows], self.elements.element[rows], self.point_volumes[rows]

    def magnetisation_in(self, inside: Mask) -> tuple[Floats, Floats]:
        # mu0 M in T times volumes at the points of a quadrature in some elements, with the points, (d, n) each
        rows, at = inside[self.elements.element], self.at_quadrature
        return at.x[:, rows], at.magnetisation[:, rows] * self.point_volumes[rows]

    def weighted_points(self, inside: Mask, weight: Floats) -> WeightedPoints:
        """Return the points in some elements, with the gradient of a weight by nodes."""
        rows = inside[self.elements.element]
        slope, density = self.elements.slope_of_corners(weight), self.at_quadrature.flux_density
        return WeightedPoints(*self.points_in(inside), slope[:, rows], density[:, rows])

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
        """H recovered at the corners of the elements, (d, d + 1, nelements) in A/m.

        The average is as for `corner_flux_density`.
        """
        return self._recovered(self.at_corners.field_strength)

    def _recovered(self, at_corners: Floats) -> Floats:
        values = at_corners.reshape(-1, *self.mesh.t.shape)
        return corner_averages(self.mesh, values, self._regions)

    @cached_property
    def _regions(self) -> Ints:
        kind = Triangulation if self.elements.dim == 2 else Tetrahedralization
        return kind.of(self.elements.corners).region_of_input.astype(np.int64)

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

    @property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh in J/m, also with `depth`, else in J."""
        at = self.at_quadrature
        return float(np.sum(self.point_volumes * at.reluctivities[0] * at.flux_density**2)) / self.depth_factor
