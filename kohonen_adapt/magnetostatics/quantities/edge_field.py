"""Solved field in space of a vector potential on edge elements."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.edge_equations import EdgeDrive
from kohonen_adapt.magnetostatics.equations.given_field import FACET_SIGNS, field_at
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.point_values import PointField, Points
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.quantities.surfaces import oriented_surface

__all__ = ["EdgeField"]


@dataclass(frozen=True, eq=False, repr=False)
class EdgeField(SolidField):
    """Solved field in space, as returned by `MagneticVectorPotential.solve`.

    ``B = curl A`` is constant in every element and free of divergence: fluxes through closed surfaces are zero to
    rounding. ``H = nu(|B|) B - Hc`` is the whole field strength, with the part of the currents. All quantities of
    `SolidField` are offered.

    Parameters
    ----------
    mesh, coefficients, drive, planes, newton, far
        As in `SolidField`.
    unknown : (nedges,)
        Circulations of A along the edges in Wb, from the lower to the higher node.
    """

    drive: EdgeDrive
    kind: ClassVar[Any] = PointField

    def __repr__(self) -> str:
        return self._text(f" on {self.unknown.size} edges", self.flux_density)

    @cached_property
    def flux_density(self) -> Floats:
        return self.drive.edges.curl(self.unknown)

    def _vectors(self, at: Points, unknown: Floats) -> Floats:
        return self.flux_density[:, at.element]

    def _potential_in(self, at: Points) -> Floats:
        return self.drive.edges.at(self.unknown, at.x, at.element)

    def _reaction(self, x: Floats, element: Ints) -> Floats:
        density, function = self.flux_density[:, element], self.drive.function
        return density if function is None else density - VACUUM_PERMEABILITY * field_at(function, x)

    @property
    def potential(self) -> Floats:
        """Circulations of A along the edges, shape (nedges,) in Wb."""
        return self.unknown

    def potential_at(self, x: ArrayLike) -> Floats:
        """Return the vector potential A at points.

        A has no gauge: a gradient may be added. Its circulation along a closed path is the flux through the path.

        Parameters
        ----------
        x : (3, n)
            Points in metres.

        Returns
        -------
        ndarray (3, n)
            In Wb/m; nan outside the mesh.

        Raises
        ------
        ValueError
            If `x` is not of shape (3, n).
        """
        return super().potential_at(x)

    def flux(self, surface: str) -> float:
        """Return the magnetic flux through a named surface, ``int B . n``.

        The flux through a facet is the circulation of A around the facet. It is the same from both sides, and fluxes
        out of a closed surface sum to zero to rounding, in iron, too.

        Parameters
        ----------
        surface
            Name of a boundary of the mesh, with the direction of n as in `SolidField.flux`.

        Returns
        -------
        float
            In Wb.

        Raises
        ------
        ValueError
            As in `SolidField.flux`.

        Examples
        --------
        >>> import skfem
        >>> from kohonen_adapt.magnetostatics import MagneticVectorPotential, Material
        >>> mesh = skfem.MeshTet().refined(2).with_defaults().with_subdomains({"iron": lambda x: x[0] > 0.0})
        >>> field = MagneticVectorPotential({"iron": Material(1e4)}, {"left": 1.0, "right": 0.0}).solve(mesh)
        >>> round(field.flux("right"), 6), round(field.flux("left"), 6)  # mu0 1e4 times 1 A/m times 1 m^2
        (0.012566, -0.012566)
        """
        (facets, _, sign), edges = oriented_surface(self.mesh, surface), self.drive.edges
        circulation = FACET_SIGNS @ self.unknown[edges.on_facets(facets)]
        return float(np.sum(sign * edges.outward(facets) * circulation))
