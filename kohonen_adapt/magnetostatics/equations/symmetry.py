"""Reduce a plane section, or the half-plane of an axis, to one scalar problem each.

The unknown u solves ``-div(nu' grad u - flux') = source'`` in the plane of the mesh. Points are (2, n).
"""

import numpy as np

from kohonen_adapt.arrays import Floats, Mask

__all__ = ["AXISYMMETRIC", "PLANAR", "Axisymmetric", "Planar", "Symmetry"]

AXIS = 1e-12  # of the size of the mesh: nodes this near to the axis are on it
ROUND = (
    1e-3  # of the size of the mesh: so far off it the centre of an open boundary may be, which is known by its nodes
)


class Planar:
    """u is A_z, ``B = (dA/dy, -dA/dx)``; everything is per metre of depth."""

    turn = 1.0  # what the plane is integrated over across it: a metre, or an angle

    def unknown(self, x: Floats, potential: Floats) -> Floats:
        """u of the potential at points."""
        return potential

    def potential(self, x: Floats, unknown: Floats) -> Floats:
        """The potential of u at points; on an axis it is 0, and tends to that."""
        return unknown

    def on_axis(self, x: Floats) -> Mask:
        """Which of all places of unknowns have u = 0 by symmetry."""
        return np.zeros(x.shape[1], dtype=bool)

    def flux_density(self, x: Floats, gradient: Floats) -> Floats:
        """B of the gradient of u at points, (2, n)."""
        return np.stack((gradient[1], -gradient[0]))

    def flux(self, field_strength: Floats) -> Floats:
        """``nu' grad u - flux'`` of the field strength, (2, n); of -Hc it is -flux'."""
        return np.stack((-field_strength[1], field_strength[0]))

    def reluctivity(self, x: Floats, reluctivity: Floats) -> Floats:
        """nu' of the reluctivity at points."""
        return reluctivity

    def source(self, current_density: Floats) -> Floats:
        """source' of the current density."""
        return current_density

    def volume(self, x: Floats, area: Floats) -> Floats:
        """Volume that an area at a point stands for, around an axis of a ring."""
        return area

    def uniform(self, x: Floats, centre: Floats, field: tuple[float, float]) -> tuple[Floats, int]:
        """u / mu0 of a uniform field in A/m at points, 0 at the centre, and how many dimensions the air beyond has."""
        (along_x, along_y), (x0, y0) = field, x - centre[:, None]
        return along_x * y0 - along_y * x0, 2


class Axisymmetric:
    """u is r A_phi in the half-plane x = r >= 0, y = z; ``B_r = -(du/dz) / r``, ``B_z = (du/dr) / r``; totals.

    Methods are as of `Planar`.
    """

    turn = 2.0 * np.pi

    def unknown(self, x: Floats, potential: Floats) -> Floats:
        return x[0] * potential

    def potential(self, x: Floats, unknown: Floats) -> Floats:
        off = x[0] > 0.0
        return np.where(off, unknown / np.where(off, x[0], 1.0), 0.0)

    def on_axis(self, x: Floats) -> Mask:
        near = AXIS * np.max(np.ptp(x, axis=1))
        outside = np.flatnonzero(x[0] < -near)
        if outside.size:
            raise ValueError(
                f"an axisymmetric mesh must lie at r = x >= 0; {outside.size} nodes do not, first node {outside[0]} "
                f"at r = {x[0, outside[0]]:g} m."
            )
        return x[0] <= near

    def flux_density(self, x: Floats, gradient: Floats) -> Floats:
        return np.stack((-gradient[1], gradient[0])) / x[0]

    def flux(self, field_strength: Floats) -> Floats:
        return self.turn * np.stack((field_strength[1], -field_strength[0]))

    def reluctivity(self, x: Floats, reluctivity: Floats) -> Floats:
        return reluctivity * (self.turn / x[0])

    def source(self, current_density: Floats) -> Floats:
        return self.turn * current_density

    def volume(self, x: Floats, area: Floats) -> Floats:
        return self.turn * x[0] * area

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
