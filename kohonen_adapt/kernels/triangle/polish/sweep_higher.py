"""Descent of nodes at order 2 or 3, with the unknowns of the star eliminated."""

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import BLOCK, FREE, HELD, OWN, POSITION, VALUE
from kohonen_adapt.kernels.triangle.chains import direction_of, point_at
from kohonen_adapt.kernels.triangle.geometry import may_move
from kohonen_adapt.kernels.triangle.polish.descend import (
    OVERSTEP,
    ROUNDING,
    TRIES,
    curvature_along,
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
from kohonen_adapt.kernels.vectors import ZERO, dot, plus, plus_square, plus_times, put, xy


@kernel
def descend_nodes_higher(descents, order, floor):
    kinds, chains = descents.primal.constraints.kind, descents.primal.constraints.chain
    gain, fixed = 0.0, descents.primal.trial.fixed
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
    solved, magnitude, now, gradient, hessian
        True if the elimination succeeded, followed by the values of `add_element`.
    """
    block, mixed = descent.block, descent.block.mixed
    magnitude, now, gradient, hessian = derivatives(descent, v, xy(descent.position, v), POSITION)
    if chain >= 0:
        tangent = direction_of(descent.constraints.chains, chain)
        rate = descent.trial.on_chain[chain, 1] if first else 0.0
        gradient = dot(tangent, gradient) + rate * block.rest[0], 0.0
        curvature = curvature_along(tangent, hessian)
        for i in range(block.unknowns[0]):
            along = dot(tangent, xy(mixed, i))
            curvature += rate * (2.0 * along + rate * block.stiffness[0, 0]) if i == 0 else 0.0
            put(mixed, i, (along + rate * block.stiffness[i, 0], 0.0))
        hessian = curvature, 0.0, 0.0
    solved, square = factorise(block, first)
    if not descent.trial.nonlinear[v]:
        now -= 0.5 * square
    for i in range(first, block.unknowns[0]):
        gradient = plus_times(gradient, -block.rest[i], xy(mixed, i))
        hessian = plus_square(hessian, -1.0, xy(mixed, i))
    return solved, magnitude, now, gradient, hessian


@inner_kernel
def move(descents, v, chain, first, floor):
    primal, dual = descents.primal, descents.dual
    position, constraints = primal.position, primal.constraints
    magnitude = now = 0.0
    gradient, hessian = (0.0, 0.0), ZERO
    for i in range(descents.terms):
        part = eliminated(primal if i == 0 else dual, v, chain, first)
        if not part[0]:
            return 0.0
        magnitude, now = magnitude + part[1], now + part[2]
        gradient, hessian = plus(gradient, part[3]), plus(hessian, part[4])
    if chain >= 0:
        step = -OVERSTEP * gradient[0] / abs(hessian[0]), 0.0
    else:
        step = newton_step(gradient, hessian)
    for i in range(descents.terms):
        solve_upper((primal if i == 0 else dual).block, first, step)
    if primal.trial.nonlinear[v]:
        now = settle(primal, v, first, now)
    value, dual_value = primal.trial.value[v], dual.trial.value[v] if descents.terms == 2 else 0.0
    gain, length = 0.0, 1.0
    downhill = -dot(step, gradient) > ROUNDING * magnitude
    for _ in range(HALVINGS + 1 if downhill else 0):
        x, ahead = plus_times(xy(position, v), length, step), constraints.parameter[v] + length * step[0]
        if chain >= 0:
            x = point_at(constraints.chains, chain, ahead)
        if may_move(position, primal.star, v, x, floor) and stays_valid(primal, v, x):
            if first:
                primal.trial.value[v] = value_on_chain(primal.trial, chain, ahead)
                if descents.terms == 2:
                    dual.trial.value[v] = value_on_chain(dual.trial, chain, ahead)
            gain = gain_at(descents, v, first, x, length, now)
            if gain > ROUNDING * magnitude:
                put(position, v, x)
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
            solve_upper(descent.block, first, (0.0, 0.0))
        change_block(descent, v, first, 1.0, 0.0)
    return gain


@inner_kernel
def improve(descent, v, first):
    now = derivatives(descent, v, xy(descent.position, v), BLOCK)[1]
    if not factorise(descent.block, first)[0]:
        return
    solve_upper(descent.block, first, (0.0, 0.0))
    if descent.trial.nonlinear[v]:
        settle(descent, v, first, now)
    else:
        change_block(descent, v, first, 1.0, 0.0)


@inner_kernel
def settle(descent, v, first, now):
    """Add the correction of the block, halved until the functional does not rise.

    Return the functional of the star, which is `now` before.
    """
    x, length = xy(descent.position, v), 1.0
    change_block(descent, v, first, length, 0.0)
    for _ in range(TRIES):
        after = derivatives(descent, v, x, VALUE)[1]
        if after <= now:
            return after
        change_block(descent, v, first, -0.5 * length, 0.0)
        length *= 0.5
    change_block(descent, v, first, -length, 0.0)
    return now


@inner_kernel
def gain_at(descents, v, first, x, length, now):
    """Return the decrease of the functionals by a move of node `v` to x.

    In linear materials the elimination for the new position is left in the block. In nonlinear materials `length`
    times `response` is added to the unknowns, and subtracted again if the decrease is not positive.
    """
    descent, gain = descents.primal, now
    if descent.trial.nonlinear[v]:
        change_block(descent, v, first, 0.0, length)
        gain -= derivatives(descent, v, x, VALUE)[1]
        if not gain > 0.0:
            change_block(descent, v, first, 0.0, -length)
        return gain
    for i in range(descents.terms):
        descent = descents.primal if i == 0 else descents.dual
        gain -= derivatives(descent, v, x, BLOCK)[1]
        solved, square = factorise(descent.block, first)
        if not solved:
            return 0.0
        gain += 0.5 * square
    return gain
