"""Linearise a problem at its solution: the error of a goal by its dual problem, and incremental inductance."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.estimators import goal_error, goal_oriented
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, Conditions, conditions_of
from kohonen_adapt.magnetostatics.equations.energy import EnergyFunctional
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.quantities.linkage import checked_circuit, turn_length, turns_density

__all__ = ["error_of_goal", "goal_indicators", "linkage_slope", "tangent_solution"]


def tangent_solution(field: Field, boundaries: Boundaries, load: Floats, newton: Newton) -> Floats:
    """The change of ``field.unknown``, (nunknowns,), that a small load of every unknown makes, as of `Elements.loads`.

    It solves the problem linearised at the field, of the differential reluctivity along B and the secant one across it,
    with zeros for the values given.
    """
    energy = EnergyFunctional.of(field.elements, field.symmetry, field.coefficients, boundaries)
    return newton.whole_step(energy, field.unknown, -load[energy.conditions.free])


def linkage_slope(field: Field, boundaries: Boundaries, circuit: Mapping[str, float], newton: Newton) -> float:
    """d linkage / d current of a circuit, everything else as it is; see `Magnetostatics.incremental_inductance`."""
    density, none = turns_density(field, checked_circuit(circuit)), np.zeros_like(field.elements.points)
    linked = field.elements.loads(density, none)
    load = field.elements.loads(field.symmetry.source(density), none)
    return turn_length(field) * float(linked @ tangent_solution(field, boundaries, load, newton))


class _Pair(NamedTuple):
    """A field and its dual as two problems ``-div(nu grad u - flux) = source`` of one scalar nu."""

    potential: Floats
    dual: Floats
    reluctivity: Floats
    source: Floats
    flux: Floats
    dual_source: Floats
    dual_flux: Floats
    fixed: Mask


def goal_indicators(field: Field, goal: Goal, boundaries: Boundaries, newton: Newton) -> Floats:
    """Indicators of a goal, (nelements,), unsquared, in the root of its unit."""
    return goal_oriented(field.mesh, **_pair(field, goal, boundaries, newton)._asdict())


def error_of_goal(field: Field, goal: Goal, boundaries: Boundaries, newton: Newton) -> float:
    """Estimate of what the goal's value is short of, with its sign."""
    return goal_error(field.mesh, **_pair(field, goal, boundaries, newton)._asdict())


def _pair(field: Field, goal: Goal, boundaries: Boundaries, newton: Newton) -> _Pair:
    """Of nonlinear material one scalar stands for the tensor of the linearised problem: the root of its determinant.

    The fluxes make ``nu grad u - flux`` the field strength, and of the dual its change, whatever nu is.
    """
    source, load = goal.derivative(field)
    elements, symmetry, u = field.elements, field.symmetry, field.unknown
    dual = tangent_solution(field, boundaries, elements.loads(source, load), newton)
    weight = np.sqrt(field.reluctivity * field.differential_reluctivity)
    nu, slope = symmetry.reluctivity(elements.points, weight), elements.gradient(dual)
    flux = nu * elements.gradient(u) - symmetry.flux(field.field_strength)
    change = symmetry.flux(field.change_of_strength(symmetry.flux_density(elements.points, slope)))
    given = _given(conditions_of(elements, boundaries, symmetry))
    return _Pair(u, dual, nu, symmetry.source(field.current_density), flux, source, nu * slope - change + load, given)


def _given(conditions: Conditions) -> Mask:
    """Nodes whose value is given, and those of pairs and of the open boundary: there what the field lacks of
    equilibrium is no part of the estimate.
    """
    fixed = conditions.held
    return fixed if conditions.robin is None else fixed | (conditions.robin.diagonal() > 0.0)
