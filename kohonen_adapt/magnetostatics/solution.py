"""Solutions of plane problems, with their functionals and linearisations."""

import numpy as np
from scipy.spatial import KDTree

from kohonen_adapt.arrays import Floats, FloatsPair
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.equations.energy import PlaneEnergy
from kohonen_adapt.magnetostatics.equations.newton import Steps, refuse_unconverged
from kohonen_adapt.magnetostatics.quantities.field import Dual, Field
from kohonen_adapt.mesh.elements.space import Space

__all__ = [
    "Dual",
    "at_points",
    "dual_of",
    "energy_of",
    "field_of",
    "richer_solution",
    "solution_of",
    "unknown_of",
]


def unknown_of(
    problem: Arguments, energy: PlaneEnergy, old: Field | None = None, linearised: bool = False
) -> tuple[Floats, Steps]:
    # The minimiser, or the Newton step from `old`. The field `old` may be on another mesh.
    newton, conditions = problem.method, energy.conditions
    if energy.is_quadratic:
        return newton.linear(energy), ()
    # From A = 0 the first step is the whole linear solution, halved if that saturates everything. Beside prescribed
    # values A = 0 is a steep wall, and the linear solution is a better start.
    if old is not None:
        start = conditions.admissible(_carried(old, energy.space))
    else:
        start = newton.linear(energy) if np.any(conditions.values) else conditions.values
    if linearised:
        return start + newton.full_step(energy, start, energy.gradient(start)), ()
    return newton.descend(energy, start)


def _carried(old: Field, elements: Space) -> Floats:
    if old.elements.arcs and old.mesh is elements.mesh:
        return elements.interpolated(old.elements, old.unknown)
    x, values = elements.doflocs, old.potential_at(elements.doflocs)
    outside = np.isnan(values)
    if outside.any():
        values[outside] = old.potential[KDTree(old.elements.corners.p.T).query(x[:, outside].T)[1]]
    return old.symmetry.unknown(x, values)


def solution_of(problem: Arguments, energy: PlaneEnergy, old: Field | None = None, linearised: bool = False) -> Field:
    field = field_of(energy, problem.depth, *unknown_of(problem, energy, old, linearised))
    refuse_unconverged(field)
    return field


def field_of(energy: PlaneEnergy, depth: float | None, unknown: Floats, steps: Steps = ()) -> Field:
    elements = energy.space
    values = energy.symmetry.potential(elements.doflocs, unknown)
    arguments = elements.mesh, values[: elements.corners.nvertices], energy.coefficients, energy.symmetry, depth, steps
    more = None if elements.order == 1 else values
    field = Field(*arguments, values=more, degree=elements.order, sides=elements.sides)
    vars(field)["elements"] = elements  # of the cached property, which makes them again for a copy
    return field


def at_points(field: Field, derivative: FloatsPair) -> FloatsPair:
    (source, load), at = derivative, field.at_quadrature
    return source, load if load.shape == at.x.shape else load[:, at.element]


def dual_of(problem: Arguments, field: Field, derivative: FloatsPair) -> Dual:
    source, load = at_points(field, derivative)
    energy, terms = energy_of(problem, field), field.elements.loads(source, load)
    values = problem.method.full_step(energy, field.unknown, -terms[energy.conditions.free])
    return Dual(values, source, load)


def richer_solution(problem: Arguments, field: Field, linearised: bool = False) -> Field:
    # one order more, or the Newton step to its solution
    return solution_of(problem, energy_of(problem, field, field.order + 1), field, linearised)


def energy_of(problem: Arguments, field: Field, order: int | None = None) -> PlaneEnergy:
    """Return the functional of a solved problem, also for another order."""
    if order is None:
        elements = field.elements
    elif field.elements.arcs:
        elements = field.elements.at_order(order)
    else:
        elements = Space(field.mesh, order, field.coefficients.nonlinear, field.axisymmetric)
    conditions = problem.conditions_of(field, elements)
    return PlaneEnergy.of(elements, field.symmetry, field.coefficients, conditions)
