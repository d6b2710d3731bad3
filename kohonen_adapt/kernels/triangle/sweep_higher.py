"""Sweep nodes downhill with what changes with them eliminated: free ones in the plane, others along straight chains."""

import numpy as np

from kohonen_adapt.kernels.arrays import DIRECTION_X, DIRECTION_Y, FREE, HELD, OWN
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import point_at
from kohonen_adapt.kernels.triangle.descend import HALVINGS, OVERSTEP, ROUNDING, TRIES, newton_step, value_on_chain
from kohonen_adapt.kernels.triangle.descend_higher import (
    change_block,
    count_of,
    derivatives,
    factorise,
    number_block,
    solve_upper,
    stays_valid,
)
from kohonen_adapt.kernels.triangle.geometry import may_move


@kernel
def descend_nodes_higher(descents, order, floor):
    """Move nodes, in the given order, to where the functionals of their stars are lower; returns the gain of the moves.

    The coefficients around a node follow; as of order 1, what better ones at the same place gain does not count.
    """
    kinds, fixed, gain = descents.one.constraints.kind, descents.one.trial.fixed, 0.0
    for node in order:
        v = np.int64(node)
        kind, first = kinds[v], 1 if fixed[v] else 0  # of the unknowns that are free
        for i in range(count_of(descents)):
            descent = descents.one if i == 0 else descents.other
            number_block(descent, v)
            if kind == HELD or descent.trial.bent[v]:
                improve(descent, v, first)
        if kind == FREE:
            gain += move_free(descents, v, floor)
        elif kind != HELD:
            gain += move_on_chain(descents, v, first, floor)
    return gain


@inner_kernel
def eliminated(descent, v):
    """The functional of the star of v with its derivatives by the position, its block at its best.

    Returns (whether that could be found, sum of magnitudes, value, by x, y, by xx, xy, yy).
    """
    block = descent.block
    size, now, by_x, by_y, xx, xy, yy = derivatives(descent, v, descent.position[v, 0], descent.position[v, 1])
    solved, square = factorise(block, 0)
    if not descent.trial.bent[v]:
        now -= 0.5 * square
    for i in range(block.unknowns[0]):
        along, aside = block.mixed[i, 0], block.mixed[i, 1]
        by_x, by_y = by_x - along * block.rest[i], by_y - aside * block.rest[i]
        xx, xy, yy = xx - along * along, xy - along * aside, yy - aside * aside
    return solved, size, now, by_x, by_y, xx, xy, yy


@inner_kernel
def along_chain(descent, v, chain, first):
    """The functional of the star of v with its derivatives along a straight chain, its block at its best.

    A given value changes with the place. Returns (whether the best could be found, sum of magnitudes, value, first and
    second derivative).
    """
    place, block = descent.constraints.chains.place, descent.block
    tx, ty = place[chain, DIRECTION_X], place[chain, DIRECTION_Y]
    rate = descent.trial.on_chain[chain, 1] if first else 0.0
    x, y = descent.position[v, 0], descent.position[v, 1]
    size, now, by_x, by_y, xx, xy, yy = derivatives(descent, v, x, y)
    slope = tx * by_x + ty * by_y + rate * block.rest[0]
    curvature = tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy
    for i in range(block.unknowns[0]):
        # along the chain, in the first column; the second is not needed
        mixed = tx * block.mixed[i, 0] + ty * block.mixed[i, 1]
        curvature += rate * (2.0 * mixed + rate * block.stiffness[0, 0]) if i == 0 else 0.0
        block.mixed[i, 0], block.mixed[i, 1] = mixed + rate * block.stiffness[i, 0], 0.0
    solved, square = factorise(block, first)
    if not descent.trial.bent[v]:
        now -= 0.5 * square
    for i in range(first, block.unknowns[0]):
        slope -= block.mixed[i, 0] * block.rest[i]
        curvature -= block.mixed[i, 0] * block.mixed[i, 0]
    return solved, size, now, slope, curvature


@inner_kernel
def move_free(descents, v, floor):
    """Move a free node by a step with its blocks eliminated, or half as far until it is a gain; returns the gain."""
    position, star = descents.one.position, descents.one.star
    size, now, by_x, by_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count_of(descents)):
        part = eliminated(descents.one if i == 0 else descents.other, v)
        if not part[0]:
            return 0.0
        size, now, by_x, by_y = size + part[1], now + part[2], by_x + part[3], by_y + part[4]
        xx, xy, yy = xx + part[5], xy + part[6], yy + part[7]
    step_x, step_y = newton_step(by_x, by_y, xx, xy, yy)
    follow_step(descents, 0, step_x, step_y)
    if -(step_x * by_x + step_y * by_y) > ROUNDING * size:
        length = 1.0
        for _ in range(HALVINGS + 1):
            x, y = position[v, 0] + length * step_x, position[v, 1] + length * step_y
            if may_move(position, star, v, x, y, floor) and stays_valid(descents.one, v, x, y):
                gain = gain_at(descents, v, 0, x, y, length, now)
                if gain > ROUNDING * size:
                    position[v, 0], position[v, 1] = x, y
                    settle(descents, v, 0, True)
                    return gain
            length *= 0.5
    settle(descents, v, 0, False)
    return 0.0


@inner_kernel
def move_on_chain(descents, v, first, floor):
    """Move a node along a straight chain in the same way; where its values are given, they are looked up."""
    position, constraints = descents.one.position, descents.one.constraints
    chain, parameter = np.int64(constraints.chain[v, OWN]), constraints.parameter[v]
    size, now, slope, curvature = 0.0, 0.0, 0.0, 0.0
    for i in range(count_of(descents)):
        part = along_chain(descents.one if i == 0 else descents.other, v, chain, first)
        if not part[0]:
            return 0.0
        size, now, slope, curvature = size + part[1], now + part[2], slope + part[3], curvature + part[4]
    change = -OVERSTEP * slope / abs(curvature)
    follow_step(descents, first, change, 0.0)
    one, other, two = descents.one.trial, descents.other.trial, count_of(descents) == 2
    value, other_value = one.value[v], other.value[v] if two else 0.0
    if -change * slope > ROUNDING * size:
        length = 1.0
        for _ in range(HALVINGS + 1):
            ahead = parameter + length * change
            x, y = point_at(constraints.chains, chain, ahead)
            if may_move(position, descents.one.star, v, x, y, floor) and stays_valid(descents.one, v, x, y):
                if first:
                    one.value[v] = value_on_chain(one, chain, ahead)
                    if two:
                        other.value[v] = value_on_chain(other, chain, ahead)
                gain = gain_at(descents, v, first, x, y, length, now)
                if gain > ROUNDING * size:
                    constraints.parameter[v] = ahead
                    position[v, 0], position[v, 1] = x, y
                    settle(descents, v, first, True)
                    return gain
                if first:
                    one.value[v] = value
                    if two:
                        other.value[v] = other_value
            length *= 0.5
    settle(descents, v, first, False)
    return 0.0


@inner_kernel
def improve(descent, v, first):
    """Change the block by Newton's step, or beside nonlinear material half as far until the functional falls."""
    x, y, bent = descent.position[v, 0], descent.position[v, 1], descent.trial.bent[v]
    before, length = derivatives(descent, v, x, y)[1], 1.0
    if not factorise(descent.block, first)[0]:
        return
    solve_upper(descent.block, first, 0.0, 0.0)
    change_block(descent, v, first, length, 0.0)
    for _ in range(TRIES if bent else 0):
        if derivatives(descent, v, x, y)[1] <= before:
            return
        change_block(descent, v, first, -0.5 * length, 0.0)
        length *= 0.5
    if bent:
        change_block(descent, v, first, -length, 0.0)


@inner_kernel
def gain_at(descents, v, first, x, y, length, now):
    """What the functionals of the star, `now` in all, are lower with v at (x, y), the blocks changed as a step of that
    length says.

    Where all is linear the best values there are put in; where not, and it is no gain, those of before.
    """
    descent, gain = descents.one, now
    if descent.trial.bent[v]:
        change_block(descent, v, first, 1.0, length)
        gain -= derivatives(descent, v, x, y)[1]
        if not gain > 0.0:
            change_block(descent, v, first, -1.0, -length)
        return gain
    for i in range(count_of(descents)):
        descent = descents.one if i == 0 else descents.other
        gain -= derivatives(descent, v, x, y)[1]
        solved, square = factorise(descent.block, first)
        if not solved:
            return 0.0
        gain += 0.5 * square
    return gain


@inner_kernel
def follow_step(descents, first, step_x, step_y):
    """Solve for what changes with a step in all blocks."""
    for i in range(count_of(descents)):
        solve_upper((descents.one if i == 0 else descents.other).block, first, step_x, step_y)


@inner_kernel
def settle(descents, v, first, moved):
    """Put the best values of the blocks in, after a move or where v stays, if all is linear.

    Elsewhere they are there already after a move, and were improved before.
    """
    for i in range(count_of(descents)):
        descent = descents.one if i == 0 else descents.other
        if not descent.trial.bent[v]:
            if moved:
                solve_upper(descent.block, first, 0.0, 0.0)
            change_block(descent, v, first, 1.0, 0.0)
