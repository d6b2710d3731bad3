"""Energy of a field in space as a functional of a vector potential."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.edges import EdgeElements
from kohonen_adapt.magnetostatics.equations.system import Reduced
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.mesh.measures import magnitude, unit_vectors

__all__ = ["CurlFunctional"]


@dataclass(frozen=True)
class CurlFunctional:
    """Functional ``int (int_0^|B| H dB) - load . u`` with ``B = curl A``.

    It is convex because H rises with B. Its minimum is the negative of the minimum of `CoenergyFunctional` (without its
    constant terms), and values above the minimum bound the exact co-energy from below.
    """

    edges: EdgeElements
    coefficients: Coefficients
    conditions: Conditions
    load: Floats  # (nedges,) in A

    def at_zero_field(self) -> Self:
        return replace(self, coefficients=replace(self.coefficients, nonlinear_materials=()))

    def value(self, u: Floats) -> tuple[float, float]:
        size = magnitude(self.edges.curl(u))
        stored = float(np.sum(self.edges.volumes * self.coefficients.law_energy(size[None])))
        work = self.load * u
        return stored - float(np.sum(work)), np.finfo(float).eps * (stored + float(np.sum(np.abs(work))))

    def residual(self, u: Floats) -> tuple[Floats, float]:
        density, edges = self.edges.curl(u), self.edges
        strength = self.coefficients.reluctivities(density)[0] * density
        sizes = edges.volumes * magnitude(strength) * np.sqrt(np.sum(edges.curls**2, axis=0))
        size = np.bincount(edges.unknowns.ravel(), sizes.ravel(), u.size) + np.abs(self.load)
        return (edges.against_curls(strength) - self.load)[self.conditions.free], float(np.linalg.norm(size))

    def linear_residual(self, u: Floats) -> Floats:
        strength = self.coefficients.reluctivity * self.edges.curl(u)
        return (self.edges.against_curls(strength) - self.load)[self.conditions.free]

    def hessian(self, u: Floats) -> Reduced:
        free = self.conditions.free
        if not self.coefficients.nonlinear_materials:
            return Reduced(self.edges.stiffness(free, self.coefficients.reluctivity).T)
        density = self.edges.curl(u)
        secant, differential = self.coefficients.reluctivities(density)
        return Reduced(self.edges.stiffness(free, secant, (differential, unit_vectors(density))).T)
