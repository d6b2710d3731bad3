"""Planar and axisymmetric fields as scalar problems.

The unknown u solves ``-div(nu' grad u - flux') = source'`` in the plane of the mesh. Points have shape (2, n).
"""

import numpy as np

from kohonen_adapt.arrays import Floats, Mask

__all__ = ["AXISYMMETRIC", "PLANAR", "Axisymmetric", "Planar", "Symmetry"]

AXIS = 1e-12  # distance at which nodes are on the axis, relative to the size of the mesh
ROUND = 1e-3  # allowed distance of the centre of an open boundary from the axis, relative to the size of the mesh


class Planar:
    """Planar field with u = A_z and ``B = (dA/dy, -dA/dx)``, per metre of depth."""

    extent = 1.0  # factor of integrals over the plane: a metre of depth, or the angle around the axis

    def unknown(self, x: Floats, potential: Floats) -> Floats:
        return potential

    def potential(self, x: Floats, unknown: Floats) -> Floats:
        return unknown

    def on_axis(self, x: Floats) -> Mask:
        return np.zeros(x.shape[1], dtype=bool)

    def flux_density(self, x: Floats, gradient: Floats) -> Floats:
        return np.stack((gradient[1], -gradient[0]))

    def flux(self, field_strength: Floats) -> Floats:
        """Return ``nu' grad u - flux'`` of a field strength, and -flux' of -Hc."""
        return np.stack((-field_strength[1], field_strength[0]))

    def reluctivity(self, x: Floats, reluctivity: Floats) -> Floats:
        return reluctivity

    def source(self, current_density: Floats) -> Floats:
        return current_density

    def volume(self, x: Floats, area: Floats) -> Floats:
        return area

    def uniform(self, x: Floats, centre: Floats, field: tuple[float, float]) -> tuple[Floats, int]:
        """Return ``u / mu0`` of a uniform field, and the dimension of the exterior.

        `field` is in A/m; u is 0 at the centre.
        """
        (along_x, along_y), (x0, y0) = field, x - centre[:, None]
        return along_x * y0 - along_y * x0, 2


class Axisymmetric:
    """Axisymmetric field with u = r A_phi in the half-plane x = r >= 0, y = z.

    ``B_r = -(du/dz) / r`` and ``B_z = (du/dr) / r``; results are totals. Methods are as in `Planar`.
    """

    extent = 2.0 * np.pi

    def unknown(self, x: Floats, potential: Floats) -> Floats:
        return x[0] * potential

    def potential(self, x: Floats, unknown: Floats) -> Floats:
        off_axis = x[0] > 0.0
        return np.where(off_axis, unknown / np.where(off_axis, x[0], 1.0), 0.0)

    def on_axis(self, x: Floats) -> Mask:
        tolerance = AXIS * np.max(np.ptp(x, axis=1))
        outside = np.flatnonzero(x[0] < -tolerance)
        if outside.size:
            raise ValueError(
                f"an axisymmetric mesh must lie at r = x >= 0; {outside.size} nodes do not, first node {outside[0]} "
                f"at r = {x[0, outside[0]]:g} m."
            )
        return x[0] <= tolerance

    def flux_density(self, x: Floats, gradient: Floats) -> Floats:
        return np.stack((-gradient[1], gradient[0])) / x[0]

    def flux(self, field_strength: Floats) -> Floats:
        return self.extent * np.stack((field_strength[1], -field_strength[0]))

    def reluctivity(self, x: Floats, reluctivity: Floats) -> Floats:
        return reluctivity * (self.extent / x[0])

    def source(self, current_density: Floats) -> Floats:
        return self.extent * current_density

    def volume(self, x: Floats, area: Floats) -> Floats:
        return self.extent * x[0] * area

    def uniform(self, x: Floats, centre: Floats, field: tuple[float, float]) -> tuple[Floats, int]:
        size = np.max(np.ptp(x, axis=1))
        if abs(centre[0]) > ROUND * size:
            raise ValueError(
                f"the open boundary of an axisymmetric problem must have its centre on the axis; it is at r = "
                f"{centre[0]:.6g}, z = {centre[1]:.6g} m. Draw it as an arc about a point of the axis."
            )
        return 0.5 * field[1] * x[0] ** 2, 3


Symmetry = Planar | Axisymmetric

PLANAR, AXISYMMETRIC = Planar(), Axisymmetric()
