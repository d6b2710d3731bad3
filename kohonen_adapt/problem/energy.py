"""Convex functionals of finite element functions, with two derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Ints
from kohonen_adapt.mesh.host import summed
from kohonen_adapt.mesh.measures import magnitude, unit_vectors

EPSILON, TINY = float(np.finfo(float).eps), float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Densities:
    """Energy densities at points, ``x W(s / x)`` of the size s of a vector.

    W(b) is ``coefficient b^2 / 2``, or the energy of a law. Around an axis x is the distance of the points from the
    axis, and 1 elsewhere. The second derivatives need laws with a method ``secants(b)`` that returns H / b and dH/db.
    """

    weights: Floats | float  # (n,): areas or volumes of the points
    coefficient: Floats  # (n,); of a law at b = 0
    laws: Sequence[tuple[Any, Ints]] = ()  # with the indices of their points
    x: Floats | float = 1.0  # (n,)

    def density(self, size: Floats) -> Floats:
        b = size / self.x
        density = 0.5 * self.coefficient * b**2
        for law, rows in self.laws:
            density[..., rows] = law.energy(b[..., rows])
        return self.x * density

    def energy(self, size: Floats) -> float:
        return float(np.sum(self.weights * self.density(size)))

    def secant(self, size: Floats) -> Floats:
        """Return ``H(b) / s``."""
        b, secant = size / self.x, self.coefficient / self.x
        for law, rows in self.laws:
            secant[rows] = law.field_strength(b[rows]) / np.maximum(size[rows], TINY)
        return secant

    def secants(self, size: Floats) -> FloatsPair:
        """Return the coefficients across and along the vector, ``H / s`` and ``dH/ds``."""
        b, secant = size / self.x, self.coefficient.copy()
        differential = secant.copy()
        for law, rows in self.laws:
            secant[rows], differential[rows] = law.secants(b[rows])
        return secant / self.x, differential / self.x


@dataclass(frozen=True)
class Energy:
    """Functional ``int W(|v|) - load . u + constant`` and terms on boundaries.

    The vector v is ``given + sign D u``. D is the gradient, or the curl of edge elements. The functional is convex, and
    its minimum under the conditions is the solution of its Euler equation.

    Attributes
    ----------
    space
        Functions u, with `gradient`, `against_gradients`, `against_slopes`, `assemble_vector` and `stiffness`.
    densities
        W at the columns of ``space.gradient``.
    load
        Integrals of sources and fluxes against the functions, (nunknowns,).
    conditions
        Prescribed values, pairs and terms on boundaries, None without any.
    given
        Part of v that does not depend on u, (d, n), None for 0.
    sign
        1.0 or -1.0.
    constant
        Part of the value that does not depend on u.
    """

    space: Any
    densities: Densities
    load: Floats
    conditions: Any = None
    given: Floats | None = None
    sign: float = 1.0
    constant: float = 0.0

    @property
    def is_quadratic(self) -> bool:
        return not self.densities.laws

    def at_zero_field(self) -> Self:
        """Return the quadratic functional of the coefficients at v = 0."""
        return replace(self, densities=replace(self.densities, laws=()))

    def vector(self, u: Floats) -> Floats:
        slope = self.space.gradient(u)
        slope = slope if self.sign == 1.0 else self.sign * slope
        return slope if self.given is None else self.given + slope

    def vector_of(self, lower: "Energy", u: Floats) -> Floats:
        """Return v of the function of a functional of another order."""
        return self.vector(self.space.interpolated(lower.space, u))

    def products(self, u: Floats, one: Floats, other: Floats) -> Floats:
        """Return the second derivative by two changes of v, of every element.

        The changes have shape (d, n), the result, ``int W''(v) one . other``, shape (nelements,).
        """
        v, densities = self.vector(u), self.densities
        across, along = densities.secants(magnitude(v))
        unit = unit_vectors(v)
        aligned = np.sum(unit * one, axis=0) * np.sum(unit * other, axis=0)
        terms = densities.weights * (across * np.sum(one * other, axis=0) + (along - across) * aligned)
        element = self.space.groups.element
        return summed(element, terms, self.space.volumes.size)

    def flux(self, u: Floats) -> Floats:
        """Return the derivative of W by v, (d, n)."""
        v = self.vector(u)
        return self.densities.secant(magnitude(v)) * v

    def value(self, u: Floats) -> tuple[float, float]:
        """Return the functional and its rounding error."""
        stored, work = self.densities.energy(magnitude(self.vector(u))), self.load * u
        size = stored + abs(self.constant) + float(np.abs(work).sum())
        exterior = getattr(self.conditions, "open_boundary", None)
        outside, outside_size = (0.0, 0.0) if exterior is None else exterior.energy(u)
        return stored + self.constant - float(work.sum()) + outside, EPSILON * (size + outside_size)

    def gradient(self, u: Floats) -> Floats:
        """Return the derivatives by the free unknowns, (nfree,)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self._against(self.flux(u), u)

    def residual(self, u: Floats) -> tuple[Floats, float]:
        """Return `gradient`, and the norm of the sums of the magnitudes of its terms."""
        v = self.vector(u)
        secant, terms = self.densities.secant(magnitude(v)), magnitude(v)
        if self.given is not None:
            terms = magnitude(self.given) + magnitude(v - self.given)
        sizes = self.space.assemble_vector(self.space.against_slopes(secant * terms)) + np.abs(self.load)
        return self._against(secant * v, u), float(np.linalg.norm(sizes))

    def hessian(self, u: Floats) -> Any:
        """Return the second derivatives by the free unknowns, as of the space."""
        free = self.conditions.free
        if self.is_quadratic:
            return self.space.stiffness(self.densities.coefficient / self.densities.x, free)
        v = self.vector(u)
        across, along = self.densities.secants(magnitude(v))
        return self.space.stiffness(across, free, (along, unit_vectors(v)))

    def _against(self, flux: Floats, u: Floats) -> Floats:
        total = self.sign * self.space.assemble_vector(self.space.against_gradients(flux)) - self.load
        if self.conditions.open_boundary is not None:
            total = total + self.conditions.open_boundary.gradient(u)
        return total[self.conditions.free]
