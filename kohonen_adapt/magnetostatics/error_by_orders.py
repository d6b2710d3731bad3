"""Error indicators from solutions of neighbouring orders."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.special import zeta
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.problem.energy import Energy

__all__ = [
    "FROM_BELOW",
    "change_by_further_orders",
    "goal_indicators_by_orders",
    "indicators_beside_edges",
    "indicators_by_orders",
    "step_to",
]

# Estimate over error of orders 4 to 7 with layers on the C-core and on a magnet over iron: from the orders around p
# 0.85 to 1.04, from lower orders 0.98 to 1.17 for orders 6 to 8. A geometric series (Aitken) gives 0.77 to 0.95 there.
# Least order with an estimate from lower orders, in half the time: in the plane 0.7 to 1.1 times the error of order 4,
# and 1.3 times the error of order 6 on a disk. In space, with a power of elements at singular edges, 0.8 to 1.3 times
# the error of orders 4 to 6 on 0 to 3 layers (`python -m benchmarks hp --three-d`), and in a third of the time.
FROM_BELOW = {2: 6, 3: 4}  # by dimension
MOST_FURTHER = 2.0  # largest change by all further orders, relative to the change by one order
LEAST_POWER = 2.0  # of the fall of the squared changes with the order, 4 l + 1 at a corner with exponent l

Energies = Callable[[int], Energy]  # the functional of a solved problem by order, on the mesh of the solution


def step_to(energy: Energy, here: Any, u: Floats, method: Newton) -> FloatsPair:
    """Return the values in elements of another order, and the Newton step there.

    The step is exact for linear material, and correct to second order in its size for others.
    """
    start = energy.conditions.admissible(energy.space.interpolated(here, u))
    return start, method.full_step(energy, start, energy.gradient(start))


def indicators_by_orders(
    u: Floats,
    order: int,
    energies: Energies,
    method: Newton,
    from_below: bool,
    singular: Mask | None = None,
    higher: Floats | None = None,
) -> Floats:
    """Return unsquared indicators of the energy norm, shape (nelements,).

    The change from order p to p + 1 misses what higher orders would add. The squared change between orders n and n + 1
    is taken as a power of n + 1/2, and the squared error is the sum from n = p on. The power is that of the changes to
    p and to p + 1, or with `from_below` of the changes to p - 1 and to p. Elements that are `singular`, at edges or
    corners, have a power of their own, because their changes fall more slowly than those of others. `higher` are the
    values at order p + 1 if known.
    """
    here, method = energies(order), method.roughly
    if from_below:
        return _from_below(here, u, order, energies, method, singular)
    below, above = energies(order - 1), energies(order + 1)
    start, step = step_to(below, here.space, u, method)
    before = _squared_change(here, u, below, start + step)
    start, step = step_to(above, here.space, u, method) if higher is None else (higher, np.zeros_like(higher))
    change = above.vector(start + step) - above.vector_of(here, u)
    now = above.products(start, change, change)
    return np.sqrt(now * sums_over_changes(before, now, order, singular))


def indicators_beside_edges(
    u: Floats,
    order: int,
    mesh: MeshTet,
    energies: Energies,
    method: Newton,
    parts: Sequence[Ints],
    higher: Callable[[], Floats] | None = None,
) -> Floats:
    """Return `indicators_by_orders` in space, from lower orders if that is accurate.

    `parts` are the nodes of singular edges and corners.
    """
    nodes = np.concatenate([part.ravel() for part in parts])
    singular = np.asarray(np.isin(mesh.t, nodes).any(axis=0), bool)
    # Changes of smooth fields fall faster than by a power, which lower orders do not show.
    from_below = order >= FROM_BELOW[3] and bool(singular.any())
    values = higher() if higher and not from_below else None
    return indicators_by_orders(u, order, energies, method, from_below, singular, values)


def _from_below(
    here: Energy, u: Floats, order: int, energies: Energies, method: Newton, singular: Mask | None
) -> Floats:
    squares = list[Floats]()
    for lower in (order - 1, order - 2):
        below = energies(lower)
        solution = np.add(*step_to(below, here.space, u, method))
        squares.append(_squared_change(here, u, below, solution))
        here, u = below, solution
    now, before = squares
    return np.sqrt(now * (sums_over_changes(before, now, order - 1, singular) - 1.0))


def _squared_change(here: Energy, u: Floats, below: Energy, solution: Floats) -> Floats:
    change = here.vector(u) - here.vector_of(below, solution)
    return here.products(u, change, change)


def sums_over_changes(before: Floats, now: Floats, order: int, singular: Mask | None) -> Floats:
    # Sum of all squared changes from `order` on, over the first, `now`, of the group of every element.
    found, place = np.ones_like(now), order + 0.5
    for group in [np.ones(now.size, bool)] if singular is None else [singular, ~singular]:
        first, second = before[group].sum(), now[group].sum()
        if second > 0.0:
            fall = np.log(first / second) / np.log(place / (place - 1.0)) if first > 0.0 else 0.0
            power = max(fall, LEAST_POWER)
            found[group] = zeta(power, place) * place**power
    return found


def goal_indicators_by_orders(field: Any, higher: Any, dual: Callable[[Any], Floats], energies: Energies) -> Floats:
    """Return unsquared indicators of a goal, in the root of its unit.

    Their squares are the magnitudes of the energy products of what one order more, the field `higher`, adds to the
    field and to the dual.
    """
    here, above, change = _change_to(field, higher, energies)
    added = dual(higher) - above.space.interpolated(here.space, dual(field))
    products = above.products(higher.unknown, change, above.sign * above.space.gradient(added))
    return np.sqrt(np.abs(products))


def change_by_further_orders(field: Any, higher: Any, energies: Energies, indicators: Floats) -> float:
    """Return the change of the energy by further orders, over the change to `higher`.

    `indicators` include all changes from the order of `field` on.
    """
    _, above, change = _change_to(field, higher, energies)
    added = float(above.products(higher.unknown, change, change).sum())
    return min(max(float(np.sum(indicators**2)) / added - 1.0, 0.0), MOST_FURTHER) if added > 0.0 else 0.0


def _change_to(field: Any, higher: Any, energies: Energies) -> tuple[Energy, Energy, Floats]:
    # the functionals of both orders, and the change of the vector
    here, above = energies(field.order), energies(higher.order)
    return here, above, above.vector(higher.unknown) - above.vector_of(here, field.unknown)
