"""Energy functional of a plane field, and damped Newton's method."""

import logging
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np
from scipy.sparse import csc_array

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.higher import Elements
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.equations.system import Solver
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients

__all__ = [
    "TOLERANCE",
    "Convex",
    "EnergyFunctional",
    "Newton",
    "NewtonStep",
    "NotConverged",
    "Scalar",
    "scalar_problem",
]

TOLERANCE = 1e-8  # of the relative residual and of the relative update
DESCENT = 1e-4  # fraction of the descent predicted by the slope that a step must reach (Armijo)
LEAST_DAMPING = 2.0**-40  # least damping

logger = logging.getLogger("kohonen_adapt")


@dataclass(frozen=True)
class Scalar:
    """Scalar problem ``-div(reluctivity grad u - flux) = source`` in the plane."""

    reluctivity: Floats  # (nelements,)
    flux: Floats  # (2, nelements)
    source: Floats  # (nelements,)


def scalar_problem(elements: Elements, symmetry: Symmetry, coefficients: Coefficients) -> Scalar:
    """Return the scalar problem at the quadrature points, for the material at B = 0."""
    return Scalar(
        symmetry.reluctivity(elements.points, coefficients.reluctivity),
        -symmetry.flux(-coefficients.coercivity),
        symmetry.source(coefficients.current_density),
    )


class Convex(Protocol):
    """Convex functional of the unknowns, to minimise by Newton's method.

    `value` returns the functional and its rounding error. `residual` returns the gradient at the free unknowns and the
    norm of the summed magnitudes of its terms; `linear_residual` returns the gradient for linear material.
    `at_zero_field` returns the quadratic functional of the material at zero field.
    """

    @property
    def conditions(self) -> Conditions: ...
    def at_zero_field(self) -> Self: ...
    def value(self, u: Floats) -> tuple[float, float]: ...
    def residual(self, u: Floats) -> tuple[Floats, float]: ...
    def linear_residual(self, u: Floats) -> Floats: ...
    def hessian(self, u: Floats) -> csc_array: ...


@dataclass(frozen=True)
class EnergyFunctional:
    """Energy functional ``int (int H . dB) - J A`` under boundary conditions.

    It is convex because H rises with B, so that its minimum is the solution.
    """

    elements: Elements
    symmetry: Symmetry
    coefficients: Coefficients
    conditions: Conditions

    @cached_property
    def _at_points(self) -> Coefficients:
        return self.coefficients.at_quadrature(self.elements.element, self.elements.points)

    def at_zero_field(self) -> Self:
        return replace(self, coefficients=replace(self.coefficients, nonlinear_materials=()))

    @property
    def _source(self) -> Floats:
        return self.symmetry.source(self.coefficients.current_density)

    def flux_density(self, u: Floats) -> Floats:
        return self.symmetry.flux_density(self.elements.points, self.elements.gradient(u))

    def value(self, u: Floats) -> tuple[float, float]:
        volume = self.symmetry.volume(self.elements.points, self.elements.weights)
        stored = volume * self._at_points.energy_density(self.flux_density(u))
        spent = self.elements.against_function(self._source, u)
        exterior, exterior_size = (
            (0.0, 0.0) if self.conditions.open_boundary is None else self.conditions.open_boundary.energy(u)
        )
        rounding = np.finfo(float).eps * (float(np.sum(stored)) + float(np.sum(np.abs(spent))) + exterior_size)
        return float(np.sum(stored) - np.sum(spent)) + exterior, rounding

    def residual(self, u: Floats) -> tuple[Floats, float]:
        density, load = self.flux_density(u), self.elements.against_functions(self._source)
        flux = self.symmetry.flux(self._at_points.field_strength(density))
        largest = self._at_points.largest_terms(density)
        sizes = np.hypot(*self.symmetry.flux(np.stack((largest, np.zeros_like(largest)))))
        total = self.elements.assemble_vector(self.elements.against_gradients(flux) - load)
        size = self.elements.assemble_vector(self.elements.against_slopes(sizes) + np.abs(load))
        return self._at_free(total, u), float(np.linalg.norm(size))

    def linear_residual(self, u: Floats) -> Floats:
        scalar = scalar_problem(self.elements, self.symmetry, self._at_points)
        with np.errstate(over="ignore", invalid="ignore"):
            flux = scalar.flux - scalar.reluctivity * self.elements.gradient(u)
            return self._at_free(-self.elements.loads(self._source, flux), u)

    def hessian(self, u: Floats) -> csc_array:
        """Return the second derivatives, differential nu along grad u and nu across."""
        points, free = self.elements.points, self.conditions.free
        if not self.coefficients.nonlinear_materials:
            return self.elements.stiffness(self.symmetry.reluctivity(points, self._at_points.reluctivity), free)
        slope = self.elements.gradient(u)
        pair = self._at_points.reluctivities(self.symmetry.flux_density(points, slope))
        across, along = (self.symmetry.reluctivity(points, each) for each in pair)
        size = np.hypot(*slope)
        return self.elements.stiffness(across, free, (along, slope / np.where(size > 0.0, size, 1.0)))

    def _at_free(self, total: Floats, u: Floats) -> Floats:
        if self.conditions.open_boundary is not None:
            total = total + self.conditions.open_boundary.gradient(u)
        return total[self.conditions.free]


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
    """

    residual: float
    update: float
    damping: float
    functional: float

    @property
    def converged(self) -> bool:
        """True if residual and update are at most `TOLERANCE`."""
        return self.residual <= TOLERANCE and self.update <= TOLERANCE


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


@dataclass(frozen=True)
class Newton:
    """Damped Newton's method with a limit of steps and a linear solver."""

    most_steps: int = 60
    solver: Solver = field(default_factory=Solver)

    def full_step(self, energy: Convex, u: Floats, gradient: Floats) -> Floats:
        step, conditions = np.zeros_like(u), energy.conditions
        if conditions.free.size:
            matrix, right = conditions.reduced(energy.hessian(u), -gradient)
            step[conditions.free] = conditions.from_classes(self.solver.solve(matrix, right))
        if not np.all(np.isfinite(step)):
            raise np.linalg.LinAlgError(
                "the potential is infinite or not a number; check for extreme permeabilities, sources, potentials "
                "or elements that are almost flat."
            )
        return step

    def linear(self, energy: Convex) -> Floats:
        values, quadratic = energy.conditions.values, energy.at_zero_field()
        return values + self.full_step(quadratic, values, quadratic.linear_residual(values))

    def descend(self, energy: Convex, start: Floats) -> tuple[Floats, tuple[NewtonStep, ...]]:
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
        while len(steps) < self.most_steps and not (steps and steps[-1].converged):
            try:
                step = self.full_step(energy, u, gradient)
            except np.linalg.LinAlgError:
                if not steps:
                    raise
                break  # a law without a finite slope there; the last values are kept
            damping, functional = _damping(energy, u, step, float(gradient @ step[free]))
            u = u + damping * step
            gradient, size = energy.residual(u)
            residual = _norm(energy.conditions.to_classes(gradient)) / max(size, np.finfo(float).tiny)
            update = damping * _norm(step) / max(_norm(u), np.finfo(float).tiny)
            steps.append(NewtonStep(residual, update, damping, functional))
            logger.debug(
                "Newton step %d: relative residual %.2e, relative update %.2e, damping %g, functional %.9g",
                *(len(steps), residual, update, damping, functional),
            )
            if damping < LEAST_DAMPING:
                break
        return u, tuple(steps)


def _damping(energy: Convex, u: Floats, step: Floats, slope: float) -> tuple[float, float]:
    before, rounding = energy.value(u)
    damping = 1.0
    while True:
        after, after_rounding = energy.value(u + damping * step)
        if after <= before + DESCENT * damping * slope + 10.0 * (rounding + after_rounding) or damping < LEAST_DAMPING:
            return damping, after
        damping *= 0.5


def _norm(values: Floats) -> float:
    return float(np.linalg.norm(values))
