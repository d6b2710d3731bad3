"""How a problem is solved on a mesh: in one step where it is linear, else by Newton's method from where it begins."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from skfem import MeshTri

from kohonen_adapt.magnetostatics.coefficients import Coefficients
from kohonen_adapt.magnetostatics.conditions import Boundaries, conditions_of
from kohonen_adapt.magnetostatics.field import Field
from kohonen_adapt.magnetostatics.newton import TOLERANCE, NewtonStep, Nonlinear, iterate
from kohonen_adapt.magnetostatics.symmetry import Symmetry
from kohonen_adapt.magnetostatics.system import scalar_of, solve_scalar

__all__ = ["NotConverged", "carried", "solution_of"]

Floats = NDArray[np.float64]


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
    """Solve, nonlinear problems from a nodal potential (nnodes,) where there is one."""
    scalar = scalar_of(mesh, symmetry, given)
    conditions = conditions_of(mesh, boundaries, symmetry)
    steps: tuple[NewtonStep, ...] = ()
    if not given.pieces:
        unknown = solve_scalar(mesh, scalar, conditions)
    else:
        # From A = 0 the first step is the whole of the linear solution, and halved where that saturates everything.
        # Where values are given, A = 0 beside them would be a steep wall, and the linear solution is a better start.
        if start is not None:
            unknown = conditions.admitted(symmetry.unknown(mesh, start))
        elif np.any(conditions.values):
            unknown = solve_scalar(mesh, scalar, conditions)
        else:
            unknown = conditions.values
        unknown, steps = iterate(Nonlinear(mesh, given, symmetry, conditions), unknown)
    field = Field(mesh, symmetry.potential(mesh, unknown), given, symmetry, depth, steps)
    if steps and not steps[-1].converged:
        raise NotConverged(field)
    return field


def carried(mesh: MeshTri, old: Field) -> Floats:
    """The nodal potential of another mesh, (nnodes,); outside the old one that of its nearest node."""
    values = old.potential_at(mesh.p)
    outside = np.isnan(values)
    if outside.any():
        nearest = KDTree(old.mesh.p.T).query(mesh.p[:, outside].T)[1]
        values[outside] = old.potential[nearest]
    return values
