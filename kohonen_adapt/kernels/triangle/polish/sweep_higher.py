"""Descent of nodes at order 2 or 3, with the unknowns of the star eliminated."""

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import BLOCK, DIRECTION_X, DIRECTION_Y, FREE, HELD, OWN, POSITION, VALUE
from kohonen_adapt.kernels.triangle.chains import point_at
from kohonen_adapt.kernels.triangle.geometry import may_move
from kohonen_adapt.kernels.triangle.polish.descend import (
    OVERSTEP,
    ROUNDING,
    TRIES,
    newton_step,
    value_on_chain,
)
from kohonen_adapt.kernels.triangle.polish.descend_higher import (
    change_block,
    derivatives,
    factorise,
    number_block,
    solve_upper,
    stays_valid,
)


@kernel
def descend_nodes_higher(descents, order, floor):
    kinds, chains, fixed = (
        descents.primal.constraints.kind,
        descents.primal.constraints.chain,
        descents.primal.trial.fixed,
    )
    gain = 0.0
    for node in order:
        v = np.int64(node)
        kind, first = kinds[v], 1 if fixed[v] else 0  # first free unknown
        for i in range(descents.terms):
            descent = descents.primal if i == 0 else descents.dual
            number_block(descent, v)
            if kind == HELD:
                improve(descent, v, first)
        if kind != HELD:
            gain += move(descents, v, np.int64(chains[v, OWN]) if kind != FREE else -1, first, floor)
    return gain


@inner_kernel
def eliminated(descent, v, chain, first):
    """Return the derivatives by the position with the block eliminated.

    Along segment `chain`, if not -1, the derivatives by x are those by the parameter, and a Dirichlet value changes
    with the parameter.

    Returns
    -------
    solved, magnitude, now, by_x, by_y, xx, xy, yy
        True if the elimination succeeded, followed by the values of `add_element`.
    """
    block, geometry = descent.block, descent.constraints.chains.geometry
    mixed, rest = block.mixed, block.rest
    magnitude, now, by_x, by_y, xx, xy, yy = derivatives(
        descent, v, descent.position[v, 0], descent.position[v, 1], POSITION
    )
    if chain >= 0:
        tx, ty = geometry[chain, DIRECTION_X], geometry[chain, DIRECTION_Y]
        rate = descent.trial.on_chain[chain, 1] if first else 0.0
        by_x, by_y = tx * by_x + ty * by_y + rate * rest[0], 0.0
        xx, xy, yy = tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy, 0.0, 0.0
        for i in range(block.unknowns[0]):
            along = tx * mixed[i, 0] + ty * mixed[i, 1]
            xx += rate * (2.0 * along + rate * block.stiffness[0, 0]) if i == 0 else 0.0
            mixed[i, 0], mixed[i, 1] = along + rate * block.stiffness[i, 0], 0.0
    solved, square = factorise(block, first)
    if not descent.trial.nonlinear[v]:
        now -= 0.5 * square
    for i in range(first, block.unknowns[0]):
        along, aside = mixed[i, 0], mixed[i, 1]
        by_x, by_y = by_x - along * rest[i], by_y - aside * rest[i]
        xx, xy, yy = xx - along * along, xy - along * aside, yy - aside * aside
    return solved, magnitude, now, by_x, by_y, xx, xy, yy


@inner_kernel
def move(descents, v, chain, first, floor):
    primal, dual, position, constraints = (
        descents.primal,
        descents.dual,
        descents.primal.position,
        descents.primal.constraints,
    )
    magnitude, now, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(descents.terms):
        part = eliminated(primal if i == 0 else dual, v, chain, first)
        if not part[0]:
            return 0.0
        magnitude, now, by_x, by_y = magnitude + part[1], now + part[2], by_x + part[3], by_y + part[4]
        xx, xy, yy = xx + part[5], xy + part[6], yy + part[7]
    if chain >= 0:
        step_x, step_y = -OVERSTEP * by_x / abs(xx), 0.0
    else:
        step_x, step_y = newton_step(by_x, by_y, xx, xy, yy)
    for i in range(descents.terms):
        solve_upper((primal if i == 0 else dual).block, first, step_x, step_y)
    if primal.trial.nonlinear[v]:
        now = settle(primal, v, first, now)
    value, dual_value = primal.trial.value[v], dual.trial.value[v] if descents.terms == 2 else 0.0
    gain, length, downhill = 0.0, 1.0, -(step_x * by_x + step_y * by_y) > ROUNDING * magnitude
    for _ in range(HALVINGS + 1 if downhill else 0):
        x, y = position[v, 0] + length * step_x, position[v, 1] + length * step_y
        ahead = constraints.parameter[v] + length * step_x
        if chain >= 0:
            x, y = point_at(constraints.chains, chain, ahead)
        if may_move(position, primal.star, v, x, y, floor) and stays_valid(primal, v, x, y):
            if first:
                primal.trial.value[v] = value_on_chain(primal.trial, chain, ahead)
                if descents.terms == 2:
                    dual.trial.value[v] = value_on_chain(dual.trial, chain, ahead)
            gain = gain_at(descents, v, first, x, y, length, now)
            if gain > ROUNDING * magnitude:
                position[v, 0], position[v, 1] = x, y
                if chain >= 0:
                    constraints.parameter[v] = ahead
                break
            gain = 0.0
            if first:
                primal.trial.value[v] = value
                if descents.terms == 2:
                    dual.trial.value[v] = dual_value
        length *= 0.5
    for i in range(0 if primal.trial.nonlinear[v] else descents.terms):
        descent = primal if i == 0 else dual
        if gain > 0.0:
            solve_upper(descent.block, first, 0.0, 0.0)
        change_block(descent, v, first, 1.0, 0.0)
    return gain


@inner_kernel
def improve(descent, v, first):
    x, y, nonlinear = descent.position[v, 0], descent.position[v, 1], descent.trial.nonlinear[v]
    now = derivatives(descent, v, x, y, BLOCK)[1]
    if not factorise(descent.block, first)[0]:
        return
    solve_upper(descent.block, first, 0.0, 0.0)
    if nonlinear:
        settle(descent, v, first, now)
    else:
        change_block(descent, v, first, 1.0, 0.0)


@inner_kernel
def settle(descent, v, first, now):
    """Add the correction of the block, halved until the functional does not rise.

    Return the functional of the star, which is `now` before.
    """
    x, y, length = descent.position[v, 0], descent.position[v, 1], 1.0
    change_block(descent, v, first, length, 0.0)
    for _ in range(TRIES):
        after = derivatives(descent, v, x, y, VALUE)[1]
        if after <= now:
            return after
        change_block(descent, v, first, -0.5 * length, 0.0)
        length *= 0.5
    change_block(descent, v, first, -length, 0.0)
    return now


@inner_kernel
def gain_at(descents, v, first, x, y, length, now):
    """Return the decrease of the functionals by a move of node `v` to (x, y).

    In linear materials the elimination for the new position is left in the block. In nonlinear materials `length`
    times `response` is added to the unknowns, and subtracted again if the decrease is not positive.
    """
    descent, gain = descents.primal, now
    if descent.trial.nonlinear[v]:
        change_block(descent, v, first, 0.0, length)
        gain -= derivatives(descent, v, x, y, VALUE)[1]
        if not gain > 0.0:
            change_block(descent, v, first, 0.0, -length)
        return gain
    for i in range(descents.terms):
        descent = descents.primal if i == 0 else descents.dual
        gain -= derivatives(descent, v, x, y, BLOCK)[1]
        solved, square = factorise(descent.block, first)
        if not solved:
            return 0.0
        gain += 0.5 * square
    return gain
