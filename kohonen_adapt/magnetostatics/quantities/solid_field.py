"""Ask a solved field in space: values at points, the flux through surfaces, forces and torques."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import checked_points, finite_triple
from kohonen_adapt.magnetostatics.materials.coefficients import magnitude
from kohonen_adapt.magnetostatics.quantities.bodies import Names
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid
from kohonen_adapt.magnetostatics.quantities.solid_forces import eggshell, flux_through
from kohonen_adapt.mesh.locate import find_elements, interpolate

__all__ = ["SolidField"]


@dataclass(frozen=True, eq=False, repr=False)
class SolidField(LocalSolid):
    """A solved field in space; `MagneticScalarPotential.solve` returns it.

    ``H = Hs - grad phi`` with the applied field Hs and ``B = mu (|H + Hc|) (H + Hc)``: without an applied field both
    are constant in every element. What is (nelements,) is the mean of each element. All of it is of the meshed part:
    of half a model half the energy.

    Parameters
    ----------
    mesh
        The mesh it was solved on, in metres.
    unknown : (nnodes,)
        What was solved for, in A: the potential, in iron beside an applied field the total one.
    coefficients
        What every element is made of.
    drive
        The applied field, and where it is taken out of iron.
    planes
        The planes of symmetry by name.
    newton
        The steps of Newton's method that led to it; empty for linear problems.
    """

    def __repr__(self) -> str:
        largest = np.max(magnitude(self.flux_density))
        return (
            f"<{type(self).__name__} on {self.unknown.size} nodes: |B| up to {largest:.4g} T, "
            f"energy {self.energy:.4g} J>"
        )

    def flux_density_at(self, x: ArrayLike, *, recovered: bool = False) -> Floats:
        """Flux density at points: that of the elements, in each constant but for the applied field.

        Parameters
        ----------
        x : (3, n)
            Points in metres; along a line ``np.linspace(start, end, n, axis=1)``.
        recovered
            Whether to interpolate `corner_flux_density` in place of the field of the elements.

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
            middle = self.mesh.p[:, self.mesh.t[:, element]].mean(axis=1)
            share = 0.25 + np.einsum("cin,cn->in", self.elements.hats[:, :, element], points - middle)
            values[:, inside] = np.einsum("cin,in->cn", self.corner_flux_density[:, :, element], share)
        else:
            values[:, inside] = self.at(points, element).flux_density
        return values

    def potential_at(self, x: ArrayLike) -> Floats:
        """The reduced potential at points.

        Parameters
        ----------
        x : (3, n)
            Points in metres.

        Returns
        -------
        ndarray (n,)
            In A; nan outside the mesh.
        """
        return interpolate(self.mesh, self.potential, checked_points(x, "x", 3))

    def flux(self, surface: str) -> float:
        """Magnetic flux through a named surface, ``int B . n``.

        On the outer boundary out of the mesh. Inside it along the sides of an oriented boundary (out of the elements on
        its side, as `skfem.OrientedBoundary` has it); without one along the axis that the surface faces most, x, y or
        z, towards larger values. B there is the mean of the elements on both sides.

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
            If it is no surface of the mesh, or one inside it that turns about and has no orientation.

        Examples
        --------
        >>> import skfem
        >>> from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
        >>> mesh = skfem.MeshTet().refined(2).with_defaults().with_subdomains({"iron": lambda x: x[0] > 0.0})
        >>> field = MagneticScalarPotential({"iron": Material(1e4)}, {"left": 1.0, "right": 0.0}).solve(mesh)
        >>> round(field.flux("right"), 6), round(field.flux("left"), 6)  # mu0 1e4 times 1 A/m times 1 m^2
        (0.012566, -0.012566)
        """
        return flux_through(self.mesh, surface, self.flux_density)

    def force(self, body: Names) -> Floats:
        """Magnetic force on a body.

        ``F = -int T grad w`` over the air around it, with Maxwell's stress tensor ``T = (B B - |B|^2 / 2) / mu0`` and a
        weight w that falls from 1 on the body to 0 on everything else (the eggshell method: Henrotte, Deliege and
        Hameyer, COMPEL 23, 2004).

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that count as one body.

        Returns
        -------
        ndarray (3,)
            In N. Of a body that planes of symmetry cut it is the force on the part that is modelled, along these
            planes: the image adds as much along them, and takes away what is across.

        Raises
        ------
        ValueError
            If the body touches anything but air (permeability 1, no current, no remanence), lies on the outer boundary
            elsewhere than on planes of symmetry, or names are unknown.

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
        """Magnetic torque on a body about a centre: as `force`, with ``(x - centre) x T grad w``.

        Parameters
        ----------
        body
            Name of a subdomain, or a sequence of names that count as one body.
        centre : (3,)
            In m.

        Returns
        -------
        ndarray (3,)
            In N m. Of a body that a plane of symmetry cuts it is the torque on the part that is modelled, across the
            plane: the image adds as much of that, and takes away the rest. The centre should be in the plane.

        Raises
        ------
        ValueError
            As `force` does, and for a centre that is not three finite numbers.

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
