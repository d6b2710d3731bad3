"""Functionals of P1 functions in closed form, on triangles and around nodes.

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

import numpy as np

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle.arrays import CONSTANTS, HALF_COEFFICIENT, SIXTH_SOURCE, WITH
from kohonen_adapt.kernels.triangle.geometry import corners_around, ends_of, orientation
from kohonen_adapt.kernels.triangle.polish.varying import flux_term, half_flux, half_flux_rates
from kohonen_adapt.kernels.vectors import (
    ZERO,
    cross,
    dot,
    from_to,
    minus,
    plus,
    plus_dot,
    plus_square,
    plus_times,
    times,
    turned,
    weighted,
    xy,
)

TRIES = 4  # lengths of a Newton step of a value, each half the previous length


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
    x = xy(position, v)
    own = trial.value[v]
    magnitude = total = by_w = ww = 0.0
    gradient = (0.0, 0.0)
    hessian = ZERO
    mixed = (0.0, 0.0)
    for j in rows_of(star, v):
        e, i, k = star.element[j], star.ahead[j], star.behind[j]
        a, b = from_to(x, position, i), from_to(x, position, k)
        alpha, beta = trial.value[i] - own, trial.value[k] - own
        edge = minus(b, a)
        difference = alpha - beta
        inwards, doubled = turned(edge), cross(a, b)  # D and its derivative by the position
        inverse = 1.0 / doubled
        weight = trial.data[e, HALF_COEFFICIENT] * inverse
        load = trial.data[e, SIXTH_SOURCE]
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
            square = (dot(q, n_x), dot(q, n_y))
            square_w = dot(q, edge)
            gradient = plus_times(gradient, rest, inwards)
            hessian = plus_square(hessian, curve, square)
            mixed = plus_times(mixed, square_w, times(curve, square))
            ww += curve * square_w * square_w
        pull = load * doubled * (alpha + beta)
        push = -dot(flux, n)
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
def of_triangle(position, trial, laws, e, i, j, x, own, w):
    """Return the functional on a triangle as a parabola in the value at x.

    Corners are x and the nodes `i` and `j`. Values are relative to `own`, and the value at x is w. Without `laws`,
    numba compiles the terms of linear material alone, and no magnitude.

    Returns
    -------
    magnitude, c, r, k
        Sum of magnitudes of all terms, functional, and its first and second derivative by w.
    """
    a, b = from_to(x, position, i), from_to(x, position, j)
    alpha, beta = trial.value[i] - own, trial.value[j] - own
    edge, doubled = minus(b, a), cross(a, b)
    weight, load = trial.data[e, HALF_COEFFICIENT] / doubled, doubled * trial.data[e, SIXTH_SOURCE]
    flux, n = turned(half_flux(trial.data, e, x, a, b)), plus_times(weighted(beta, a, -alpha, b), w, edge)
    along, square = dot(edge, n), dot(n, n)
    energy = 0.5 * weight * square
    curve_term = 0.0
    if len(laws) > 0 and trial.laws.number[e] >= 0:
        density, rate, curve = energy_density(trial.laws, trial.laws.number[e], square / (doubled * doubled))
        energy, weight = 0.5 * doubled * density, rate / doubled
        curve_term = 2.0 * curve * along * along / (doubled * doubled * doubled)
    pull = load * (alpha + beta + w)
    magnitude = 0.0
    if len(laws) > 0:
        magnitude = energy + abs(pull) + abs(dot(flux, n))
    total, slope = plus_dot(energy - pull, flux, n), plus_dot(weight * along - load, flux, edge)
    return magnitude, total, slope, curve_term + weight * dot(edge, edge)


@inner_kernel
def around(position, star, trial, laws, v, x, w):
    """Return the sum of `of_triangle` around node `v` moved to x."""
    magnitude = c = r = k = 0.0
    for row in rows_of(star, v):
        e, a, b = star.element[row], star.ahead[row], star.behind[row]
        part = of_triangle(position, trial, laws, e, a, b, x, trial.value[v], w)
        magnitude += part[0]
        c += part[1]
        r += part[2]
        k += part[3]
    return magnitude, c, r, k


@inner_kernel
def improve_value(position, star, trial, v):
    x = xy(position, v)
    _, c, r, k = around(position, star, trial, WITH, v, x, 0.0)
    w = -r / k
    for _ in range(TRIES):
        if not trial.nonlinear[v] or around(position, star, trial, WITH, v, x, w)[1] <= c:
            trial.value[v] += w
            return
        w *= 0.5


@inner_kernel
def least_parabola(position, star, trial, v, x, w, is_dirichlet):
    """Return c, r, k of a parabola c + r w + k w^2 / 2 for `v` at x.

    The parabola has the functional at the better of `w` and of one Newton step from `w` as its minimum there. For a
    Dirichlet value the parabola is constant.
    """
    _, c, r, k = around(position, star, trial, WITH, v, x, w)
    if is_dirichlet:
        return c, 0.0, 0.0
    further = w - r / k
    value = around(position, star, trial, WITH, v, x, further)[1]
    if value < c:
        c, w = value, further
    return c + 0.5 * k * w * w, -k * w, k


@inner_kernel
def around_edge(descent, e, k, x, own, w):
    """Return the sum of `of_triangle` around an edge that is split at x."""
    position, trial, node, neighbour = (
        descent.position,
        descent.trial,
        descent.elements.node,
        descent.elements.neighbour,
    )
    magnitude = total = slope = stiffness = 0.0
    p, q = ends_of(node, e, k)
    for f in (e, np.int64(neighbour[e, k])):  # tuples of two types have no loops
        if f < 0:
            continue
        a, b = (p, q) if f == e else (q, p)
        c = node[f, 0] + node[f, 1] + node[f, 2] - p - q
        one = of_triangle(position, trial, WITH, f, c, a, x, own, w)
        two = of_triangle(position, trial, WITH, f, b, c, x, own, w)
        magnitude, total = magnitude + (one[0] + two[0]), total + (one[1] + two[1])
        slope, stiffness = slope + (one[2] + two[2]), stiffness + (one[3] + two[3])
    return magnitude, total, slope, stiffness


@inner_kernel
def change_by_split(descent, e, k, x):
    """Return the decrease by a split and the magnitude of terms.

    The new value is left in the block.
    """
    trial, block = descent.trial, descent.block
    a, b = ends_of(descent.elements.node, e, k)
    own = 0.5 * (trial.value[a] + trial.value[b])
    magnitude, before, slope, stiffness = around_edge(descent, e, k, x, own, 0.0)
    gain, w = 0.5 * slope * slope / stiffness, -slope / stiffness
    if trial.nonlinear[a] or trial.nonlinear[b]:
        gain = before - around_edge(descent, e, k, x, own, w)[1]
    block.own[0], block.local[0, 0] = own, w
    return gain, magnitude


@inner_kernel
def change_by_flip(descent, e, k, other):
    trial, node, position = descent.trial, descent.elements.node, descent.position
    p, q, r, s = corners_around(node, e, k, other)
    x = xy(position, r)
    own = trial.value[r]
    at_p, at_q, at_s = from_to(x, position, p), from_to(x, position, q), from_to(x, position, s)
    u, v, w = trial.value[p] - own, trial.value[q] - own, trial.value[s] - own
    s_to_p, s_to_q = minus(at_p, at_s), minus(at_q, at_s)
    inner, outer, left, right = cross(at_p, at_q), cross(s_to_q, s_to_p), cross(at_p, at_s), cross(at_s, at_q)
    if not (left > 0.0 and right > 0.0):
        return 0.0, 0.0
    before = stored(trial, e, at_p, u, at_q, v, inner) + stored(trial, e, s_to_q, v - w, s_to_p, u - w, outer)
    after = stored(trial, e, at_p, u, at_s, w, left) + stored(trial, e, at_s, w, at_q, v, right)
    load = trial.data[e, SIXTH_SOURCE]
    gain = before - after + load * (left * (u + w) + right * (w + v) - inner * (u + v) - outer * (u + v + w))
    # Constant fluxes contribute equally before and after: the boundary of the pair determines the mean gradient.
    if trial.data.shape[1] > CONSTANTS:
        gain += flux_term(trial.data, e, x, at_p, u, at_s, w) + flux_term(trial.data, e, x, at_s, w, at_q, v)
        gain -= flux_term(trial.data, e, x, at_p, u, at_q, v)
        gain -= flux_term(trial.data, e, plus(x, at_s), s_to_q, v - w, s_to_p, u - w)
    return gain, before + after + abs(load) * (inner + outer) * (abs(u) + abs(v) + abs(w))


@inner_kernel
def stored(trial, e, a, u, b, v, doubled):
    """Return the energy on (0, a, b) for the nodal values 0, u, v."""
    n = weighted(v, a, -u, b)
    law = trial.laws.number[e]
    if law >= 0:
        return 0.5 * doubled * energy_density(trial.laws, law, dot(n, n) / (doubled * doubled))[0]
    return 0.5 * trial.data[e, HALF_COEFFICIENT] * dot(n, n) / doubled


@inner_kernel
def merged(position, star, trial, v, w):
    """Return the functional around `v` merged into `w`, inf if inverted."""
    x = xy(position, w)
    own = trial.value[v]
    total = 0.0
    for row in rows_of(star, v):
        e, a, b = star.element[row], star.ahead[row], star.behind[row]
        if a == w or b == w:
            continue
        if not orientation(x, xy(position, a), xy(position, b)) > 0.0:
            return np.inf
        total += of_triangle(position, trial, WITH, e, a, b, x, own, trial.value[w] - own)[1]
    return total
