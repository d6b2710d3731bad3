"""Solved plane field with values at points, forces, torques and flux linkages."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.estimators.recovery_estimator import corner_averages
from kohonen_adapt.magnetostatics.equations.newton import NewtonStep
from kohonen_adapt.magnetostatics.quantities.bodies import Names
from kohonen_adapt.magnetostatics.quantities.forces import OUT_OF_PAGE, checked_point, force_along
from kohonen_adapt.magnetostatics.quantities.linkage import coil_linkage
from kohonen_adapt.magnetostatics.quantities.local_field import LocalField, PointField
from kohonen_adapt.mesh.locate import as_rows, find_elements, interpolate
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Dual", "Field"]


class Dual(NamedTuple):
    values: Floats  # (nunknowns,)
    source: Floats  # (nelements,)
    load: Floats  # (2, npoints)


@dataclass(frozen=True, eq=False, repr=False)
class Field(LocalField):
    """Solved field of a plane problem, as returned by `Magnetostatics.solve`.

    B of a P1 potential is constant in every element. Energies of a planar field are per metre of depth, in J/m, unless
    the problem has a `depth`. With a depth, and of an axisymmetric field, energies are totals in J.

    Parameters
    ----------
    mesh
        The mesh of the solution, in metres.
    potential : (nnodes,)
        Nodal A_z in Wb/m, or A_phi.
    coefficients
        Material coefficients of every element.
    symmetry
        The planar or the axisymmetric reduction.
    depth
        In m; None for results per metre.
    newton
        Steps of Newton's method; empty for linear problems.
    """

    newton: tuple[NewtonStep, ...] = ()

    def __repr__(self) -> str:
        per_metre = "" if self.axisymmetric or self.depth is not None else "/m"
        largest = np.max(np.hypot(*self.at_corners.flux_density))
        return (
            f"<{type(self).__name__} on {self.potential.size} nodes: |B| up to {largest:.4g} T, "
            f"energy {self.energy:.4g} J{per_metre}>"
        )

    @cached_property
    def _regions(self) -> Ints:
        return Triangulation.of(self.elements.corners).region_of_input.astype(np.int64)

    @cached_property
    def corner_flux_density(self) -> Floats:
        """B recovered at the corners of the elements, shape (2, 3, nelements) in T.

        The corners are in the order of ``mesh.t``. At every node B is the area-weighted average over the elements
        around the node, separately for each region (connected, with the same subdomain names), so that B jumps between
        materials. Of order 1 this average is more accurate than the constants of the elements, except at sharp corners
        of iron and magnets.
        """
        return self._recovered(self.at_corners.flux_density)

    @cached_property
    def corner_field_strength(self) -> Floats:
        """H recovered at the corners of the elements, shape (2, 3, nelements) in A/m.

        The average is as for `corner_flux_density`.
        """
        return self._recovered(self.at_corners.field_strength)

    def _recovered(self, at_corners: Floats) -> Floats:
        return corner_averages(self.mesh, at_corners.reshape(2, 3, -1), self._regions)

    def flux_density_at(self, x: ArrayLike, *, recovered: bool = False) -> Floats:
        """Return the flux density at points.

        B of an element is constant at order 1 and linear at order 2.

        Parameters
        ----------
        x : (2, n)
            Points in metres; along a line ``np.linspace(start, end, n, axis=1)``.
        recovered
            True to interpolate `corner_flux_density` in place of the field of the elements.

        Returns
        -------
        ndarray (2, n)
            In T; nan outside the mesh.

        Raises
        ------
        ValueError
            If `x` is not of shape (2, n).

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
        return self._at(x, self.corner_flux_density if recovered else None, lambda at: at.flux_density)

    def field_strength_at(self, x: ArrayLike, *, recovered: bool = False) -> Floats:
        """Return the field strength at points, from the flux density there.

        Parameters
        ----------
        x, recovered
            As in `flux_density_at`, with `corner_field_strength` interpolated.

        Returns
        -------
        ndarray (2, n)
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
        return self._at(x, self.corner_field_strength if recovered else None, lambda at: at.field_strength)

    def _at(self, x: ArrayLike, corners: Floats | None, of_points: Callable[[PointField], Floats]) -> Floats:
        element, barycentric = self._located(x)
        if corners is None:
            values = of_points(self.at_shares(element, barycentric))
        else:
            values = np.einsum("kin,in->kn", corners[:, :, element], barycentric)
        return np.where(element >= 0, values, np.nan)

    def _located(self, x: ArrayLike) -> tuple[Ints, Floats]:
        points, elements = as_rows(x).T, self.elements
        return elements.shape.locate(points, find_elements(elements.corners, points))

    def potential_at(self, x: ArrayLike) -> Floats:
        """Return the potential at points.

        It is a polynomial of the order of the elements in each.

        Parameters
        ----------
        x : (2, n)
            Points in metres.

        Returns
        -------
        ndarray (n,)
            In Wb/m; nan outside the mesh.

        Raises
        ------
        ValueError
            If `x` is not of shape (2, n).
        """
        return self._interpolated(np.asarray(x, dtype=float))

    def _interpolated(self, x: Floats) -> Floats:
        if self.elements.has_constant_gradients:
            return interpolate(self.mesh, self.potential, x)
        element, barycentric = self._located(x)
        return np.where(element >= 0, self._potential_at(element, barycentric), np.nan)

    def flux_linkage(self, coil: Names, turns: float = 1) -> float:
        """Return the flux linkage of a coil side per metre of depth, or the total.

        The linkage is `turns` times the mean of A over the side, times the depth; axisymmetric, `turns` times the mean
        of ``2 pi r A``. With `depth`, and axisymmetric, it is the total.

        Parameters
        ----------
        coil
            Name of a subdomain, or a sequence of names that form one side.
        turns
            Number of turns; negative for the return side (current into the page), so that the linkages of the sides add
            up to the linkage of the coil.

        Returns
        -------
        float
            In Wb/m, for totals in Wb; positive for the flux of a current out of the page.

        Raises
        ------
        ValueError
            For unknown names, and turns that are zero or not finite.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTri().refined(4).with_defaults()
        >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
        >>> field = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}).solve(mesh)  # B = -1 T along y
        >>> round(field.flux_linkage("coil", turns=100), 1)  # 100 times the mean of A = x, in Wb/m
        50.0
        """
        return coil_linkage(self, coil, turns)

    def force(self, body: Names) -> Floats:
        """Return the magnetic force on a body, per metre of depth or in total.

        ``F = -int T grad w`` over the air around the body, with Maxwell's stress tensor ``T = (B B - |B|^2 / 2) / mu0``
        and a weight w that falls from 1 on the body to 0 on everything else (the eggshell method: Henrotte, Deliege and
        Hameyer, COMPEL 23, 2004; the weight solves Laplace's equation as in FEMM). With `depth`, and axisymmetric, the
        force is the total.

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that form one body.

        Returns
        -------
        ndarray (2,)
            (F_x, F_y) in N/m; with `depth` in N, axisymmetric (0, F_z) in N. For a body that the outer boundary cuts
            along a mirror plane: the force along the plane on the modelled part. The mirror image adds the same force
            along the plane, and cancels the force across.

        Raises
        ------
        ValueError
            If the body touches anything but air (permeability 1, no current, no remanence), lies on the outer boundary
            along lines of several directions, or if names are unknown.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTri().refined(4).with_defaults()
        >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
        >>> field = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}).solve(mesh)  # B = -1 T along y
        >>> round(float(field.force("coil")[0]), 1)  # 1000 A/m^2 times 0.25 m^2 times 1 T, in N/m
        250.0
        """
        return np.array([force_along(self, body, along) for along in np.eye(2)])

    def torque(self, body: Names, centre: ArrayLike = (0.0, 0.0)) -> float:
        """Return the magnetic torque on a body about a centre.

        The torque is computed as in `force`, with ``(x - centre) x T grad w``; per metre of depth, with `depth` the
        total.

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that form one body.
        centre : (2,)
            In m.

        Returns
        -------
        float
            In N m/m, with `depth` in N m; counter-clockwise. For a body that the outer boundary cuts along the two
            sides of a periodic sector about the centre: the torque on the sector.

        Raises
        ------
        ValueError
            For an axisymmetric field, and as in `force`. However, the body may lie on the outer boundary on two sides
            of a sector, with nodes at the same radii, and on circles about the centre (a bore), where a constant
            potential makes no torque.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.25, axis=0)
        >>> mesh = skfem.MeshTri().refined(4).with_defaults()
        >>> mesh = mesh.with_subdomains({"coil": inside, "air": lambda x: ~inside(x)})
        >>> materials = {"coil": Material(current_density=1e3), "air": Material()}
        >>> field = Magnetostatics(materials, potential={"left": 0.0, "right": 1.0}).solve(mesh)  # B = -1 T along y
        >>> abs(field.torque("coil", centre=(0.5, 0.5))) < 0.1  # N m/m
        True
        """
        return force_along(self, body, np.array(OUT_OF_PAGE), checked_point("centre", centre))
