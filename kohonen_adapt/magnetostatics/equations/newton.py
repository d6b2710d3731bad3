"""Newton's method for nonlinear material: descent of the energy functional, with backtracking."""

import logging
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.equations.system import assembled, check_finite, solved
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients

__all__ = ["TOLERANCE", "Functional", "NewtonStep", "Nonlinear", "iterate", "whole_step"]

TOLERANCE = 1e-8  # of the relative residual and of the relative update
MOST_STEPS = 60
DESCENT = 1e-4  # share of the descent that the slope promises, which a step must bring (Armijo)
SHORTEST = 2.0**-40  # of a step


logger = logging.getLogger("kohonen_adapt")


@dataclass(frozen=True)
class NewtonStep:
    """A step of Newton's method.

    Attributes
    ----------
    residual
        Of the equations after it, relative to the sum of the sizes of their terms.
    update
        Norm of what it added to the unknowns, relative to theirs.
    damping
        Share of the whole step that was taken; 1 unless the functional would have risen.
    functional
        ``int (int H . dB) - J A`` after it, in J/m (axisymmetric: J).
    """

    residual: float
    update: float
    damping: float
    functional: float

    @property
    def converged(self) -> bool:
        """Whether residual and update are small enough."""
        return self.residual <= TOLERANCE and self.update <= TOLERANCE


@dataclass(frozen=True)
class Nonlinear:
    """The energy functional ``Pi(u) = int (int H . dB) - J A`` on one mesh, its gradient and its Hessian.

    ``Pi`` is convex as H rises with B, so its minimum under the conditions is the solution.
    """

    mesh: MeshTri
    given: Coefficients
    symmetry: Symmetry
    conditions: Conditions

    @cached_property
    def _hats(self) -> Floats:
        return hat_gradients(self.mesh)

    @cached_property
    def _area(self) -> Floats:
        return area(self.mesh)

    @cached_property
    def _volume(self) -> Floats:
        return self.symmetry.volume(self.mesh)

    @cached_property
    def _load(self) -> Floats:
        """``int source' phi / |phi's number of corners|``, the same for each corner of an element, (nelements,)."""
        return self._area * self.symmetry.source(self.given.current_density) / 3.0

    def flux_density(self, u: Floats) -> Floats:
        """B of nodal values, (2, nelements)."""
        return self.symmetry.flux_density(self.mesh, gradient(self.mesh, u, self._hats))

    def value(self, u: Floats) -> tuple[float, float]:
        """The functional, and the size of its rounding error."""
        stored = self._volume * self.given.energy_density(self.flux_density(u))
        spent = self._load * np.sum(u[self.mesh.t], axis=0)
        robin = 0.0 if self.conditions.robin is None else 0.5 * float(u @ (self.conditions.robin @ u))
        rounding = np.finfo(float).eps * (float(np.sum(stored)) + float(np.sum(np.abs(spent))) + robin)
        return float(np.sum(stored) - np.sum(spent)) + robin, rounding

    def residual(self, u: Floats) -> tuple[Floats, float]:
        """Gradient at the free nodes, (nfree,), and the norm of the sums of the sizes of its terms."""
        flux_density = self.flux_density(u)
        flux, largest = self.given.field_strength(flux_density), self.given.largest_terms(flux_density)
        terms = np.einsum("ck,cik->ik", self.symmetry.flux(flux) * self._area, self._hats)
        sizes = np.hypot(*self.symmetry.flux(np.stack((largest, np.zeros_like(largest))))) * self._area
        corner, count = self.mesh.t.ravel(), u.size
        total = np.bincount(corner, (terms - self._load).ravel(), count).astype(np.float64)
        size = np.bincount(corner, (sizes * np.hypot(*self._hats) + np.abs(self._load)).ravel(), count)
        if self.conditions.robin is not None:
            total = total + self.conditions.robin @ u
        return total[self.conditions.free], float(np.linalg.norm(size))

    def hessian(self, u: Floats) -> csc_array:
        """Second derivatives at the free nodes: ``nu_d`` along grad u and ``nu`` across it in every element."""
        slope = gradient(self.mesh, u, self._hats)
        pair = self.given.reluctivities(self.symmetry.flux_density(self.mesh, slope))
        across, along = (self._area * self.symmetry.reluctivity(self.mesh, each) for each in pair)
        size = np.hypot(*slope)
        along_slope = np.einsum("ck,cik->ik", slope / np.where(size > 0.0, size, 1.0), self._hats)
        after = [1, 2, 0]
        own = across * np.einsum("cik,cik->ik", self._hats, self._hats) + (along - across) * along_slope**2
        next_one = across * np.einsum("cik,cik->ik", self._hats, self._hats[:, after])
        next_one += (along - across) * along_slope * along_slope[after]
        return assembled(self.mesh, own, next_one, self.conditions.free)


class Functional(Protocol):
    """A convex functional of the unknowns, as `Nonlinear` is one."""

    @property
    def conditions(self) -> Conditions:
        """Which unknowns are free."""

    def value(self, u: Floats) -> tuple[float, float]:
        """The functional, and the size of its rounding error."""

    def residual(self, u: Floats) -> tuple[Floats, float]:
        """Gradient at the free unknowns, and the norm of the sums of the sizes of its terms."""

    def hessian(self, u: Floats) -> csc_array:
        """Second derivatives at the free unknowns."""


def whole_step(problem: Functional, u: Floats, pull: Floats) -> Floats:
    """What Newton's method adds to u where the gradient is `pull`: all it takes where the functional is quadratic."""
    whole = np.zeros_like(u)
    conditions = problem.conditions
    whole[conditions.free] = conditions.expanded(solved(*conditions.reduced(problem.hessian(u), -pull)))
    check_finite(whole)
    return whole


def iterate(problem: Functional, start: Floats) -> tuple[Floats, tuple[NewtonStep, ...]]:
    """Descend from nodal values that keep the conditions; the last values, and all steps, converged or not.

    Newton's steps, halved until they lower the functional as their slope promises, up to rounding. The whole step alone
    may overshoot into saturation by so much that the next ones never come back.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the first step has no finite solution; a later one without ends the descent.
    """
    u, steps = start.copy(), list[NewtonStep]()
    free, conditions = problem.conditions.free, problem.conditions
    pull, size = problem.residual(u)
    if not free.size:
        return u, ()
    while len(steps) < MOST_STEPS and not (steps and steps[-1].converged):
        try:
            whole = whole_step(problem, u, pull)
        except np.linalg.LinAlgError:
            if not steps:
                raise
            break  # a law that has no slope there: what was reached until then is not lost
        damping, functional = _damping(problem, u, whole, float(pull @ whole[free]))
        u = u + damping * whole
        pull, size = problem.residual(u)
        reduced = pull if conditions.join is None else conditions.join.T @ pull
        update = damping * _norm(whole) / max(_norm(u), np.finfo(float).tiny)
        step = NewtonStep(_norm(reduced) / max(size, np.finfo(float).tiny), update, damping, functional)
        steps.append(step)
        logger.debug(
            "Newton step %d: relative residual %.2e, relative update %.2e, damping %g, functional %.9g",
            *(len(steps), step.residual, step.update, step.damping, step.functional),
        )
        if damping < SHORTEST:
            break
    return u, tuple(steps)


def _damping(problem: Functional, u: Floats, whole: Floats, slope: float) -> tuple[float, float]:
    """The first of 1, 1/2, 1/4 ... that lowers the functional, and its value there."""
    before, rounding = problem.value(u)
    damping = 1.0
    while True:
        after, beyond = problem.value(u + damping * whole)
        if after <= before + DESCENT * damping * slope + 10.0 * (rounding + beyond) or damping < SHORTEST:
            return damping, after
        damping *= 0.5


def _norm(values: Floats) -> float:
    return float(np.linalg.norm(values))
