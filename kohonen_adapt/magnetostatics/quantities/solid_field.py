"""Solved field in space with values at points, fluxes, forces and torques."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import checked_points, finite_triple
from kohonen_adapt.magnetostatics.materials.coefficients import magnitude
from kohonen_adapt.magnetostatics.quantities.bodies import Names
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid
from kohonen_adapt.magnetostatics.quantities.solid_forces import eggshell, flux_through
from kohonen_adapt.mesh.locate import find_elements

__all__ = ["SolidField"]


@dataclass(frozen=True, eq=False, repr=False)
class SolidField(LocalSolid):
    """Solved field in space, as returned by `MagneticScalarPotential.solve`.

    ``H = Hs - grad phi`` with the applied field Hs, and ``B = mu (|H + Hc|) (H + Hc)``. Without an applied field both
    are constant in every element at order 1, and H is linear at order 2. Arrays of shape (nelements,) hold means over
    elements. Results refer to the meshed part: half a model has half the energy.

    Parameters
    ----------
    mesh
        The mesh of the solution, in metres.
    unknown : (nunknowns,)
        Solution in A: the reduced potential, in iron with an applied field the total potential.
    coefficients
        Material coefficients of every element.
    drive
        The applied field, with its replacement in iron.
    planes
        The planes of symmetry by name.
    newton
        Steps of Newton's method; empty for linear problems.
    """

    def __repr__(self) -> str:
        largest = np.max(magnitude(self.flux_density))
        return (
            f"<{type(self).__name__} on {self.mesh.nvertices} nodes: |B| up to {largest:.4g} T, "
            f"energy {self.energy:.4g} J>"
        )

    def flux_density_at(self, x: ArrayLike, *, recovered: bool = False) -> Floats:
        """Return the flux density at points.

        At order 1 B is constant in every element unless a field is applied.

        Parameters
        ----------
        x : (3, n)
            Points in metres; along a line ``np.linspace(start, end, n, axis=1)``.
        recovered
            True to interpolate `corner_flux_density` in place of the field of the elements.

        Returns
        -------
        ndarray (3, n)
            In T; nan outside the mesh.

        Raises
        ------
        ValueError
            If `x` is not of shape (3, n), or not finite.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> mesh = skfem.MeshTet().refined(2).with_defaults().with_subdomains({"air": lambda x: x[0] > 0.0})
        >>> problem = MagneticScalarPotential({"air": Material()}, {"left": 1.0, "right": 0.0})  # 1 A over 1 m
        >>> problem.solve(mesh).field_strength[0].round(9).min()
        np.float64(1.0)
        """
        points = checked_points(x, "x", 3)
        element = find_elements(self.mesh, points)
        inside, values = element >= 0, np.full(points.shape, np.nan)
        points, element = points[:, inside], element[inside]
        if recovered:
            barycentric = self.elements.barycentric(points, element)
            values[:, inside] = np.einsum("cin,in->cn", self.corner_flux_density[:, :, element], barycentric)
        else:
            values[:, inside] = self.at(points, element).flux_density
        return values

    def potential_at(self, x: ArrayLike) -> Floats:
        """Return the reduced potential at points.

        Parameters
        ----------
        x : (3, n)
            Points in metres.

        Returns
        -------
        ndarray (n,)
            In A; nan outside the mesh.
        """
        points = checked_points(x, "x", 3)
        element = find_elements(self.mesh, points)
        inside, values = element >= 0, np.full(len(element), np.nan)
        points, element = points[:, inside], element[inside]
        values[inside] = self.elements.at(self.potential, element, self.elements.barycentric(points, element))
        return values

    def flux(self, surface: str) -> float:
        """Return the magnetic flux through a named surface, ``int B . n``.

        On the outer boundary n points out of the mesh. For an oriented surface inside the mesh n points out of the
        elements on its side, as in `skfem.OrientedBoundary`; for other surfaces inside n points towards larger values
        of the coordinate x, y or z to which the surface is most nearly normal.

        B inside the mesh is the mean of the elements on both sides, and has a divergence: fluxes through iron can be
        10 % off, and fluxes out of a closed surface do not sum to zero. `MagneticVectorPotential` has exact sums.

        Parameters
        ----------
        surface
            Name of a boundary of the mesh.

        Returns
        -------
        float
            In Wb.

        Raises
        ------
        ValueError
            If the mesh has no surface of this name, or if the surface is inside the mesh, has no orientation, and has
            facets nearly parallel to n.

        Examples
        --------
        >>> import skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> mesh = skfem.MeshTet().refined(2).with_defaults().with_subdomains({"iron": lambda x: x[0] > 0.0})
        >>> field = MagneticScalarPotential({"iron": Material(1e4)}, {"left": 1.0, "right": 0.0}).solve(mesh)
        >>> round(field.flux("right"), 6), round(field.flux("left"), 6)  # mu0 1e4 times 1 A/m times 1 m^2
        (0.012566, -0.012566)
        """
        return flux_through(self, surface)

    def force(self, body: Names) -> Floats:
        """Return the magnetic force on a body.

        ``F = -int T grad w`` over the air around the body, with Maxwell's stress tensor ``T = (B B - |B|^2 / 2) / mu0``
        and a weight w that falls from 1 on the body to 0 on everything else (the eggshell method: Henrotte, Deliege and
        Hameyer, COMPEL 23, 2004).

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that form one body.

        Returns
        -------
        ndarray (3,)
            In N. For a body that planes of symmetry cut: the force along the planes on the modelled part. The image
            adds the same force along the planes, and cancels the force across.

        Raises
        ------
        ValueError
            If the body touches anything but air (permeability 1, no current, no remanence), lies on the outer boundary
            elsewhere than on planes of symmetry, or if names are unknown.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.26, axis=0)
        >>> mesh = skfem.MeshTet().refined(3).with_defaults()
        >>> mesh = mesh.with_subdomains({"iron": inside, "air": lambda x: ~inside(x)})
        >>> field = MagneticScalarPotential({"iron": Material(100.0), "air": Material()}, {"left": 0.0}).solve(mesh)
        >>> field.force("iron").tolist()  # nothing drives this field
        [0.0, 0.0, 0.0]
        """
        return eggshell(self, body)

    def torque(self, body: Names, centre: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
        """Return the magnetic torque on a body about a centre.

        The torque is computed as in `force`, with ``(x - centre) x T grad w``.

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that form one body.
        centre : (3,)
            In m.

        Returns
        -------
        ndarray (3,)
            In N m. For a body that a plane of symmetry cuts: the component normal to the plane of the torque on the
            modelled part. The image adds the same component, and cancels the components along the plane. The centre
            should lie in the plane.

        Raises
        ------
        ValueError
            As in `force`, and for a centre that is not three finite numbers.

        Examples
        --------
        >>> import numpy as np, skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> def inside(x):
        ...     return np.all(np.abs(x - 0.5) < 0.26, axis=0)
        >>> mesh = skfem.MeshTet().refined(3).with_defaults()
        >>> mesh = mesh.with_subdomains({"iron": inside, "air": lambda x: ~inside(x)})
        >>> field = MagneticScalarPotential({"iron": Material(100.0), "air": Material()}, {"left": 0.0}).solve(mesh)
        >>> field.torque("iron", centre=(0.5, 0.5, 0.5)).tolist()  # nothing drives this field
        [0.0, 0.0, 0.0]
        """
        return eggshell(self, body, np.array(finite_triple(centre, "centre")))
