"""Sweep nodes downhill with what changes with them eliminated: free ones in the plane, others along their chain."""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import DIRECTION_X, DIRECTION_Y, FREE, HELD, OWN, SHAPE, STRAIGHT
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import (
    gone_along,
    middle_on_chain,
    parameter_of,
    point_at,
    way_along,
    within_reach,
)
from kohonen_adapt.kernels.triangle.connectivity import corner_of
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

PROBE = 0.02  # of the way to the next node on a curve, halved: how far off differences look for derivatives


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
        elif kind != HELD and constraints.chains.flags[constraints.chain[v, OWN], SHAPE] == STRAIGHT:
            gain += move_on_chain(descent, v, own, first, count, floor)
        elif kind != HELD:
            gain += move_on_curve(descent, v, first, count, floor)
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


@inner_kernel
def move_on_curve(descent, v, first, count, floor):
    """Move a node along a curve, by Newton's method for the least functional over its block at every place.

    There are few such nodes, so the derivatives are differences: the middles of curved sides go with the node, and how
    they do depends on the curve. A value that is given there is the same all along.
    """
    position, constraints, bent, gain = descent.position, descent.constraints, descent.trial.bent[v], 0.0
    chain, start = np.int64(constraints.chain[v, OWN]), constraints.parameter[v]
    x, y = position[v, 0], position[v, 1]
    if not stays_valid(descent, v, x, y):
        improve(descent, v, 0.0, first, count)
        return 0.0
    size, now = least_at(descent, v, first, count)
    if bent:
        now = derivatives(descent, v, 0.0, count, x, y)[1]
    room = room_on_curve(descent, chain, v)
    probe = PROBE * room
    go_on_curve(descent, chain, v, start, probe)
    up = least_at(descent, v, first, count)[1]
    go_on_curve(descent, chain, v, start, -probe)
    down = least_at(descent, v, first, count)[1]
    stand_on_curve(descent, chain, v, start, x, y)
    slope, curvature = (up - down) / (2.0 * probe), abs(up - 2.0 * now + down) / (probe * probe)
    change = math.copysign(room, -slope)
    if curvature * room > OVERSTEP * abs(slope):
        change = -OVERSTEP * slope / curvature
    if abs(change * slope) > ROUNDING * size:
        for _ in range(HALVINGS + 1):
            there_x, there_y = point_at(constraints.chains, chain, gone_along(constraints.chains, chain, start, change))
            if may_move(position, descent.star, v, there_x, there_y, floor) and within_reach(
                position, descent.elements, descent.star, constraints.chains, chain, v, there_x, there_y
            ):
                go_on_curve(descent, chain, v, start, change)
                gain = now - least_at(descent, v, first, count)[1]
                if gain > ROUNDING * size and stays_valid(descent, v, there_x, there_y):
                    break
                stand_on_curve(descent, chain, v, start, x, y)
            gain, change = 0.0, 0.5 * change
    if gain > 0.0 or not bent:
        improve(descent, v, 0.0, first, count)
    return gain


@inner_kernel
def go_on_curve(descent, chain, v, start, way):
    """Put v so far along a curve from a parameter."""
    chains = descent.constraints.chains
    parameter = gone_along(chains, chain, start, way)
    x, y = point_at(chains, chain, parameter)
    stand_on_curve(descent, chain, v, parameter, x, y)


@inner_kernel
def stand_on_curve(descent, chain, v, parameter, x, y):
    """Put v there, and bend its sides on the curve to the middle of the parameter."""
    position, constraints, elements, star = descent.position, descent.constraints, descent.elements, descent.star
    constraints.parameter[v], position[v, 0], position[v, 1] = parameter, x, y
    for row in range(star.start[v], star.start[v + 1]):
        e = np.int64(star.element[row])
        k = corner_of(elements.node, e, v)
        for side in range(1, 3):
            i = (k + side) % 3
            if elements.chain[e, i] == chain:
                other = np.int64(star.ahead[row] if side == 2 else star.behind[row])
                middle_x, middle_y, _ = middle_on_chain(position, constraints, chain, v, other)
                descent.shapes.bend[e, i, 0] = middle_x - 0.5 * (x + position[other, 0])
                descent.shapes.bend[e, i, 1] = middle_y - 0.5 * (y + position[other, 1])


@inner_kernel
def room_on_curve(descent, chain, v):
    """Half the way along a curve from v to the nearer of its neighbours there."""
    constraints, elements, star, room = descent.constraints, descent.elements, descent.star, np.inf
    for row in range(star.start[v], star.start[v + 1]):
        e = np.int64(star.element[row])
        k = corner_of(elements.node, e, v)
        for side in range(1, 3):
            if elements.chain[e, (k + side) % 3] == chain:
                other = np.int64(star.ahead[row] if side == 2 else star.behind[row])
                end = parameter_of(descent.position, constraints, chain, other)
                room = min(room, 0.5 * abs(way_along(constraints.chains, chain, constraints.parameter[v], end)))
    return room


@inner_kernel
def least_at(descent, v, first, count):
    """Sum of magnitudes and the least value of the functional around v; in nonlinear material after Newton's step."""
    position, block = descent.position, descent.block
    size, total = derivatives(descent, v, 0.0, count, position[v, 0], position[v, 1])[:2]
    solved, square = factorise(block, first, count)
    if not solved:
        return size, np.inf
    if not descent.trial.bent[v]:
        return size, total - 0.5 * square
    solve_upper(block, first, count, 0.0, 0.0)
    change_block(descent, v, first, 1.0, 0.0)
    total = derivatives(descent, v, 0.0, count, position[v, 0], position[v, 1])[1]
    change_block(descent, v, first, -1.0, 0.0)
    return size, total
