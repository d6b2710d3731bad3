"""The error of a goal: the dual problem of a field, and where the two errors meet."""

from typing import NamedTuple

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.estimators import goal_error, goal_oriented
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, conditions_of
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.solution import tangent_solution
from kohonen_adapt.mesh.measures import gradient

__all__ = ["error_of_goal", "goal_indicators"]


class Pair(NamedTuple):
    """A field and its dual as two problems ``-div(nu grad u - flux) = source`` of one scalar nu."""

    potential: Floats
    dual: Floats
    reluctivity: Floats
    source: Floats
    flux: Floats
    dual_source: Floats
    dual_flux: Floats
    fixed: Mask


def goal_indicators(mesh: MeshTri, field: Field, goal: Goal, boundaries: Boundaries) -> Floats:
    """Indicators of a goal, (nelements,), unsquared, in the root of its unit."""
    u, z, nu, source, flux, dual_source, dual_flux, fixed = _pair(mesh, field, goal, boundaries)
    data = {"source": source, "flux": flux, "dual_source": dual_source, "dual_flux": dual_flux}
    return goal_oriented(mesh, u, z, nu, **data, fixed=fixed)


def error_of_goal(mesh: MeshTri, field: Field, goal: Goal, boundaries: Boundaries) -> float:
    """Estimate of what the goal's value is short of, with its sign."""
    u, z, nu, source, flux, dual_source, dual_flux, fixed = _pair(mesh, field, goal, boundaries)
    data = {"source": source, "flux": flux, "dual_source": dual_source, "dual_flux": dual_flux}
    return goal_error(mesh, u, z, nu, **data, fixed=fixed)


def _pair(mesh: MeshTri, field: Field, goal: Goal, boundaries: Boundaries) -> Pair:
    """Of nonlinear material one scalar stands for the tensor of the linearised problem: the root of its determinant.

    The fluxes make ``nu grad u - flux`` the field strength, and of the dual its change, whatever nu is.
    """
    source, load = goal.derivative(field)
    dual = tangent_solution(field, boundaries, source, load)
    symmetry, u = field.symmetry, field.unknown
    nu = symmetry.reluctivity(mesh, np.sqrt(field.reluctivity * field.differential_reluctivity))
    flux = nu * gradient(mesh, u) - symmetry.flux(field.field_strength)
    slope = gradient(mesh, dual)
    change = symmetry.flux(field.change_of_strength(symmetry.flux_density(mesh, slope)))
    given = _given(mesh, boundaries, symmetry)
    return Pair(u, dual, nu, symmetry.source(field.current_density), flux, source, nu * slope - change + load, given)


def _given(mesh: MeshTri, boundaries: Boundaries, symmetry: Symmetry) -> Mask:
    """Nodes whose value is given, and those of pairs and of the open boundary: there what the field lacks of
    equilibrium is no part of the estimate.
    """
    conditions = conditions_of(mesh, boundaries, symmetry)
    fixed = conditions.fixed.copy()
    if conditions.joints is not None:
        fixed[conditions.joints.one] = fixed[conditions.joints.other] = True
    if conditions.robin is not None:
        fixed |= conditions.robin.diagonal() > 0.0
    return fixed
