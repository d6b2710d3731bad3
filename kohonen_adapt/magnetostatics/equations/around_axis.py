"""Take u = r A around an axis by P1 functions, with a B that is right in the elements that touch the axis, too."""

from functools import cached_property

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.elements import Linear
from kohonen_adapt.magnetostatics.equations.higher import Elements, Higher
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, Symmetry
from kohonen_adapt.mesh.measures import hat_gradients

__all__ = ["AroundAxis", "elements_on"]


class AroundAxis(Linear):
    """P1 functions u = r A in the half-plane x = r >= 0; B is constant in every element, by the middle of it.

    As u ~ r^2 at the axis, (du/dr) / r of a P1 function is 3/2 or 3/4 of B_z in the elements that touch it, however
    small they are. In these

        B_z = 2 sum u / sum r^2,    B_r = -d(u / r)/dz,

    with sums over the nodes off the axis, and u / r = A linear: both are right in a uniform field, whatever the shape
    of the element. `hats` has that B in place of the gradients, so that there is one B for the equations, the energy,
    and all that is derived. On a solution of the equations with du/dr, the same 2 u / r^2 is 11 % too small at any
    number of nodes, since that energy is too large at the axis and the potential gives way.

    Root mean square error of B in these elements on the axis of FEMM's coil, in parts of B at its middle, (du/dr) / r
    against this: squares of 1/8 and 1/16 inch 0.265 and 0.265 against 0.018 and 0.009; meshes of Gmsh, 1148 and 4298
    nodes, 0.258 and 0.258 against 0.026 and 0.011; the second adapted 0.270 against 0.072. Where nodes are next to the
    axis, the mean of their 2 u / r^2 is twice as far off as the quotient of the sums.
    """

    @cached_property
    def _at_axis(self) -> tuple[Ints, Floats]:
        """The elements that touch the axis, and of their nodes 1 for those off it, else 0: (3, k)."""
        on = AXISYMMETRIC.on_axis(self.mesh.p)[self.mesh.t]
        touching = np.flatnonzero(on.any(axis=0))
        return touching, np.where(on[:, touching], 0.0, 1.0)

    @cached_property
    def hats(self) -> Floats:
        """What stands for the gradients of the functions, (2, 3, nelements): (r B_z, -r B_r) with r at the middle."""
        touching, off = self._at_axis
        slopes, r, middle = hat_gradients(self.mesh), self.mesh.p[0, self.mesh.t[:, touching]], self.points[0, touching]
        slopes[0, :, touching] = (2.0 * middle * off / np.sum(off * r**2, axis=0)).T
        slopes[1, :, touching] *= (middle * off / np.where(off > 0.0, r, 1.0)).T
        return slopes

    def loads(self, source: Floats, flux: Floats) -> Floats:
        return Linear(self.mesh).loads(source, flux)

    def balanced(self, flux: Floats) -> Floats:
        touching, off = self._at_axis
        wanted = self.hats[:, :, touching] - hat_gradients(self.mesh)[:, :, touching]
        missing = off * np.einsum("ck,cik->ik", flux[:, touching], wanted)
        # Edges from the axis are dual to the gradients at their other ends.
        corner = self.mesh.p[:, self.mesh.t[:, touching]]
        foot = np.sum((1.0 - off) * corner, axis=1) / np.sum(1.0 - off, axis=0)
        found = flux.copy()
        found[:, touching] += np.einsum("ik,cik->ck", missing, corner - foot[:, None])
        return found


def elements_on(mesh: MeshTri, order: int, symmetry: Symmetry) -> Elements:
    """The elements of that order on a mesh."""
    if order > 1:
        return Higher(mesh, order)
    return AroundAxis(mesh) if symmetry is AXISYMMETRIC else Linear(mesh)
