"""Minimise an energy by Newton's method with backtracking: one whole step where the material is linear."""

import logging
from dataclasses import dataclass, field

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.energy import EnergyFunctional
from kohonen_adapt.magnetostatics.equations.system import Solver

__all__ = ["TOLERANCE", "Newton", "NewtonStep"]

TOLERANCE = 1e-8  # of the relative residual and of the relative update
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
class Newton:
    """Newton's method: how many steps it may take, and what solves its linear systems."""

    most_steps: int = 60
    solver: Solver = field(default_factory=Solver)

    def whole_step(self, energy: EnergyFunctional, u: Floats, pull: Floats) -> Floats:
        """The whole step from u where the gradient is `pull`: to the minimum, where the functional is quadratic.

        Raises
        ------
        numpy.linalg.LinAlgError
            If that has no finite solution.
        """
        whole, conditions = np.zeros_like(u), energy.conditions
        if conditions.free.size:
            matrix, right = conditions.reduced(energy.hessian(u), -pull)
            whole[conditions.free] = conditions.expanded(self.solver.solve(matrix, right))
        if not np.all(np.isfinite(whole)):
            raise np.linalg.LinAlgError(
                "the potential came out infinite or not a number; look for extreme permeabilities, sources, potentials "
                "or elements that are almost flat."
            )
        return whole

    def linear(self, energy: EnergyFunctional) -> Floats:
        """Values at all unknowns of the solution where nu is that at B = 0, as it is of linear material."""
        given, plain = energy.conditions.values, energy.at_rest()
        return given + self.whole_step(plain, given, plain.linear_residual(given))

    def descend(self, energy: EnergyFunctional, start: Floats) -> tuple[Floats, tuple[NewtonStep, ...]]:
        """Go down from values that keep the conditions; the last values, and all steps, converged or not.

        Newton's steps, halved until they lower the functional as their slope promises, up to rounding. The whole step
        alone may overshoot into saturation by so much that the next ones never come back.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the first step has no finite solution; a later one without ends the descent.
        """
        u, steps = start.copy(), list[NewtonStep]()
        free = energy.conditions.free
        pull, _ = energy.residual(u)
        if not free.size:
            return u, ()
        while len(steps) < self.most_steps and not (steps and steps[-1].converged):
            try:
                whole = self.whole_step(energy, u, pull)
            except np.linalg.LinAlgError:
                if not steps:
                    raise
                break  # a law that has no slope there: what was reached until then is not lost
            damping, functional = _damping(energy, u, whole, float(pull @ whole[free]))
            u = u + damping * whole
            pull, size = energy.residual(u)
            residual = _norm(energy.conditions.gathered(pull)) / max(size, np.finfo(float).tiny)
            update = damping * _norm(whole) / max(_norm(u), np.finfo(float).tiny)
            steps.append(NewtonStep(residual, update, damping, functional))
            logger.debug(
                "Newton step %d: relative residual %.2e, relative update %.2e, damping %g, functional %.9g",
                *(len(steps), residual, update, damping, functional),
            )
            if damping < SHORTEST:
                break
        return u, tuple(steps)


def _damping(energy: EnergyFunctional, u: Floats, whole: Floats, slope: float) -> tuple[float, float]:
    """The first of 1, 1/2, 1/4 ... that lowers the functional, and its value there."""
    before, rounding = energy.value(u)
    damping = 1.0
    while True:
        after, beyond = energy.value(u + damping * whole)
        if after <= before + DESCENT * damping * slope + 10.0 * (rounding + beyond) or damping < SHORTEST:
            return damping, after
        damping *= 0.5


def _norm(values: Floats) -> float:
    return float(np.linalg.norm(values))
