"""Descent of functionals by moves of single nodes, with unknowns eliminated."""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import BLOCK, FREE, HELD, OWN, POSITION, ROWS, UNKNOWNS, VALUE, WITHOUT
from kohonen_adapt.kernels.triangle.chains import point_at
from kohonen_adapt.kernels.triangle.guard import may_move
from kohonen_adapt.kernels.triangle.polish import linear
from kohonen_adapt.kernels.triangle.polish.linear import TRIES, around, improve_value, least_parabola
from kohonen_adapt.kernels.triangle.polish.patch import (
    change,
    correct,
    derivatives,
    factorise,
    may_centre,
    number_unknowns,
    respond,
    term_of,
)
from kohonen_adapt.kernels.triangle.polish.rows import gather_star, put_star
from kohonen_adapt.kernels.vectors import (
    ZERO,
    divided,
    dot,
    minus,
    plus,
    plus_dot,
    plus_square,
    plus_times,
    put,
    times,
    weighted,
    xy,
)

ROUNDING = 1e-13  # minimum gain as a fraction of the summed magnitudes of all terms
OVERSTEP = 1.6  # relaxation of Newton's step, as in successive over-relaxation: halves the number of sweeps
LEAST_CURVATURE = 0.3  # minimum as a fraction of the larger principal curvature, limits steps in flat directions


@kernel
def descend_nodes(descents, higher, order, floor):
    """Move nodes in the given order and return the gain by the moves.

    The unknowns of a node follow its move. Free unknowns minimise the functional, and a Dirichlet value is interpolated
    on the segment. Decreases by new values alone do not count.
    """
    constraints, fixed = descents.primal.constraints, descents.primal.trial.fixed
    gain = 0.0
    for v in order:
        kind = constraints.kind[v]
        first = 1 if fixed[v] else 0  # first free unknown
        for i in range(descents.terms):
            descent = term_of(descents, i)
            if len(higher) > 0:
                gather_star(descent, v)
                number_unknowns(descent, True)
            if kind == HELD:
                improve(descent, higher, v, first)
        if kind != HELD:
            chain = -1 if kind == FREE else constraints.chain[v, OWN]
            if len(higher) == 0:
                gain += move_linear(descents, v, chain, first, floor)
            else:
                gain += move(descents, v, chain, first, floor)
    return gain


@inner_kernel
def eliminated(descent, v, chain, first):
    """Return the derivatives by the position with the unknowns eliminated.

    Along segment `chain`, if not -1, the derivatives by x are those by the parameter, and a Dirichlet value changes
    with the parameter.

    Returns
    -------
    solved, magnitude, now, gradient, hessian
        True if the elimination succeeded, sum of magnitudes of all terms, functional, and its derivatives (x, y) and
        (xx, xy, yy).
    """
    block = descent.block
    magnitude, now, gradient, hessian = derivatives(descent, xy(descent.position, v), POSITION)
    if chain >= 0:
        tangent, rate = xy(descent.constraints.chains.direction, chain), rate_of(descent.trial, chain, first)
        gradient = dot(tangent, gradient) + rate * block.rest[0], 0.0
        curvature = curvature_along(tangent, hessian)
        for i in range(block.size[UNKNOWNS]):
            along = dot(tangent, xy(block.mixed, i))
            curvature += rate * (2.0 * along + rate * block.stiffness[0, 0]) if i == 0 else 0.0
            put(block.mixed, i, (along + rate * block.stiffness[i, 0], 0.0))
        hessian = curvature, 0.0, 0.0
    solved, square = factorise(block, first, POSITION)
    if not descent.trial.nonlinear[v]:
        now -= 0.5 * square
    for i in range(first, block.size[UNKNOWNS]):
        gradient = plus_times(gradient, -block.rest[i], xy(block.mixed, i))
        hessian = plus_square(hessian, -1.0, xy(block.mixed, i))
    return solved, magnitude, now, gradient, hessian


@inner_kernel
def rate_of(trial, chain, first):
    return trial.on_chain[chain, 1] if first else 0.0


@inner_kernel
def value_on(trial, chain, parameter):
    return trial.on_chain[chain, 0] + trial.on_chain[chain, 1] * parameter


@inner_kernel
def linear_eliminated(position, star, constraints, trial, v, chain, first):
    """Return the last four values of `eliminated`, and derivatives by the value.

    These are the derivatives by w, (xw, yw) and ww.
    """
    magnitude, now, gradient, by_w, hessian, mixed, ww = linear.derivatives(position, star, trial, v)
    if chain >= 0:
        tangent, rate = xy(constraints.chains.direction, chain), rate_of(trial, chain, first)
        along = dot(tangent, mixed)
        gradient = dot(tangent, gradient) + rate * by_w, 0.0
        hessian = curvature_along(tangent, hessian) + (2.0 * along + rate * ww) * rate, 0.0, 0.0
        mixed = along, 0.0
    if first == 0:
        now -= 0.5 * by_w * by_w / ww
        gradient = minus(gradient, divided(times(by_w, mixed), ww))
        hessian = minus(hessian, divided(plus_square(ZERO, 1.0, mixed), ww))
    return magnitude, now, gradient, hessian, by_w, mixed, ww


@inner_kernel
def newton_step(gradient, hessian):
    (x, y), (xx, off_diagonal, yy) = gradient, hessian
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    radius = math.hypot(half, off_diagonal)
    least = LEAST_CURVATURE * (abs(mean) + radius)
    if not least > 0.0:
        return 0.0, 0.0
    # The inverse has the same eigenvectors, so a sum of multiples of the identity and of the deviatoric Hessian.
    high, low = 1.0 / max(least, abs(mean + radius)), 1.0 / max(least, abs(mean - radius))
    along = -0.5 * OVERSTEP * (high + low)
    across = 0.0
    if radius > 0.0:
        across = -0.5 * OVERSTEP * (high - low) / radius
    return weighted(along, gradient, across, (half * x + off_diagonal * y, off_diagonal * x - half * y))


@inner_kernel
def curvature_along(tangent, hessian):
    x, y = tangent
    return x * x * hessian[0] + 2.0 * x * y * hessian[1] + y * y * hessian[2]


@inner_kernel
def step_of(chain, gradient, hessian):
    if chain >= 0:
        return -OVERSTEP * gradient[0] / abs(hessian[0]), 0.0
    return newton_step(gradient, hessian)


@inner_kernel
def target_of(position, constraints, v, chain, step):
    """Return the position and the parameter of node `v` after a step."""
    if chain >= 0:
        parameter = constraints.parameter[v] + step[0]
        return point_at(constraints.chains, chain, parameter), parameter
    return plus(xy(position, v), step), 0.0


@inner_kernel
def move_linear(descents, v, chain, first, floor):
    # the same as `move` in closed form, which without `Block` takes nine tenths of the time
    position, star, constraints = descents.primal.position, descents.primal.star, descents.primal.constraints
    trial, dual = descents.primal.trial, descents.dual.trial
    has_dual = descents.terms == 2
    magnitude, now, gradient, hessian, by_w, mixed, ww = linear_eliminated(
        position, star, constraints, trial, v, chain, first
    )
    dual_change = 0.0
    if has_dual:
        more = linear_eliminated(position, star, constraints, dual, v, chain, first)
        magnitude, now = magnitude + more[0], now + more[1]
        gradient, hessian = plus(gradient, more[2]), plus(hessian, more[3])
        dual_change = -more[4] / more[6]
    step = step_of(chain, gradient, hessian)
    for _ in range(HALVINGS + 1 if -dot(step, gradient) > ROUNDING * magnitude else 0):
        x, parameter = target_of(position, constraints, v, chain, step)
        if may_move(position, star, constraints.metric, v, x, floor):
            w = value_on(trial, chain, parameter) - trial.value[v] if first else -plus_dot(by_w, mixed, step) / ww
            if trial.nonlinear[v]:
                c, r, k = least_parabola(position, star, trial, v, x, w, first)
            else:
                _, c, r, k = around(position, star, trial, WITHOUT, v, x, 0.0)
            if not first:
                w = -r / k
            gain = now - c - (r + 0.5 * k * w) * w
            z = 0.0
            if has_dual:
                _, c, r, k = around(position, star, dual, WITHOUT, v, x, 0.0)
                z = value_on(dual, chain, parameter) - dual.value[v] if first else -r / k
                gain -= c + (r + 0.5 * k * z) * z
            if gain > ROUNDING * magnitude:
                put(position, v, x)
                if chain >= 0:
                    constraints.parameter[v] = parameter
                trial.value[v] += w
                if has_dual:
                    dual.value[v] += z
                return gain
        step = times(0.5, step)
    if not first:
        if trial.nonlinear[v]:
            improve_value(position, star, trial, v)
        else:
            trial.value[v] -= by_w / ww
        if has_dual:
            dual.value[v] += dual_change
    return 0.0


@inner_kernel
def move(descents, v, chain, first, floor):
    primal = descents.primal
    position, constraints = primal.position, primal.constraints
    magnitude = now = 0.0
    gradient = (0.0, 0.0)
    hessian = ZERO
    for i in range(descents.terms):
        part = eliminated(term_of(descents, i), v, chain, first)
        if not part[0]:
            return 0.0
        magnitude, now = magnitude + part[1], now + part[2]
        gradient, hessian = plus(gradient, part[3]), plus(hessian, part[4])
    step, is_valid = step_of(chain, gradient, hessian), may_centre(primal, xy(position, v))
    for i in range(descents.terms):
        block = term_of(descents, i).block
        correct(block, first)
        respond(block, first, step)
    if primal.trial.nonlinear[v]:
        now = settle(primal, v, first, now)
    gain, length = 0.0, 1.0
    for _ in range(HALVINGS + 1 if -dot(step, gradient) > ROUNDING * magnitude else 0):
        x, parameter = target_of(position, constraints, v, chain, times(length, step))
        if is_valid and may_move(position, primal.star, constraints.metric, v, x, floor) and may_centre(primal, x):
            gain = gain_at(descents, v, chain, first, x, parameter, length, now)
            if gain > ROUNDING * magnitude:
                put(position, v, x)
                if chain >= 0:
                    constraints.parameter[v] = parameter
                break
            gain = 0.0
        length *= 0.5
    for i in range(descents.terms):
        finish(term_of(descents, i), v, first, gain > 0.0)
    return gain


@inner_kernel
def gain_at(descents, v, chain, first, x, parameter, length, now):
    """Return the decrease of the functionals by a move of node `v` to x.

    In linear materials the elimination for the new position is left in the block. In nonlinear materials `length`
    times `response` is added to the unknowns, and subtracted again if the decrease is not positive.
    """
    gain = now
    nonlinear = descents.primal.trial.nonlinear[v]
    for i in range(descents.terms):
        descent = term_of(descents, i)
        block = descent.block
        if first:
            set_value(block, value_on(descent.trial, chain, parameter))
        if nonlinear:
            change(block, first, block.response, length)
        gain -= derivatives(descent, x, VALUE if nonlinear else BLOCK)[1]
        if not nonlinear:
            solved, square = factorise(block, first, BLOCK)
            gain = gain + 0.5 * square if solved else -np.inf
    if nonlinear and not gain > 0.0:
        change(descents.primal.block, first, descents.primal.block.response, -length)
    return gain


@inner_kernel
def finish(descent, v, first, moved):
    trial, block = descent.trial, descent.block
    if not trial.nonlinear[v]:
        if moved:
            correct(block, first)
        change(block, first, block.correction, 1.0)
    put_star(descent, v, first == 0)
    if first and moved:
        trial.value[v] = block.own[0] + block.own[1]


@inner_kernel
def set_value(block, value):
    block.own[1] = value - block.own[0]
    for j in range(block.size[ROWS]):
        block.local[j, 0] = block.own[1]


@inner_kernel
def improve(descent, higher, v, first):
    if len(higher) == 0:
        if not first:
            improve_value(descent.position, descent.star, descent.trial, v)
        return
    now = derivatives(descent, xy(descent.position, v), BLOCK)[1]
    block = descent.block
    if factorise(block, first, BLOCK)[0]:
        correct(block, first)
        if descent.trial.nonlinear[v]:
            settle(descent, v, first, now)
        else:
            change(block, first, block.correction, 1.0)
        put_star(descent, v, first == 0)


@inner_kernel
def settle(descent, v, first, now):
    """Add the correction of the block, halved until the functional does not rise.

    Return the functional of the star, which is `now` before.
    """
    x = xy(descent.position, v)
    block = descent.block
    length = 1.0
    change(block, first, block.correction, length)
    for _ in range(TRIES):
        after = derivatives(descent, x, VALUE)[1]
        if after <= now:
            return after
        change(block, first, block.correction, -0.5 * length)
        length *= 0.5
    change(block, first, block.correction, -length)
    return now
