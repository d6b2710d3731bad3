"""Descent of functionals of P1 functions by moves of single nodes.

On an element (v, a, b), counter-clockwise with doubled area D, the functional
int c/2 |grad u|^2 - f u - g . grad u is

    c |n|^2 / (4 D) - f D (u_v + u_a + u_b) / 6 - g . Jn / 2,    n = u_v (b - a) + u_a (x_v - b) + u_b (a - x_v),

where J turns by a right angle and grad u = Jn / D. D and n are affine in the position and the value of v, so
|n|^2 / D is jointly convex in both. Newton's method is therefore suitable, and only the source f can make a Hessian
indefinite.

A nonlinear material has an energy density W(|grad u|^2) in place of c/2 |grad u|^2, so the energy D W / 2 is
convex in the values. The derivative W', half the secant coefficient, replaces c/2. The same derivatives propose
moves, and W accepts or rejects them.
"""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import (
    CONSTANTS,
    DIRECTION_X,
    DIRECTION_Y,
    FREE,
    HALF_COEFFICIENT,
    HELD,
    OWN,
    SIXTH_SOURCE,
)
from kohonen_adapt.kernels.triangle.chains import point_at
from kohonen_adapt.kernels.triangle.geometry import may_move
from kohonen_adapt.kernels.triangle.polish.varying import half_flux, half_flux_rates

ROUNDING = 1e-13  # minimum gain as a fraction of the summed magnitudes of all terms
OVERSTEP = 1.6  # relaxation of Newton's step, as in successive over-relaxation: halves the number of sweeps
TRIES = 4  # lengths of a Newton step of a value, each half the previous length
LEAST_CURVATURE = 0.3  # minimum as a fraction of the larger principal curvature, limits steps in flat directions


@kernel
def descend_nodes(position, star, constraints, trials, order, floor):
    """Move nodes in the given order and return the gain by the moves.

    The value of a node follows its move. A free value minimises the functional, and a Dirichlet value is interpolated
    on the segment. Decreases by new values alone do not count.
    """
    gain, has_dual = 0.0, trials.dual.value.shape[0] > 0
    for node in order:
        v = np.int64(node)
        kind = constraints.kind[v]
        if kind == FREE:
            gain += move_free(position, star, trials, v, floor)
        elif kind != HELD:
            gain += move_on_chain(position, star, constraints, trials, v, floor)
        elif not trials.primal.fixed[v]:
            improve_value(position, star, trials.primal, v)
            if has_dual:
                improve_value(position, star, trials.dual, v)
    return gain


@inner_kernel
def derivatives(position, star, trial, v):
    """Return the functional of the star of `v` with first and second derivatives.

    The variables are the position (x, y) of `v` and the change w of its value. Values are relative to the value of
    `v`, which shifts the functional by a constant, because no move changes the area of the star.

    Returns
    -------
    magnitude, total, by_x, by_y, by_w, xx, xy, yy, xw, yw, ww
        Sum of magnitudes of all terms, functional, gradient and Hessian.
    """
    x, y, own = position[v, 0], position[v, 1], trial.value[v]
    magnitude, total, by_x, by_y, by_w = 0.0, 0.0, 0.0, 0.0, 0.0
    xx, xy, yy, xw, yw, ww = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = star.element[j], star.ahead[j], star.behind[j]
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        alpha, beta = trial.value[a] - own, trial.value[b] - own
        ex, ey, difference = bx - ax, by - ay, alpha - beta
        doubled = ax * by - ay * bx
        inverse = 1.0 / doubled
        weight, load = trial.data[e, HALF_COEFFICIENT] * inverse, trial.data[e, SIXTH_SOURCE]
        flux_x, flux_y = half_flux(trial.data, e, x, y, ax, ay, bx, by)
        nx, ny = beta * ax - alpha * bx, beta * ay - alpha * by
        qx, qy = inverse * nx, inverse * ny
        energy = 0.5 * weight * (nx * nx + ny * ny)
        # dn/dx - q dD/dx and dn/dy - q dD/dy with the doubled area D
        x_x, x_y = difference + qx * ey, qy * ey
        y_x, y_y = -qx * ex, difference - qy * ex
        if trial.laws.number[e] >= 0:
            density, rate, curve = energy_density(trial.laws, trial.laws.number[e], qx * qx + qy * qy)
            weight, energy = rate * inverse, 0.5 * doubled * density
            # additions to the terms of a constant coefficient: the rest of W times the area, and d2W/ds2 along grad u
            rest, curve = 0.5 * density - 0.5 * rate * (qx * qx + qy * qy), 2.0 * curve * inverse
            square_x, square_y, square_w = qx * x_x + qy * x_y, qx * y_x + qy * y_y, qx * ex + qy * ey
            by_x -= rest * ey
            by_y += rest * ex
            xx += curve * square_x * square_x
            xy += curve * square_x * square_y
            yy += curve * square_y * square_y
            xw += curve * square_x * square_w
            yw += curve * square_y * square_w
            ww += curve * square_w * square_w
        pull, push = load * doubled * (alpha + beta), flux_y * nx - flux_x * ny
        magnitude += energy + abs(pull) + abs(push)
        total += energy - pull - push
        half_square = 0.5 * (qx * nx + qy * ny)
        by_x += weight * (difference * nx + half_square * ey) + load * (alpha + beta) * ey - difference * flux_y
        by_y += weight * (difference * ny - half_square * ex) - load * (alpha + beta) * ex + difference * flux_x
        by_w += weight * (ex * nx + ey * ny) - load * doubled - flux_y * ex + flux_x * ey
        xx += weight * (x_x * x_x + x_y * x_y)
        xy += weight * (x_x * y_x + x_y * y_y)
        yy += weight * (y_x * y_x + y_y * y_y)
        xw += weight * (x_x * ex + x_y * ey) + load * ey
        yw += weight * (y_x * ex + y_y * ey) - load * ex
        ww += weight * (ex * ex + ey * ey)
        if trial.data.shape[1] > CONSTANTS:
            x_by_x, x_by_y, y_by_x, y_by_y = half_flux_rates(trial.data, e, x, y, ax, ay, bx, by)
            by_x -= y_by_x * nx - x_by_x * ny
            by_y -= y_by_y * nx - x_by_y * ny
            xx -= 2.0 * difference * y_by_x
            xy -= difference * (y_by_y - x_by_x)
            yy += 2.0 * difference * x_by_y
            xw -= y_by_x * ex - x_by_x * ey
            yw -= y_by_y * ex - x_by_y * ey
    return magnitude, total, by_x, by_y, by_w, xx, xy, yy, xw, yw, ww


@inner_kernel
def quadratic(position, star, trial, v, x, y):
    # the same as `parabola` without laws, because calls of `parabola` make a polish a seventh slower
    own = trial.value[v]
    c, r, k = 0.0, 0.0, 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = star.element[j], star.ahead[j], star.behind[j]
        ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
        alpha, beta = trial.value[a] - own, trial.value[b] - own
        ex, ey = bx - ax, by - ay
        doubled = ax * by - ay * bx
        weight, load = trial.data[e, HALF_COEFFICIENT] / doubled, doubled * trial.data[e, SIXTH_SOURCE]
        flux_x, flux_y = half_flux(trial.data, e, x, y, ax, ay, bx, by)
        nx, ny = beta * ax - alpha * bx, beta * ay - alpha * by
        c += 0.5 * weight * (nx * nx + ny * ny) - load * (alpha + beta) - flux_y * nx + flux_x * ny
        r += weight * (ex * nx + ey * ny) - load - flux_y * ex + flux_x * ey
        k += weight * (ex * ex + ey * ey)
    return c, r, k


@inner_kernel
def eliminated(slope):
    magnitude, total, by_x, by_y, by_w, xx, xy, yy, xw, yw, ww = slope
    by_x, by_y = by_x - xw * by_w / ww, by_y - yw * by_w / ww
    return (
        magnitude,
        total - 0.5 * by_w * by_w / ww,
        by_x,
        by_y,
        xx - xw * xw / ww,
        xy - xw * yw / ww,
        yy - yw * yw / ww,
    )


@inner_kernel
def move_free(position, star, trials, v, floor):
    trial, dual, has_dual = trials.primal, trials.dual, trials.dual.value.shape[0] > 0
    slope = derivatives(position, star, trial, v)
    _, _, _, _, by_w, _, _, _, xw, yw, ww = slope
    magnitude, now, by_x, by_y, xx, xy, yy = eliminated(slope)
    dual_change = 0.0
    if has_dual:
        slope = derivatives(position, star, dual, v)
        dual_change = -slope[4] / slope[10]
        more = eliminated(slope)
        magnitude, now, by_x, by_y = magnitude + more[0], now + more[1], by_x + more[2], by_y + more[3]
        xx, xy, yy = xx + more[4], xy + more[5], yy + more[6]
    step_x, step_y = newton_step(by_x, by_y, xx, xy, yy)
    if -(step_x * by_x + step_y * by_y) > ROUNDING * magnitude:
        for _ in range(HALVINGS + 1):
            x, y = position[v, 0] + step_x, position[v, 1] + step_y
            if may_move(position, star, v, x, y, floor):
                if trial.nonlinear[v]:
                    w = -(by_w + xw * step_x + yw * step_y) / ww
                    c, r, k = least_parabola(position, star, trial, v, x, y, w, np.bool_(False))
                else:
                    c, r, k = quadratic(position, star, trial, v, x, y)
                gain, z = now - c + 0.5 * r * r / k, 0.0
                if has_dual:
                    d, s, stiff = quadratic(position, star, dual, v, x, y)
                    gain, z = gain - d + 0.5 * s * s / stiff, -s / stiff
                if gain > ROUNDING * magnitude:
                    position[v, 0], position[v, 1] = x, y
                    trial.value[v] -= r / k
                    if has_dual:
                        dual.value[v] += z
                    return gain
            step_x, step_y = 0.5 * step_x, 0.5 * step_y
    if trial.nonlinear[v]:
        improve_value(position, star, trial, v)
    else:
        trial.value[v] -= by_w / ww
    if has_dual:
        dual.value[v] += dual_change
    return 0.0


@inner_kernel
def newton_step(by_x, by_y, xx, xy, yy):
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    radius = math.hypot(half, xy)
    least = LEAST_CURVATURE * (abs(mean) + radius)
    if not least > 0.0:
        return 0.0, 0.0
    # The inverse has the same eigenvectors, so a sum of multiples of the identity and of the deviatoric Hessian.
    high, low = 1.0 / max(least, abs(mean + radius)), 1.0 / max(least, abs(mean - radius))
    along, across = -0.5 * OVERSTEP * (high + low), 0.0
    if radius > 0.0:
        across = -0.5 * OVERSTEP * (high - low) / radius
    return along * by_x + across * (half * by_x + xy * by_y), along * by_y + across * (xy * by_x - half * by_y)


@inner_kernel
def along_line(slope, tx, ty, is_dirichlet, rate):
    magnitude, total, by_x, by_y, by_w, xx, xy, yy, xw, yw, ww = slope
    mixed = tx * xw + ty * yw
    if not is_dirichlet:
        total, rate = total - 0.5 * by_w * by_w / ww, -mixed / ww
    along = tx * by_x + ty * by_y + rate * by_w
    return (
        magnitude,
        total,
        along,
        tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy + (2.0 * mixed + rate * ww) * rate,
        rate,
    )


@inner_kernel
def value_on_chain(trial, chain, parameter):
    return trial.on_chain[chain, 0] + trial.on_chain[chain, 1] * parameter


@inner_kernel
def move_on_chain(position, star, constraints, trials, v, floor):
    trial, dual, has_dual = trials.primal, trials.dual, trials.dual.value.shape[0] > 0
    chain, parameter, is_dirichlet = np.int64(constraints.chain[v, OWN]), constraints.parameter[v], trial.fixed[v]
    tx, ty = constraints.chains.geometry[chain, DIRECTION_X], constraints.chains.geometry[chain, DIRECTION_Y]
    slope = derivatives(position, star, trial, v)
    magnitude, now, along, curvature, rate = along_line(slope, tx, ty, is_dirichlet, trial.on_chain[chain, 1])
    by_w, ww, dual_change = slope[4], slope[10], 0.0
    if has_dual:
        slope = derivatives(position, star, dual, v)
        dual_change = -slope[4] / slope[10]
        more = along_line(slope, tx, ty, is_dirichlet, dual.on_chain[chain, 1])
        magnitude, now, along, curvature = magnitude + more[0], now + more[1], along + more[2], curvature + more[3]
    change = -OVERSTEP * along / abs(curvature)
    if -change * along > ROUNDING * magnitude:
        for _ in range(HALVINGS + 1):
            x, y = point_at(constraints.chains, chain, parameter + change)
            if may_move(position, star, v, x, y, floor):
                w = rate * change - by_w / ww
                if is_dirichlet:
                    w = value_on_chain(trial, chain, parameter + change) - trial.value[v]
                if trial.nonlinear[v]:
                    c, r, k = least_parabola(position, star, trial, v, x, y, w, is_dirichlet)
                else:
                    c, r, k = quadratic(position, star, trial, v, x, y)
                if not is_dirichlet:
                    w = -r / k
                gain, z = now - c - (r + 0.5 * k * w) * w, 0.0
                if has_dual:
                    c, r, k = quadratic(position, star, dual, v, x, y)
                    z = -r / k
                    if is_dirichlet:
                        z = value_on_chain(dual, chain, parameter + change) - dual.value[v]
                    gain -= c + (r + 0.5 * k * z) * z
                if gain > ROUNDING * magnitude:
                    constraints.parameter[v] = parameter + change
                    position[v, 0], position[v, 1] = x, y
                    trial.value[v] += w
                    if has_dual:
                        dual.value[v] += z
                    return gain
            change *= 0.5
    if is_dirichlet:
        return 0.0
    if trial.nonlinear[v]:
        improve_value(position, star, trial, v)
    else:
        trial.value[v] -= by_w / ww
    if has_dual:
        dual.value[v] += dual_change
    return 0.0


@inner_kernel
def parabola(position, star, trial, v, x, y, w):
    c, r, k = 0.0, 0.0, 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[j]), np.int64(star.ahead[j]), np.int64(star.behind[j])
        part, by_w, by_ww = triangle_parabola(position, trial, e, a, b, x, y, trial.value[v], w)
        c += part
        r += by_w
        k += by_ww
    return c, r, k


@inner_kernel
def triangle_parabola(position, trial, e, a, b, x, y, own, w):
    ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
    alpha, beta = trial.value[a] - own, trial.value[b] - own
    ex, ey = bx - ax, by - ay
    doubled = ax * by - ay * bx
    load = doubled * trial.data[e, SIXTH_SOURCE]
    flux_x, flux_y = half_flux(trial.data, e, x, y, ax, ay, bx, by)
    nx, ny = beta * ax - alpha * bx + w * ex, beta * ay - alpha * by + w * ey
    along, square, law = ex * nx + ey * ny, nx * nx + ny * ny, trial.laws.number[e]
    weight, curve_term = trial.data[e, HALF_COEFFICIENT] / doubled, 0.0
    energy = 0.5 * weight * square
    if law >= 0:
        density, rate, curve = energy_density(trial.laws, law, square / (doubled * doubled))
        energy, weight = 0.5 * doubled * density, rate / doubled
        curve_term = 2.0 * curve * along * along / (doubled * doubled * doubled)
    c = energy - load * (alpha + beta + w) - flux_y * nx + flux_x * ny
    return c, weight * along - load - flux_y * ex + flux_x * ey, curve_term + weight * (ex * ex + ey * ey)


@inner_kernel
def improve_value(position, star, trial, v):
    x, y = position[v, 0], position[v, 1]
    c, r, k = parabola(position, star, trial, v, x, y, 0.0)
    w = -r / k
    for _ in range(TRIES):
        if not trial.nonlinear[v] or parabola(position, star, trial, v, x, y, w)[0] <= c:
            trial.value[v] += w
            return
        w *= 0.5


@inner_kernel
def least_parabola(position, star, trial, v, x, y, w, is_dirichlet):
    """Return c, r, k of a parabola c + r w + k w^2 / 2 for `v` at (x, y).

    The parabola has the functional at the better of `w` and of one Newton step from `w` as its minimum there. For a
    Dirichlet value the parabola is constant.
    """
    c, r, k = parabola(position, star, trial, v, x, y, w)
    if is_dirichlet:
        return c, 0.0, 0.0
    further = w - r / k
    value = parabola(position, star, trial, v, x, y, further)[0]
    if value < c:
        c, w = value, further
    return c + 0.5 * k * w * w, -k * w, k
