"""How a problem is solved on a mesh: in one step where it is linear, else by Newton's method from where it begins."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial import KDTree
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, Conditions, conditions_of, places
from kohonen_adapt.magnetostatics.equations.newton import TOLERANCE, NewtonStep, Nonlinear, iterate, whole_step
from kohonen_adapt.magnetostatics.equations.quadratic import Quadratic
from kohonen_adapt.magnetostatics.equations.symmetry import PLANAR, Symmetry
from kohonen_adapt.magnetostatics.equations.system import loads, scalar_of, solve_scalar
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.quadratic_field import QuadraticField

__all__ = ["NotConverged", "carried", "quadratic_solution_of", "solution_of", "tangent_solution"]


class NotConverged(np.linalg.LinAlgError):
    """Newton's method has not converged (a kind of ValueError).

    Attributes
    ----------
    field
        The last iterate as a `Field`.
    steps
        All steps, a tuple of `NewtonStep`.
    """

    def __init__(self, field: Field) -> None:
        self.field, self.steps = field, field.newton
        last = ", ".join(f"{step.residual:.1e}" for step in self.steps[-3:])
        super().__init__(
            f"Newton's method has not converged in {len(self.steps)} steps: the last relative residuals are {last}, "
            f"wanted {TOLERANCE:g}. Look for a law H(B) that does not rise everywhere, and for sources that no "
            "material can bear; the last iterate is the attribute `field` of this error."
        )


def solution_of(
    mesh: MeshTri,
    given: Coefficients,
    boundaries: Boundaries,
    symmetry: Symmetry,
    depth: float | None,
    start: Floats | None,
) -> Field:
    """Solve by P1 elements, nonlinear problems from a nodal potential (nnodes,) where there is one."""
    conditions = conditions_of(mesh, boundaries, symmetry)

    def linear() -> Floats:
        return solve_scalar(mesh, scalar_of(mesh, symmetry, given), conditions)

    steps: tuple[NewtonStep, ...] = ()
    if not given.pieces:
        unknown = linear()
    else:
        begin = conditions.admitted(symmetry.unknown(mesh, start)) if start is not None else _begin(conditions, linear)
        unknown, steps = iterate(Nonlinear(mesh, given, symmetry, conditions), begin)
    return checked(Field(mesh, symmetry.potential(mesh, unknown), given, symmetry, depth, steps))


def quadratic_solution_of(
    mesh: MeshTri, given: Coefficients, boundaries: Boundaries, depth: float | None, start: Floats | None
) -> QuadraticField:
    """Solve by P2 elements, nonlinear problems from values at all unknowns where there are some."""
    conditions = conditions_of(mesh, boundaries, PLANAR, 2)
    problem = Quadratic(mesh, given, conditions)

    def linear() -> Floats:
        plain = Quadratic(mesh, replace(given, pieces=()), conditions)
        return conditions.values + whole_step(plain, conditions.values, plain.residual(conditions.values)[0])

    steps: tuple[NewtonStep, ...] = ()
    if not given.pieces:
        values = linear() if conditions.free.size else conditions.values
    else:
        begin = _begin(conditions, linear) if start is None else conditions.admitted(start)
        values, steps = iterate(problem, begin)
    nodal = values[: mesh.p.shape[1]]
    return checked(QuadraticField(mesh, nodal, given, PLANAR, depth, steps, problem=problem, values=values))


def tangent_solution(field: Field, boundaries: Boundaries, source: Floats, flux: Floats) -> Floats:
    """The change of ``field.unknown``, (nnodes,), that a small source (nelements,) and flux (2, nelements) make.

    It solves the problem linearised at the field, of the differential reluctivity along B and the secant one across it,
    with zeros for the values given.
    """
    conditions = conditions_of(field.mesh, boundaries, field.symmetry)
    if not conditions.free.size:
        return np.zeros_like(field.potential)
    problem = Nonlinear(field.mesh, field.coefficients, field.symmetry, conditions)
    return whole_step(problem, field.unknown, -loads(field.mesh, source, flux)[conditions.free])


def _begin(conditions: Conditions, linear: Callable[[], Floats]) -> Floats:
    """Where Newton's method begins without an old solution.

    From A = 0 its first step is the whole of the linear solution, and halved where that saturates everything. Where
    values are given, A = 0 beside them would be a steep wall, and the linear solution is a better start.
    """
    return linear() if np.any(conditions.values) else conditions.values


Solved = TypeVar("Solved", bound=Field)


def checked(field: Solved) -> Solved:
    """The field, unless Newton's method has not converged to it."""
    if field.newton and not field.newton[-1].converged:
        raise NotConverged(field)
    return field


def carried(mesh: MeshTri, old: Field, order: int = 1) -> Floats:
    """The potential of an old solution at the nodes of another mesh, for elements of order 2 at the middles of its
    facets, too; outside the old mesh that of its nearest node.
    """
    x = places(mesh, order)
    values = old.potential_at(x)
    outside = np.isnan(values)
    if outside.any():
        nearest = KDTree(old.mesh.p.T).query(x[:, outside].T)[1]
        values[outside] = old.potential[nearest]
    return values
