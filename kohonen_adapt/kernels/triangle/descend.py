"""Lower Ritz functionals of P1 functions by sweeps that move nodes.

The functional int c/2 |grad u|^2 - f u - g . grad u of an element (v, a, b), counter-clockwise with doubled area D, is

    c |n|^2 / (4 D) - f D (u_v + u_a + u_b) / 6 - g . Jn / 2,    n = u_v (b - a) + u_a (x_v - b) + u_b (a - x_v),

where J turns by a right angle, grad u = Jn / D. D and n are affine in the position and the value of v, so |n|^2 / D is
jointly convex in both: Newton's method fits, and only the source f can make a Hessian indefinite. Nonlinear material
has an energy density W(|grad u|^2) in place of c/2 |grad u|^2, an energy D W / 2 convex in the values, and the rate W',
half of the secant coefficient, in place of a constant; moves are proposed by the same derivatives and judged by W.
"""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import (
    CONSTANTS,
    DIRECTION_X,
    DIRECTION_Y,
    FREE,
    HALF_COEFFICIENT,
    HELD,
    OWN,
    SIXTH_SOURCE,
)
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.nonlinear import stored
from kohonen_adapt.kernels.triangle.chains import point_at
from kohonen_adapt.kernels.triangle.geometry import may_move
from kohonen_adapt.kernels.triangle.varying_flux import half_flux, half_flux_rates

ROUNDING = 1e-13  # of the sum of the magnitudes of what is added up: less is no gain
HALVINGS = 3  # a refused step is tried again at a half, a quarter, an eighth
OVERSTEP = 1.6  # of Newton's step: neighbours follow, as in successive over-relaxation; 8 sweeps do the work of 16
TRIES = 4  # of a Newton step of a value, each half of the one before
LEAST_CURVATURE = 0.3  # of the larger principal one: flatter directions count as curved as that, or steps are too wild


@kernel
def descend_nodes(position, star, constraints, trials, order, floor):
    """Move nodes, in the given order, to where the functional of their stars is lower; returns the gain of the moves.

    A node's own values follow: each is what minimises its functional, or where it is given along a chain what the chain
    says. What better values at the same place gain does not count.
    """
    gain, two = 0.0, trials.other.value.shape[0] > 0
    for node in order:
        v = np.int64(node)
        kind = constraints.kind[v]
        if kind == FREE:
            gain += move_free(position, star, trials, v, floor)
        elif kind != HELD:
            gain += move_on_chain(position, star, constraints, trials, v, floor)
        elif not trials.one.fixed[v]:
            improve_value(position, star, trials.one, v)
            if two:
                improve_value(position, star, trials.other, v)
    return gain


@inner_kernel
def derivatives(position, star, trial, v):
    """The functional of the star of v with its gradient and Hessian in (x, y, w), w the change of v's own value.

    Returns (sum of magnitudes, value, by x, y, w, by xx, xy, yy, xw, yw, ww). Values are taken relative to v's own:
    what that adds to the load depends on the area of the star alone, which no move changes.
    """
    x, y, own = position[v, 0], position[v, 1], trial.value[v]
    size, total, by_x, by_y, by_w = 0.0, 0.0, 0.0, 0.0, 0.0
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
        # derivatives of n by x, y, w less q times those of the doubled area
        x_x, x_y = difference + qx * ey, qy * ey
        y_x, y_y = -qx * ex, difference - qy * ex
        if trial.laws.number[e] >= 0:
            density, rate, bend = stored(trial.laws, trial.laws.number[e], qx * qx + qy * qy)
            weight, energy = rate * inverse, 0.5 * doubled * density
            # as if of a constant coefficient, and what that leaves of W is carried by the area, and bends along grad u
            rest, bend = 0.5 * density - 0.5 * rate * (qx * qx + qy * qy), 2.0 * bend * inverse
            square_x, square_y, square_w = qx * x_x + qy * x_y, qx * y_x + qy * y_y, qx * ex + qy * ey
            by_x -= rest * ey
            by_y += rest * ex
            xx += bend * square_x * square_x
            xy += bend * square_x * square_y
            yy += bend * square_y * square_y
            xw += bend * square_x * square_w
            yw += bend * square_y * square_w
            ww += bend * square_w * square_w
        pull, push = load * doubled * (alpha + beta), flux_y * nx - flux_x * ny
        size += energy + abs(pull) + abs(push)
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
    return size, total, by_x, by_y, by_w, xx, xy, yy, xw, yw, ww


@inner_kernel
def quadratic(position, star, trial, v, x, y):
    """The functional of the star with v at (x, y), as c + r w + k w^2 / 2 in the change w of v's value: (c, r, k).

    That is `parabola` without laws; were it asked for instead, a polish would take a seventh longer.
    """
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
    """Of what `derivatives` returns, the own value at its best: (sum of magnitudes, value, by x, y, by xx, xy, yy)."""
    size, total, by_x, by_y, by_w, xx, xy, yy, xw, yw, ww = slope
    by_x, by_y = by_x - xw * by_w / ww, by_y - yw * by_w / ww
    return size, total - 0.5 * by_w * by_w / ww, by_x, by_y, xx - xw * xw / ww, xy - xw * yw / ww, yy - yw * yw / ww


@inner_kernel
def move_free(position, star, trials, v, floor):
    """Move a free node by a step with its values eliminated, or half as far until it is a gain; returns the gain."""
    trial, other, two = trials.one, trials.other, trials.other.value.shape[0] > 0
    slope = derivatives(position, star, trial, v)
    _, _, _, _, by_w, _, _, _, xw, yw, ww = slope
    size, now, by_x, by_y, xx, xy, yy = eliminated(slope)
    still = 0.0
    if two:
        slope = derivatives(position, star, other, v)
        still = -slope[4] / slope[10]
        more = eliminated(slope)
        size, now, by_x, by_y = size + more[0], now + more[1], by_x + more[2], by_y + more[3]
        xx, xy, yy = xx + more[4], xy + more[5], yy + more[6]
    step_x, step_y = newton_step(by_x, by_y, xx, xy, yy)
    if -(step_x * by_x + step_y * by_y) > ROUNDING * size:
        for _ in range(HALVINGS + 1):
            x, y = position[v, 0] + step_x, position[v, 1] + step_y
            if may_move(position, star, v, x, y, floor):
                if trial.bent[v]:
                    w = -(by_w + xw * step_x + yw * step_y) / ww
                    c, r, k = least_parabola(position, star, trial, v, x, y, w, np.bool_(False))
                else:
                    c, r, k = quadratic(position, star, trial, v, x, y)
                gain, z = now - c + 0.5 * r * r / k, 0.0
                if two:
                    d, s, stiff = quadratic(position, star, other, v, x, y)
                    gain, z = gain - d + 0.5 * s * s / stiff, -s / stiff
                if gain > ROUNDING * size:
                    position[v, 0], position[v, 1] = x, y
                    trial.value[v] -= r / k
                    if two:
                        other.value[v] += z
                    return gain
            step_x, step_y = 0.5 * step_x, 0.5 * step_y
    if trial.bent[v]:
        improve_value(position, star, trial, v)
    else:
        trial.value[v] -= by_w / ww
    if two:
        other.value[v] += still
    return 0.0


@inner_kernel
def newton_step(by_x, by_y, xx, xy, yy):
    """Newton's step, overdone, downhill even where the Hessian is not positive: by its eigenvalues' magnitudes."""
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    radius = math.hypot(half, xy)
    least = LEAST_CURVATURE * (abs(mean) + radius)
    if not least > 0.0:
        return 0.0, 0.0
    # the inverse has the same eigenvectors: a multiple of the identity and one of the Hessian without its mean
    high, low = 1.0 / max(least, abs(mean + radius)), 1.0 / max(least, abs(mean - radius))
    along, across = -0.5 * OVERSTEP * (high + low), 0.0
    if radius > 0.0:
        across = -0.5 * OVERSTEP * (high - low) / radius
    return along * by_x + across * (half * by_x + xy * by_y), along * by_y + across * (xy * by_x - half * by_y)


@inner_kernel
def along_line(slope, tx, ty, given, rate):
    """The same along a direction, where a given value changes at that rate, and how the value follows then.

    Returns (sum of magnitudes, value, slope, curvature, rate of the value).
    """
    size, total, by_x, by_y, by_w, xx, xy, yy, xw, yw, ww = slope
    mixed = tx * xw + ty * yw
    if not given:
        total, rate = total - 0.5 * by_w * by_w / ww, -mixed / ww
    along = tx * by_x + ty * by_y + rate * by_w
    return size, total, along, tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy + (2.0 * mixed + rate * ww) * rate, rate


@inner_kernel
def value_on_chain(trial, chain, parameter):
    """What a chain on which values are given says."""
    return trial.on_chain[chain, 0] + trial.on_chain[chain, 1] * parameter


@inner_kernel
def move_on_chain(position, star, constraints, trials, v, floor):
    """Move a node along a straight chain in the same way; its values are eliminated, or looked up where given."""
    trial, other, two = trials.one, trials.other, trials.other.value.shape[0] > 0
    chain, parameter, given = np.int64(constraints.chain[v, OWN]), constraints.parameter[v], trial.fixed[v]
    tx, ty = constraints.chains.place[chain, DIRECTION_X], constraints.chains.place[chain, DIRECTION_Y]
    slope = derivatives(position, star, trial, v)
    size, now, along, curvature, rate = along_line(slope, tx, ty, given, trial.on_chain[chain, 1])
    by_w, ww, still = slope[4], slope[10], 0.0
    if two:
        slope = derivatives(position, star, other, v)
        still = -slope[4] / slope[10]
        more = along_line(slope, tx, ty, given, other.on_chain[chain, 1])
        size, now, along, curvature = size + more[0], now + more[1], along + more[2], curvature + more[3]
    change = -OVERSTEP * along / abs(curvature)
    if -change * along > ROUNDING * size:
        for _ in range(HALVINGS + 1):
            x, y = point_at(constraints.chains, chain, parameter + change)
            if may_move(position, star, v, x, y, floor):
                w = rate * change - by_w / ww
                if given:
                    w = value_on_chain(trial, chain, parameter + change) - trial.value[v]
                if trial.bent[v]:
                    c, r, k = least_parabola(position, star, trial, v, x, y, w, given)
                else:
                    c, r, k = quadratic(position, star, trial, v, x, y)
                if not given:
                    w = -r / k
                gain, z = now - c - (r + 0.5 * k * w) * w, 0.0
                if two:
                    c, r, k = quadratic(position, star, other, v, x, y)
                    z = -r / k
                    if given:
                        z = value_on_chain(other, chain, parameter + change) - other.value[v]
                    gain -= c + (r + 0.5 * k * z) * z
                if gain > ROUNDING * size:
                    constraints.parameter[v] = parameter + change
                    position[v, 0], position[v, 1] = x, y
                    trial.value[v] += w
                    if two:
                        other.value[v] += z
                    return gain
            change *= 0.5
    if given:
        return 0.0
    if trial.bent[v]:
        improve_value(position, star, trial, v)
    else:
        trial.value[v] -= by_w / ww
    if two:
        other.value[v] += still
    return 0.0


@inner_kernel
def parabola(position, star, trial, v, x, y, w):
    """The functional of the star with v at (x, y) and its value changed by w, and its two derivatives by w: (c, r, k).

    The value is relative to v's own, as of `derivatives`.
    """
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
    """The functional of a triangle in e of (x, y), a and b, where the value is own + w, and its derivatives by w.

    Values are taken relative to `own`.
    """
    ax, ay, bx, by = position[a, 0] - x, position[a, 1] - y, position[b, 0] - x, position[b, 1] - y
    alpha, beta = trial.value[a] - own, trial.value[b] - own
    ex, ey = bx - ax, by - ay
    doubled = ax * by - ay * bx
    load = doubled * trial.data[e, SIXTH_SOURCE]
    flux_x, flux_y = half_flux(trial.data, e, x, y, ax, ay, bx, by)
    nx, ny = beta * ax - alpha * bx + w * ex, beta * ay - alpha * by + w * ey
    along, square, law = ex * nx + ey * ny, nx * nx + ny * ny, trial.laws.number[e]
    weight, bent = trial.data[e, HALF_COEFFICIENT] / doubled, 0.0
    energy = 0.5 * weight * square
    if law >= 0:
        density, rate, bend = stored(trial.laws, law, square / (doubled * doubled))
        energy, weight = 0.5 * doubled * density, rate / doubled
        bent = 2.0 * bend * along * along / (doubled * doubled * doubled)
    c = energy - load * (alpha + beta + w) - flux_y * nx + flux_x * ny
    return c, weight * along - load - flux_y * ex + flux_x * ey, bent + weight * (ex * ex + ey * ey)


@inner_kernel
def improve_value(position, star, trial, v):
    """Change the value of v by Newton's step, or beside nonlinear material half as far until the functional falls."""
    x, y = position[v, 0], position[v, 1]
    c, r, k = parabola(position, star, trial, v, x, y, 0.0)
    w = -r / k
    for _ in range(TRIES):
        if not trial.bent[v] or parabola(position, star, trial, v, x, y, w)[0] <= c:
            trial.value[v] += w
            return
        w *= 0.5


@inner_kernel
def least_parabola(position, star, trial, v, x, y, w, given):
    """A parabola c + r w + k w^2 / 2 with the least value that is found from w for v at (x, y), and at its place.

    It is the better one of w and of one step of Newton's method from there; where the value is given that of w.
    """
    c, r, k = parabola(position, star, trial, v, x, y, w)
    if given:
        return c, 0.0, 0.0
    further = w - r / k
    value = parabola(position, star, trial, v, x, y, further)[0]
    if value < c:
        c, w = value, further
    return c + 0.5 * k * w * w, -k * w, k
