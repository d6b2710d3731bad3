"""A solved magnetic field: potential, flux density, field strength, energy and values at points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import MeshTri

from kohonen_adapt.estimators.gradients import gradient
from kohonen_adapt.locate import find_elements, interpolate
from kohonen_adapt.triangles import area

__all__ = ["Field"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Field:
    """What `Magnetostatics.solve` returns: the planar field of a P1 potential, constant in every element.

    Parameters
    ----------
    mesh
        The mesh it was solved on, in metres.
    potential : (nnodes,)
        Nodal A_z in Wb/m.
    reluctivity : (nelements,)
        In m/H.
    remanence : (2, nelements)
        In T.
    """

    mesh: MeshTri
    potential: Floats
    reluctivity: Floats
    remanence: Floats

    @cached_property
    def flux_density(self) -> Floats:
        """``B = (dA/dy, -dA/dx)``, (2, nelements) in T."""
        along_x, along_y = gradient(self.mesh, self.potential)
        return np.stack((along_y, -along_x))

    @cached_property
    def field_strength(self) -> Floats:
        """``H = nu B - Hc`` with ``Hc = nu Br``, (2, nelements) in A/m."""
        return self.reluctivity * (self.flux_density - self.remanence)

    @cached_property
    def energy(self) -> float:
        """Energy stored since the remanent state, ``int of H . dB``: the sum of ``|K| nu |B - Br|^2 / 2``, in J/m."""
        return 0.5 * float(np.sum(area(self.mesh) * self.field_strength * (self.flux_density - self.remanence)))

    def flux_density_at(self, x: ArrayLike) -> Floats:
        """Flux density at points.

        Parameters
        ----------
        x : (2, n)
            Points in metres.

        Returns
        -------
        ndarray (2, n)
            In T, constant per element; nan outside the mesh.
        """
        element = find_elements(self.mesh, np.asarray(x, dtype=float))
        return np.where(element >= 0, self.flux_density[:, element], np.nan)

    def potential_at(self, x: ArrayLike) -> Floats:
        """Potential at points.

        Parameters
        ----------
        x : (2, n)
            Points in metres.

        Returns
        -------
        ndarray (n,)
            In Wb/m; nan outside the mesh.
        """
        return interpolate(self.mesh, self.potential, np.asarray(x, dtype=float))
