"""Damped Newton's method for convex functionals."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.log import logger
from kohonen_adapt.magnetostatics.equations.energy import Tangent
from kohonen_adapt.magnetostatics.equations.system import Solver
from kohonen_adapt.problem.energy import TINY, Energy

__all__ = ["TOLERANCE", "Newton", "NewtonStep", "NotConverged", "refuse_unconverged"]

TOLERANCE = 1e-8  # of the relative residual and of the relative change by all further steps
ROUGH = 1e-3  # residual of conjugate gradients in steps that serve differences only, relative to that before the step
DESCENT = 1e-4  # fraction of the descent predicted by the slope that a step must reach (Armijo)
LEAST_DAMPING = 2.0**-40  # least damping
PATIENCE = 4  # steps without a new least functional
NEAR = 0.03  # relative residual from which a step for the potential alone is tried
SLOW = 0.3  # largest residual after this step, relative to the residual before


@dataclass(frozen=True)
class NewtonStep:
    """Step of Newton's method.

    Attributes
    ----------
    residual
        Residual of the equations after the step, relative to the sum of the magnitudes of their terms.
    update
        Norm of the change of the unknowns, relative to the norm of the unknowns.
    damping
        Fraction of the whole step that was taken; 1 unless the functional would have increased.
    functional
        ``int (int H . dB) - J A`` after the step, in J/m (axisymmetric: J); in space the co-energy ``int (int B . dH)``
        in J.
    remaining
        Estimate of the change by all further steps, like `update`: the geometric series of the last two updates if
        whole steps shrink to less than half, else the update.
    """

    residual: float
    update: float
    damping: float
    functional: float
    remaining: float

    @property
    def converged(self) -> bool:
        """True if residual and remaining change are at most `TOLERANCE`."""
        return self.residual <= TOLERANCE and self.remaining <= TOLERANCE


Steps = tuple[NewtonStep, ...]


class NotConverged(np.linalg.LinAlgError):
    """Newton's method has not converged (a kind of ValueError).

    Attributes
    ----------
    field
        The last iterate as a `Field`, in space a `SolidField`.
    steps
        All steps, a tuple of `NewtonStep`.
    """

    def __init__(self, field: Any) -> None:
        self.field, self.steps = field, field.newton
        last = ", ".join(f"{step.residual:.1e}" for step in self.steps[-3:])
        super().__init__(
            f"Newton's method has not converged in {len(self.steps)} steps: the last relative residuals are {last}, "
            f"required {TOLERANCE:g}. Check for a law H(B) that does not increase everywhere, and for sources that "
            "are too strong; the last iterate is the attribute `field` of this error."
        )


def refuse_unconverged(field: Any) -> None:
    if field.newton and not field.newton[-1].converged:
        raise NotConverged(field)


@dataclass(frozen=True)
class Newton:
    most_steps: int = 60
    solver: Solver = field(default_factory=Solver)

    @property
    def roughly(self) -> Self:
        """The same method for solutions that serve differences only."""
        return replace(self, solver=replace(self.solver, rtol=ROUGH))

    def full_step(self, energy: Energy, u: Floats, gradient: Floats) -> Floats:
        step, conditions = np.zeros_like(u), energy.conditions
        if conditions.free.size:
            hessian = energy.hessian(u)
            on_rows = conditions if hessian.rows is None else conditions.on(hessian.rows)
            matrix, right = on_rows.reduced(hessian.matrix, hessian.eliminated(-gradient))
            if hessian.in_order and on_rows.join is None:
                outer = self.solver.in_order(matrix, right)
            else:
                outer = self.solver.solve(matrix, right, hessian.subspaces)
            if on_rows.join is not None:
                outer = on_rows.join @ outer
            step[conditions.free] = hessian.completed(outer, -gradient)
        if not np.all(np.isfinite(step)):
            raise np.linalg.LinAlgError(
                "the potential is infinite or not a number; check for extreme permeabilities, sources, potentials "
                "or elements that are almost flat."
            )
        return step

    def linear(self, energy: Energy) -> Floats:
        values, quadratic = energy.conditions.values, energy.at_zero_field()
        return values + self.full_step(quadratic, values, quadratic.gradient(values))

    def descend_coenergy(self, energy: Energy, start: Floats | None = None) -> tuple[Floats, Steps]:
        # Newton's method for the potential and B together (as Chan, Golub and Mulet, SIAM J. Sci. Comput. 20, 1999, for
        # another functional), by default from the solution of the material at zero field. In saturation H(B) is convex
        # where B(H) is concave, so that the next step corrects a B that is too large. The functional may rise for some
        # steps, after which `descend` continues from the lowest. Near the minimum, steps for the potential alone, with
        # the B of the potential, converge faster. Each is tried, and refused if the residual falls too little.
        u = self.linear(energy) if start is None else start
        density = (energy.at_zero_field() if start is None else energy).flux(u)
        steps, best, least, since, pause, wait = list[NewtonStep](), u, energy.value(u)[0], 0, 1, 1
        while since <= PATIENCE and 2 * len(steps) < self.most_steps and not (steps and steps[-1].converged):
            alone = wait == 0 and steps[-1].residual < NEAR
            tangent = Tangent.of(energy, energy.flux(u) if alone else density)
            try:
                change = self.full_step(tangent, u, tangent.gradient(u))
            except np.linalg.LinAlgError:
                break
            after = u + change
            functional, rounding = energy.value(after)
            step, _ = _recorded(energy, after, change, 1.0, functional, steps)
            if alone and step.residual > SLOW * steps[-1].residual:
                pause *= 2
                wait = pause
                continue
            u, density, wait = after, tangent.flux(after), max(0, wait - 1)
            steps.append(step)
            since = 0 if functional <= least + 10.0 * rounding else since + 1
            best, least = (best, least) if since else (u, functional)
        if not energy.conditions.free.size or (steps and steps[-1].converged):
            return u, tuple(steps)
        u, rest = replace(self, most_steps=self.most_steps - len(steps)).descend(energy, best)
        return u, (*steps, *rest)

    def descend(self, energy: Energy, start: Floats) -> tuple[Floats, Steps]:
        """Return the last values and all steps of a descent from admissible values.

        Steps are halved until the functional decreases by a fraction of the slope (Armijo), up to rounding. A whole
        step may overshoot into saturation so far that later steps do not return. LinAlgError is raised if the first
        step is not finite; a later step that is not finite ends the descent.
        """
        u, steps = start.copy(), list[NewtonStep]()
        free = energy.conditions.free
        gradient, _ = energy.residual(u)
        if not free.size:
            return u, ()
        level = energy.value(u)
        while len(steps) < self.most_steps and not (steps and steps[-1].converged):
            try:
                step = self.full_step(energy, u, gradient)
            except np.linalg.LinAlgError:
                if not steps:
                    raise
                break  # a law without a finite slope there; the last values are kept
            before, damping = level, 1.0
            slope = float(gradient @ step[free])
            while True:
                level = energy.value(u + damping * step)
                highest = before[0] + DESCENT * damping * slope + 10.0 * (before[1] + level[1])
                if level[0] <= highest or damping < LEAST_DAMPING:
                    break
                damping *= 0.5
            u = u + damping * step
            taken, gradient = _recorded(energy, u, damping * step, damping, level[0], steps)
            steps.append(taken)
            if damping < LEAST_DAMPING:
                break
        return u, tuple(steps)


def _recorded(
    energy: Energy, u: Floats, change: Floats, damping: float, functional: float, before: Sequence[NewtonStep]
) -> tuple[NewtonStep, Floats]:
    # the step to u, and the gradient there
    gradient, size = energy.residual(u)
    relative = _norm(energy.conditions.to_classes(gradient)) / max(size, TINY)
    update = remaining = _norm(change) / max(_norm(u), TINY)
    if before and min(damping, before[-1].damping) == 1.0 and update < 0.5 * before[-1].update:
        remaining = update**2 / (before[-1].update - update)
    step = NewtonStep(relative, update, damping, functional, remaining)
    logger.debug(
        "Newton step: relative residual %.2e, relative update %.2e, damping %g, functional %.9g",
        *(relative, update, damping, functional),
    )
    return step, gradient


def _norm(values: Floats) -> float:
    return float(np.linalg.norm(values))
