"""Error estimates of order 4 and above, from solutions of neighbouring orders."""

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries
from kohonen_adapt.magnetostatics.equations.high_orders import HighOrder, high_order_elements
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.solution import (
    HighOrderField,
    dual_of,
    energy_on,
    interpolated_on,
    richer_solution,
    unknown_of,
)

__all__ = ["goal_indicators_by_orders", "indicators_by_orders"]

MOST_RATIO = 0.9  # limit of the squared ratio of two changes, where the error no longer falls with the order


def indicators_by_orders(field: HighOrderField, boundaries: Boundaries, newton: Newton) -> Floats:
    """Return unsquared indicators of the energy norm, shape (nelements,).

    The change from order p to p + 1 misses what higher orders would add. If the squared changes form a geometric series
    with the ratio r of the last two, the squared error of order p is the last squared change over 1 - r (Aitken).
    """
    elements, higher = field.elements, richer_solution(field, boundaries, newton)
    lower = high_order_elements(field.mesh, field.order - 1, field.symmetry, field.coefficients.nonlinear)
    unknown, _ = unknown_of(energy_on(lower, field, boundaries), field, newton)
    before = squared_change(field, lower, unknown)
    change = squared_change(higher, elements, field.unknown)
    ratio = change.sum() / before.sum() if before.sum() > 0.0 else 0.0
    return np.asarray(np.sqrt(change / (1.0 - min(ratio, MOST_RATIO))))


def squared_change(field: Field, lower: HighOrder, unknown: Floats) -> Floats:
    """Return ``int dH . dB`` from a solution of lower order to `field`, (nelements,)."""
    change = field.unknown - interpolated_on(field.elements, lower, unknown)
    return energy_product(field, change, change)


def energy_product(field: Field, first: Floats, second: Floats) -> Floats:
    elements, symmetry, at = field.elements, field.symmetry, field.at_quadrature
    changes = (symmetry.flux_density(elements.points, elements.gradient(unknown)) for unknown in (first, second))
    strength, density = at.change_of_strength(next(changes)), next(changes)
    terms = symmetry.volume(elements.points, elements.weights) * np.sum(strength * density, axis=0)
    return np.bincount(elements.element, terms, elements.corners.t.shape[1]).astype(np.float64)


def goal_indicators_by_orders(field: HighOrderField, goal: Goal, boundaries: Boundaries, newton: Newton) -> Floats:
    """Return unsquared indicators of a goal, in the root of its unit.

    Their squares are the magnitudes of the energy products of what one order more adds to the field and to the dual.
    """
    higher = richer_solution(field, boundaries, newton)
    duals = (dual_of(each, goal.derivative(each), boundaries, newton).values for each in (field, higher))
    pairs = (field.unknown, higher.unknown), tuple(duals)
    added = (now - interpolated_on(higher.elements, field.elements, before) for before, now in pairs)
    return np.asarray(np.sqrt(np.abs(energy_product(higher, *added))))
