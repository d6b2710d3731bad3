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
    FREE,
    HALF_COEFFICIENT,
    HELD,
    OWN,
    SIXTH_SOURCE,
)
from kohonen_adapt.kernels.triangle.chains import direction_of, point_at
from kohonen_adapt.kernels.triangle.geometry import may_move
from kohonen_adapt.kernels.triangle.polish.varying import half_flux, half_flux_rates
from kohonen_adapt.kernels.vectors import (
    ZERO,
    cross,
    divided,
    dot,
    from_to,
    minus,
    plus,
    plus_dot,
    plus_square,
    plus_times,
    put,
    times,
    turned,
    weighted,
    xy,
)

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
    magnitude, total, gradient, by_w, hessian, mixed, ww
        Sum of magnitudes of all terms, functional, and derivatives by (x, y), w, (xx, xy, yy), (xw, yw) and ww.
    """
    x, own = xy(position, v), trial.value[v]
    magnitude = total = by_w = ww = 0.0
    gradient, hessian = (0.0, 0.0), ZERO
    mixed = (0.0, 0.0)
    for j in range(star.start[v], star.start[v + 1]):
        e, i, k = star.element[j], star.ahead[j], star.behind[j]
        a, b = from_to(x, position, i), from_to(x, position, k)
        alpha, beta = trial.value[i] - own, trial.value[k] - own
        edge, difference = minus(b, a), alpha - beta
        inwards, doubled = turned(edge), cross(a, b)  # D and its derivative by the position
        inverse = 1.0 / doubled
        weight, load = trial.data[e, HALF_COEFFICIENT] * inverse, trial.data[e, SIXTH_SOURCE]
        flux = turned(half_flux(trial.data, e, x, a, b))
        n = weighted(beta, a, -alpha, b)
        q = times(inverse, n)
        energy = 0.5 * weight * dot(n, n)
        # dn/dx - q dD/dx and dn/dy - q dD/dy with the doubled area D
        n_x, n_y = plus_times((difference, 0.0), -inwards[0], q), plus_times((0.0, difference), -inwards[1], q)
        if trial.laws.number[e] >= 0:
            density, rate, curve = energy_density(trial.laws, trial.laws.number[e], dot(q, q))
            weight, energy = rate * inverse, 0.5 * doubled * density
            # additions to the terms of a constant coefficient: the rest of W times the area, and d2W/ds2 along grad u
            rest, curve = 0.5 * density - 0.5 * rate * dot(q, q), 2.0 * curve * inverse
            square, square_w = (dot(q, n_x), dot(q, n_y)), dot(q, edge)
            gradient = plus_times(gradient, rest, inwards)
            hessian = plus_square(hessian, curve, square)
            mixed = plus_times(mixed, square_w, times(curve, square))
            ww += curve * square_w * square_w
        pull, push = load * doubled * (alpha + beta), -dot(flux, n)
        magnitude += energy + abs(pull) + abs(push)
        total += energy - pull - push
        change = times(weight, weighted(difference, n, -0.5 * dot(q, n), inwards))
        change = plus_times(change, -load * (alpha + beta), inwards)
        gradient = plus(gradient, plus_times(change, difference, flux))
        by_w += plus_dot(weight * dot(edge, n) - load * doubled, edge, flux)
        hessian = plus_times(hessian, weight, (dot(n_x, n_x), dot(n_x, n_y), dot(n_y, n_y)))
        mixed = plus(mixed, weighted(weight, (dot(n_x, edge), dot(n_y, edge)), -load, inwards))
        ww += weight * dot(edge, edge)
        if trial.data.shape[1] > CONSTANTS:
            by_x, by_y = half_flux_rates(trial.data, e, x, a, b)
            gradient = minus(gradient, (cross(n, by_x), cross(n, by_y)))
            hessian = plus_times(hessian, difference, (-2.0 * by_x[1], by_x[0] - by_y[1], 2.0 * by_y[0]))
            mixed = minus(mixed, (cross(edge, by_x), cross(edge, by_y)))
    return magnitude, total, gradient, by_w, hessian, mixed, ww


@inner_kernel
def quadratic(position, star, trial, v, x):
    # the same as `parabola` without laws, because calls of `parabola` make a polish a seventh slower
    own = trial.value[v]
    c = r = k = 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, ahead, behind = star.element[j], star.ahead[j], star.behind[j]
        a, b = from_to(x, position, ahead), from_to(x, position, behind)
        alpha, beta = trial.value[ahead] - own, trial.value[behind] - own
        edge, doubled = minus(b, a), cross(a, b)
        weight, load = trial.data[e, HALF_COEFFICIENT] / doubled, doubled * trial.data[e, SIXTH_SOURCE]
        flux, n = turned(half_flux(trial.data, e, x, a, b)), weighted(beta, a, -alpha, b)
        c += plus_dot(0.5 * weight * dot(n, n) - load * (alpha + beta), flux, n)
        r += plus_dot(weight * dot(edge, n) - load, flux, edge)
        k += weight * dot(edge, edge)
    return c, r, k


@inner_kernel
def eliminated(slope):
    magnitude, total, gradient, by_w, hessian, mixed, ww = slope
    gradient = minus(gradient, divided(times(by_w, mixed), ww))
    hessian = minus(hessian, divided(plus_square(ZERO, 1.0, mixed), ww))
    return magnitude, total - 0.5 * by_w * by_w / ww, gradient, hessian


@inner_kernel
def move_free(position, star, trials, v, floor):
    trial, dual = trials.primal, trials.dual
    has_dual = trials.dual.value.shape[0] > 0
    slope = derivatives(position, star, trial, v)
    _, _, _, by_w, _, mixed, ww = slope
    magnitude, now, gradient, hessian = eliminated(slope)
    dual_change = 0.0
    if has_dual:
        slope = derivatives(position, star, dual, v)
        dual_change = -slope[3] / slope[6]
        more = eliminated(slope)
        magnitude, now = magnitude + more[0], now + more[1]
        gradient, hessian = plus(gradient, more[2]), plus(hessian, more[3])
    step = newton_step(gradient, hessian)
    if -dot(step, gradient) > ROUNDING * magnitude:
        for _ in range(HALVINGS + 1):
            x = plus(xy(position, v), step)
            if may_move(position, star, v, x, floor):
                if trial.nonlinear[v]:
                    w = -plus_dot(by_w, mixed, step) / ww
                    c, r, k = least_parabola(position, star, trial, v, x, w, np.bool_(False))
                else:
                    c, r, k = quadratic(position, star, trial, v, x)
                gain, z = now - c + 0.5 * r * r / k, 0.0
                if has_dual:
                    d, s, stiff = quadratic(position, star, dual, v, x)
                    gain, z = gain - d + 0.5 * s * s / stiff, -s / stiff
                if gain > ROUNDING * magnitude:
                    put(position, v, x)
                    trial.value[v] -= r / k
                    if has_dual:
                        dual.value[v] += z
                    return gain
            step = times(0.5, step)
    if trial.nonlinear[v]:
        improve_value(position, star, trial, v)
    else:
        trial.value[v] -= by_w / ww
    if has_dual:
        dual.value[v] += dual_change
    return 0.0


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
    along, across = -0.5 * OVERSTEP * (high + low), 0.0
    if radius > 0.0:
        across = -0.5 * OVERSTEP * (high - low) / radius
    return weighted(along, gradient, across, (half * x + off_diagonal * y, off_diagonal * x - half * y))


@inner_kernel
def along_line(slope, tangent, is_dirichlet, rate):
    magnitude, total, gradient, by_w, hessian, mixed, ww = slope
    along = dot(tangent, mixed)
    if not is_dirichlet:
        total, rate = total - 0.5 * by_w * by_w / ww, -along / ww
    curvature = curvature_along(tangent, hessian) + (2.0 * along + rate * ww) * rate
    return magnitude, total, dot(tangent, gradient) + rate * by_w, curvature, rate


@inner_kernel
def curvature_along(tangent, hessian):
    x, y = tangent
    return x * x * hessian[0] + 2.0 * x * y * hessian[1] + y * y * hessian[2]


@inner_kernel
def value_on_chain(trial, chain, parameter):
    return trial.on_chain[chain, 0] + trial.on_chain[chain, 1] * parameter


@inner_kernel
def move_on_chain(position, star, constraints, trials, v, floor):
    trial, dual = trials.primal, trials.dual
    has_dual = trials.dual.value.shape[0] > 0
    chain, parameter = np.int64(constraints.chain[v, OWN]), constraints.parameter[v]
    tangent, is_dirichlet = direction_of(constraints.chains, chain), trial.fixed[v]
    slope = derivatives(position, star, trial, v)
    magnitude, now, along, curvature, rate = along_line(slope, tangent, is_dirichlet, trial.on_chain[chain, 1])
    by_w, ww = slope[3], slope[6]
    dual_change = 0.0
    if has_dual:
        slope = derivatives(position, star, dual, v)
        dual_change = -slope[3] / slope[6]
        more = along_line(slope, tangent, is_dirichlet, dual.on_chain[chain, 1])
        magnitude, now = magnitude + more[0], now + more[1]
        along, curvature = along + more[2], curvature + more[3]
    change = -OVERSTEP * along / abs(curvature)
    if -change * along > ROUNDING * magnitude:
        for _ in range(HALVINGS + 1):
            x = point_at(constraints.chains, chain, parameter + change)
            if may_move(position, star, v, x, floor):
                w = rate * change - by_w / ww
                if is_dirichlet:
                    w = value_on_chain(trial, chain, parameter + change) - trial.value[v]
                if trial.nonlinear[v]:
                    c, r, k = least_parabola(position, star, trial, v, x, w, is_dirichlet)
                else:
                    c, r, k = quadratic(position, star, trial, v, x)
                if not is_dirichlet:
                    w = -r / k
                gain, z = now - c - (r + 0.5 * k * w) * w, 0.0
                if has_dual:
                    c, r, k = quadratic(position, star, dual, v, x)
                    z = -r / k
                    if is_dirichlet:
                        z = value_on_chain(dual, chain, parameter + change) - dual.value[v]
                    gain -= c + (r + 0.5 * k * z) * z
                if gain > ROUNDING * magnitude:
                    constraints.parameter[v] = parameter + change
                    put(position, v, x)
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
def parabola(position, star, trial, v, x, w):
    c = r = k = 0.0
    for j in range(star.start[v], star.start[v + 1]):
        e, a, b = np.int64(star.element[j]), np.int64(star.ahead[j]), np.int64(star.behind[j])
        part, by_w, by_ww = triangle_parabola(position, trial, e, a, b, x, trial.value[v], w)
        c += part
        r += by_w
        k += by_ww
    return c, r, k


@inner_kernel
def triangle_parabola(position, trial, e, i, j, x, own, w):
    a, b = from_to(x, position, i), from_to(x, position, j)
    alpha, beta = trial.value[i] - own, trial.value[j] - own
    edge, doubled = minus(b, a), cross(a, b)
    load, flux = doubled * trial.data[e, SIXTH_SOURCE], turned(half_flux(trial.data, e, x, a, b))
    n = plus_times(weighted(beta, a, -alpha, b), w, edge)
    along, square = dot(edge, n), dot(n, n)
    law = trial.laws.number[e]
    weight, curve_term = trial.data[e, HALF_COEFFICIENT] / doubled, 0.0
    energy = 0.5 * weight * square
    if law >= 0:
        density, rate, curve = energy_density(trial.laws, law, square / (doubled * doubled))
        energy, weight = 0.5 * doubled * density, rate / doubled
        curve_term = 2.0 * curve * along * along / (doubled * doubled * doubled)
    c = plus_dot(energy - load * (alpha + beta + w), flux, n)
    return c, plus_dot(weight * along - load, flux, edge), curve_term + weight * dot(edge, edge)


@inner_kernel
def improve_value(position, star, trial, v):
    x = xy(position, v)
    c, r, k = parabola(position, star, trial, v, x, 0.0)
    w = -r / k
    for _ in range(TRIES):
        if not trial.nonlinear[v] or parabola(position, star, trial, v, x, w)[0] <= c:
            trial.value[v] += w
            return
        w *= 0.5


@inner_kernel
def least_parabola(position, star, trial, v, x, w, is_dirichlet):
    """Return c, r, k of a parabola c + r w + k w^2 / 2 for `v` at x.

    The parabola has the functional at the better of `w` and of one Newton step from `w` as its minimum there. For a
    Dirichlet value the parabola is constant.
    """
    c, r, k = parabola(position, star, trial, v, x, w)
    if is_dirichlet:
        return c, 0.0, 0.0
    further = w - r / k
    value = parabola(position, star, trial, v, x, further)[0]
    if value < c:
        c, w = value, further
    return c + 0.5 * k * w * w, -k * w, k
