"""Co-energy of a field in space as a functional of its scalar potential."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.sparse import csc_array

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.tetrahedra import Tetrahedra
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients, magnitude

__all__ = ["CoenergyFunctional"]


@dataclass(frozen=True)
class CoenergyFunctional:
    """Functional ``int (int_0^|H + Hc| B dh) - load . u`` with ``H = T - grad u``.

    It is convex because B rises with H. Its gradient is ``-int B . grad v``, so that div B = 0 at the minimum.
    """

    elements: Tetrahedra
    coefficients: Coefficients
    conditions: Conditions
    drive: Floats  # T without the part in the load, mean of every element, (3, nelements) in A/m
    load: Floats  # (nnodes,) in Wb

    def at_zero_field(self) -> Self:
        return replace(self, coefficients=replace(self.coefficients, nonlinear_materials=()))

    def value(self, u: Floats) -> tuple[float, float]:
        driven = magnitude(self._strength(u) + self.coefficients.coercivity)
        stored = float(np.sum(self.elements.volumes * self.coefficients.law_coenergy(driven[None])))
        work = self.load * u
        return stored - float(np.sum(work)), np.finfo(float).eps * (stored + float(np.sum(np.abs(work))))

    def residual(self, u: Floats) -> tuple[Floats, float]:
        strength, coercivity = self._strength(u), self.coefficients.coercivity
        secant, _ = self.coefficients.permeabilities(strength)
        total = self.elements.against_gradients(-secant * (strength + coercivity)) - self.load
        largest = magnitude(self.drive) + magnitude(strength - self.drive) + magnitude(coercivity)
        size = self.elements.against_slopes(secant * largest) + np.abs(self.load)
        return total[self.conditions.free], float(np.linalg.norm(size))

    def linear_residual(self, u: Floats) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            flux = (self._strength(u) + self.coefficients.coercivity) / self.coefficients.reluctivity
            return -(self.elements.against_gradients(flux) + self.load)[self.conditions.free]

    def hessian(self, u: Floats) -> csc_array:
        """Return the second derivatives, ``dB/dH`` along H + Hc and ``B/H`` across."""
        free = self.conditions.free
        if not self.coefficients.nonlinear_materials:
            return self.elements.stiffness(1.0 / self.coefficients.reluctivity, free)
        strength = self._strength(u)
        secant, differential = self.coefficients.permeabilities(strength)
        driven = strength + self.coefficients.coercivity
        size = magnitude(driven)
        return self.elements.stiffness(secant, free, (differential, driven / np.where(size > 0.0, size, 1.0)))

    def _strength(self, u: Floats) -> Floats:
        return self.drive - self.elements.gradient(u)
