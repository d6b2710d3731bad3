"""Evaluate a solved field element by element: flux density, field strength, energies."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.elements import Elements, Linear
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, PLANAR, Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.mesh.measures import area

__all__ = ["LocalField"]


@dataclass(frozen=True, eq=False, repr=False)
class LocalField:
    """A potential and what follows from it element by element; see `Field`, which can tell more.

    Where it changes inside an element, as it does of order 2, the value of the element is the mean.
    """

    mesh: MeshTri
    potential: Floats
    coefficients: Coefficients
    symmetry: Symmetry = PLANAR
    depth: float | None = None

    @property
    def axisymmetric(self) -> bool:
        """Whether x is the distance r from an axis, y the height z along it and the potential A_phi."""
        return self.symmetry is AXISYMMETRIC

    @cached_property
    def elements(self) -> Elements:
        """The elements whose functions the potential is one of."""
        return Linear(self.mesh)

    @property
    def unknown(self) -> Floats:
        """A, axisymmetric r A, at all places of unknowns, (nunknowns,): a polynomial in every element."""
        return self.symmetry.unknown(self.elements.places, self._values)

    @property
    def _values(self) -> Floats:
        """The potential at all places of unknowns, (nunknowns,)."""
        return self.potential

    @property
    def mean_unknown(self) -> Floats:
        """Mean of `unknown` over every element, (nelements,)."""
        return self.elements.mean_function(self.unknown)

    @cached_property
    def _materials(self) -> Coefficients:
        """Those at the quadrature points, where all that begins with an underscore is."""
        return self.coefficients.repeated(self.elements.weights.size // self.mesh.t.shape[1])

    @cached_property
    def _flux_density(self) -> Floats:
        return self.symmetry.flux_density(self.elements.points, self.elements.gradient(self.unknown))

    @cached_property
    def _field_strength(self) -> Floats:
        return self._materials.field_strength(self._flux_density)

    @cached_property
    def _energy_density(self) -> Floats:
        return self._materials.energy_density(self._flux_density)

    @cached_property
    def flux_density(self) -> Floats:
        """``B = (dA/dy, -dA/dx)``; axisymmetric ``(-dA/dz, d(r A)/dr / r)``: (2, nelements) in T."""
        return self.elements.mean(self._flux_density)

    @cached_property
    def field_strength(self) -> Floats:
        """``H = nu B - Hc``, (2, nelements) in A/m."""
        return self.elements.mean(self._field_strength)

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

    def change_of_strength(self, change: Floats) -> Floats:
        """How H changes with a small change of B: differential along B, secant across it.

        Parameters
        ----------
        change : (2, nelements)
            Of B, in T.

        Returns
        -------
        ndarray (2, nelements)
            Of H, in A/m.
        """
        size = np.hypot(*self.flux_density)
        along = self.flux_density / np.where(size > 0.0, size, 1.0)
        secant, differential = self._reluctivities
        return secant * change + (differential - secant) * np.sum(change * along, axis=0) * along

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
        middle = self.mesh.p[:, self.mesh.t].mean(axis=1)
        return self.symmetry.volume(middle, area(self.mesh)) * (1.0 if self.depth is None else self.depth)

    @cached_property
    def energy_density(self) -> Floats:
        """``int H . dB`` since the remanent state, (nelements,) in J/m^3; linear: ``nu |B - Br|^2 / 2``."""
        return self.elements.mean(self._energy_density)

    @cached_property
    def coenergy_density(self) -> Floats:
        """``H . B`` less the energy density, (nelements,) in J/m^3."""
        whole = np.sum(self._field_strength * self._flux_density, axis=0)
        return self.elements.mean(whole - self._energy_density)

    @property
    def squared_norm(self) -> float:
        """``int nu |B|^2`` over the mesh, in J/m whatever the depth; axisymmetric in J."""
        volume = self.symmetry.volume(self.elements.points, self.elements.weights)
        secant, _ = self._materials.reluctivities(self._flux_density)
        return float(np.sum(volume * secant * self._flux_density**2))

    @property
    def energy(self) -> float:
        """Energy stored since the remanent state, ``int of H . dB``, in J/m; a total in J, see `Field`."""
        return float(np.sum(self.volume * self.energy_density))

    @property
    def coenergy(self) -> float:
        """``int H . B`` less the energy, in J/m; a total in J, see `Field`."""
        return float(np.sum(self.volume * self.coenergy_density))
