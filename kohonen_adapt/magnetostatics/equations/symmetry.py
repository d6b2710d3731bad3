"""What the plane stands for: a section of constant field, or the half-plane of an axis, as one scalar problem each.

The unknown u solves ``-div(nu' grad u - flux') = source'`` in the plane of the mesh.
"""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.mesh.measures import area

__all__ = ["AXISYMMETRIC", "PLANAR", "Axisymmetric", "Planar", "Symmetry"]

AXIS = 1e-12  # of the size of the mesh: nodes this near to the axis are on it


class Planar:
    """u is A_z, ``B = (dA/dy, -dA/dx)``; everything is per metre of depth."""

    def unknown(self, mesh: MeshTri, potential: Floats) -> Floats:
        """u of the nodal potential."""
        return potential

    def potential(self, mesh: MeshTri, unknown: Floats) -> Floats:
        """The nodal potential of u."""
        return unknown

    def on_axis(self, mesh: MeshTri) -> Mask:
        """Which nodes have u = 0 by symmetry."""
        return np.zeros(mesh.p.shape[1], dtype=bool)

    def flux_density(self, mesh: MeshTri, gradient: Floats) -> Floats:
        """B of the gradient of u, (2, nelements)."""
        return np.stack((gradient[1], -gradient[0]))

    def flux(self, field_strength: Floats) -> Floats:
        """``nu' grad u - flux'`` of the field strength, (2, nelements); of -Hc it is -flux'."""
        return np.stack((-field_strength[1], field_strength[0]))

    def weight(self, x: Floats) -> Floats:
        """nu' / nu at points (2, n)."""
        return np.ones(x.shape[1])

    def reluctivity(self, mesh: MeshTri, reluctivity: Floats) -> Floats:
        """nu' of the reluctivity, (nelements,)."""
        return reluctivity

    def source(self, current_density: Floats) -> Floats:
        """source' of the current density, (nelements,)."""
        return current_density

    def volume(self, mesh: MeshTri) -> Floats:
        """Volume of every element, (nelements,)."""
        return area(mesh)


class Axisymmetric:
    """u is r A_phi in the half-plane x = r >= 0, y = z; ``B_r = -(du/dz) / r``, ``B_z = (du/dr) / r``; totals.

    1 / r is taken at the middle of every element: exactly integrated it has no bound at the axis.
    """

    def unknown(self, mesh: MeshTri, potential: Floats) -> Floats:
        """u of the nodal potential."""
        return mesh.p[0] * potential

    def potential(self, mesh: MeshTri, unknown: Floats) -> Floats:
        """The nodal potential of u; 0 on the axis."""
        axis = self.on_axis(mesh)
        return np.where(axis, 0.0, unknown / np.where(axis, 1.0, mesh.p[0]))

    def on_axis(self, mesh: MeshTri) -> Mask:
        """Which nodes have u = 0 by symmetry."""
        near = AXIS * np.max(np.ptp(mesh.p, axis=1))
        outside = np.flatnonzero(mesh.p[0] < -near)
        if outside.size:
            raise ValueError(
                f"an axisymmetric mesh must lie at r = x >= 0; {outside.size} nodes do not, first node {outside[0]} "
                f"at r = {mesh.p[0, outside[0]]:g} m."
            )
        return mesh.p[0] <= near

    def flux_density(self, mesh: MeshTri, gradient: Floats) -> Floats:
        """B of the gradient of u, (2, nelements)."""
        return np.stack((-gradient[1], gradient[0])) / radius(mesh)

    def flux(self, field_strength: Floats) -> Floats:
        """``nu' grad u - flux'`` of the field strength, (2, nelements); of -Hc it is -flux'."""
        return 2.0 * np.pi * np.stack((field_strength[1], -field_strength[0]))

    def weight(self, x: Floats) -> Floats:
        """nu' / nu at points (2, n)."""
        return 2.0 * np.pi / x[0]

    def reluctivity(self, mesh: MeshTri, reluctivity: Floats) -> Floats:
        """nu' of the reluctivity, (nelements,)."""
        return reluctivity * self.weight(mesh.p[:, mesh.t].mean(axis=1))

    def source(self, current_density: Floats) -> Floats:
        """source' of the current density, (nelements,)."""
        return 2.0 * np.pi * current_density

    def volume(self, mesh: MeshTri) -> Floats:
        """Volume of the ring of every element, (nelements,)."""
        return 2.0 * np.pi * radius(mesh) * area(mesh)


Symmetry = Planar | Axisymmetric

PLANAR, AXISYMMETRIC = Planar(), Axisymmetric()


def radius(mesh: MeshTri) -> Floats:
    """Distance of the middle of every element from the axis, (nelements,)."""
    return mesh.p[0, mesh.t].mean(axis=0)
