"""Sweep nodes downhill with what changes with them eliminated: free ones in the plane, others along straight chains."""

import numpy as np

from kohonen_adapt.kernels.arrays import DIRECTION_X, DIRECTION_Y, FREE, HELD, OWN
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import point_at
from kohonen_adapt.kernels.triangle.descend import HALVINGS, OVERSTEP, ROUNDING
from kohonen_adapt.kernels.triangle.descend_higher import (
    change_block,
    derivatives,
    factorise,
    gain_at,
    improve,
    move_free,
    number_block,
    settle,
    solve_upper,
    stays_valid,
    value_near,
)
from kohonen_adapt.kernels.triangle.geometry import may_move


@kernel
def descend_nodes_higher(descent, order, floor):
    """Move nodes, in the given order, to where the functional of their stars is lower; returns the gain of the moves.

    The coefficients around a node follow; as of order 1, what better ones at the same place gain does not count.
    """
    constraints, trial, gain = descent.constraints, descent.trial, 0.0
    for node in order:
        v = np.int64(node)
        kind, first = constraints.kind[v], 1 if trial.fixed[v] else 0  # of the unknowns that are free
        own, count = value_near(descent, v), number_block(descent, v)
        if kind == HELD or trial.bent[v]:
            improve(descent, v, own, first, count)
        if kind == FREE:
            gain += move_free(descent, v, own, count, floor)
        elif kind != HELD:
            gain += move_on_chain(descent, v, own, first, count, floor)
    return gain


@inner_kernel
def move_on_chain(descent, v, own, first, count, floor):
    """Move a node along a straight chain in the same way; where its value is given, that is looked up."""
    position, constraints, trial, block = descent.position, descent.constraints, descent.trial, descent.block
    chain, parameter = np.int64(constraints.chain[v, OWN]), constraints.parameter[v]
    tx, ty = constraints.chains.place[chain, DIRECTION_X], constraints.chains.place[chain, DIRECTION_Y]
    rate = trial.on_chain[chain, 1] if first else 0.0
    size, now, by_x, by_y, xx, xy, yy = derivatives(descent, v, own, count, position[v, 0], position[v, 1])
    slope = tx * by_x + ty * by_y + rate * block.rest[0]
    curvature = tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy
    for i in range(count):
        # along the chain, in the first column; the second is not needed
        mixed = tx * block.mixed[i, 0] + ty * block.mixed[i, 1]
        curvature += rate * (2.0 * mixed + rate * block.stiffness[0, 0]) if i == 0 else 0.0
        block.mixed[i, 0], block.mixed[i, 1] = mixed + rate * block.stiffness[i, 0], 0.0
    solved, square = factorise(block, first, count)
    if not solved:
        return 0.0
    if not trial.bent[v]:
        now -= 0.5 * square
    for i in range(first, count):
        slope -= block.mixed[i, 0] * block.rest[i]
        curvature -= block.mixed[i, 0] * block.mixed[i, 0]
    change = -OVERSTEP * slope / abs(curvature)
    solve_upper(block, first, count, change, 0.0)
    value = trial.value[v]
    if -change * slope > ROUNDING * size:
        length = 1.0
        for _ in range(HALVINGS + 1):
            x, y = point_at(constraints.chains, chain, parameter + length * change)
            if may_move(position, descent.star, v, x, y, floor) and stays_valid(descent, v, x, y):
                if first:
                    trial.value[v] = trial.on_chain[chain, 0] + rate * (parameter + length * change)
                gain = gain_at(descent, v, own, first, count, x, y, length, now)
                if gain > ROUNDING * size:
                    constraints.parameter[v] = parameter + length * change
                    position[v, 0], position[v, 1] = x, y
                    settle(descent, v, first, count)
                    return gain
                if first:
                    trial.value[v] = value
            length *= 0.5
    if not trial.bent[v]:
        change_block(descent, v, first, 1.0, 0.0)
    return 0.0
