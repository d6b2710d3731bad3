"""A solved magnetic field: potential, flux density, field strength, energies and values at points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import MeshTri

from kohonen_adapt.estimators.gradients import gradient
from kohonen_adapt.locate import find_elements, interpolate
from kohonen_adapt.magnetostatics.coefficients import Coefficients
from kohonen_adapt.magnetostatics.newton import NewtonStep
from kohonen_adapt.magnetostatics.symmetry import AXISYMMETRIC, PLANAR, Symmetry

__all__ = ["Field"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Field:
    """What `Magnetostatics.solve` returns: the field of a P1 potential, constant in every element.

    Energies of a planar field are per metre of depth, in J/m, unless the problem has a `depth`; with one, and of an
    axisymmetric field, they are totals, in J.

    Parameters
    ----------
    mesh
        The mesh it was solved on, in metres.
    potential : (nnodes,)
        Nodal A_z in Wb/m, or A_phi.
    coefficients
        What every element is made of.
    symmetry
        Whether it is planar or axisymmetric.
    depth
        In m; None for results per metre.
    newton
        The steps of Newton's method that led to it; empty for linear problems.
    """

    mesh: MeshTri
    potential: Floats
    coefficients: Coefficients
    symmetry: Symmetry = PLANAR
    depth: float | None = None
    newton: tuple[NewtonStep, ...] = ()

    @property
    def axisymmetric(self) -> bool:
        """Whether x is the distance r from an axis, y the height z along it and the potential A_phi."""
        return self.symmetry is AXISYMMETRIC

    @property
    def unknown(self) -> Floats:
        """What is linear in every element, (nnodes,): A, axisymmetric r A."""
        return self.symmetry.unknown(self.mesh, self.potential)

    @cached_property
    def flux_density(self) -> Floats:
        """``B = (dA/dy, -dA/dx)``; axisymmetric ``(-dA/dz, d(r A)/dr / r)``: (2, nelements) in T."""
        return self.symmetry.flux_density(self.mesh, gradient(self.mesh, self.unknown))

    @cached_property
    def field_strength(self) -> Floats:
        """``H = nu B - Hc``, (2, nelements) in A/m."""
        return self.coefficients.field_strength(self.flux_density)

    @cached_property
    def _reluctivities(self) -> tuple[Floats, Floats]:
        return self.coefficients.reluctivities(self.flux_density)

    @property
    def reluctivity(self) -> Floats:
        """The secant one, ``|H + Hc| / |B|``, (nelements,) in m/H."""
        return self._reluctivities[0]

    @property
    def differential_reluctivity(self) -> Floats:
        """``d|H + Hc| / d|B|``: how H follows a change of B along B, (nelements,) in m/H; across it is the secant."""
        return self._reluctivities[1]

    @property
    def remanence(self) -> Floats:
        """B at which H = 0, (2, nelements) in T."""
        return self.coefficients.remanence

    @property
    def current_density(self) -> Floats:
        """Out of the page, or along phi: (nelements,) in A/m^2."""
        return self.coefficients.current_density

    @cached_property
    def volume(self) -> Floats:
        """Of every element, (nelements,): in m^2, its area, per metre of depth; else in m^3."""
        return self.symmetry.volume(self.mesh) * (1.0 if self.depth is None else self.depth)

    @cached_property
    def energy_density(self) -> Floats:
        """``int H . dB`` since the remanent state, (nelements,) in J/m^3; linear: ``nu |B - Br|^2 / 2``."""
        return self.coefficients.energy_density(self.flux_density)

    @property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh, in J/m whatever the depth; axisymmetric in J."""
        return float(np.sum(self.symmetry.volume(self.mesh) * self.reluctivity * self.flux_density**2))

    @property
    def coenergy_density(self) -> Floats:
        """``H . B`` less the energy density, (nelements,) in J/m^3."""
        return np.sum(self.field_strength * self.flux_density, axis=0) - self.energy_density

    @property
    def energy(self) -> float:
        """Energy stored since the remanent state, ``int of H . dB``, in J/m; a total in J, see the class."""
        return float(np.sum(self.volume * self.energy_density))

    @property
    def coenergy(self) -> float:
        """``int H . B`` less the energy, in J/m; a total in J, see the class."""
        return float(np.sum(self.volume * self.coenergy_density))

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
