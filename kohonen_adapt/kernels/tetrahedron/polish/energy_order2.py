"""Ritz functional of a P2 function on tetrahedra, with derivatives.

With the gradients g_k of the barycentric coordinates, the gradient of u is linear in an element, c_k at corner k. With
S = sum c_k, T_k = S + c_k and six times the volume D,

    int |grad u|^2 = D (|S|^2 + sum |c_k|^2) / 120,    int L_k grad u = D T_k / 120,    int grad u = D S / 24.

The function 4 L_i L_j of an edge has the gradient 4 (L_i g_j + L_j g_i) and the integral D / 30, so all derivatives by
coefficients follow without quadrature. If corner 0 moves by d and all coefficients are fixed, D changes by the factor
1 + s with s = g_0 . d, and with P = int grad u grad u^T / D

    E(d) = c D / 2 ((1 + s) tr P - 2 g_0 . P d + |g_0|^2 d . P d / (1 + s)) - (source and flux, linear in d),

so the second derivative c D |g_0|^2 P is never negative. Derivatives of order 1 in `star.py` are those of constant
gradients. `law_order2` has nonlinear laws.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import POSITION, VALUE
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, corners_of_edge, set_slopes
from kohonen_adapt.kernels.tetrahedron.polish.energy import density_at
from kohonen_adapt.kernels.tetrahedron.polish.law_order2 import (
    OF_EDGE,
    add_moments,
    add_moments_to_unknowns,
    add_turn,
    force_and_curvature,
    rank,
)
from kohonen_adapt.kernels.triangle.polish.by_points import MIN_JACOBIAN
from kohonen_adapt.kernels.vectors import (
    ZERO,
    ZEROS,
    add_to,
    combined,
    dot,
    minus,
    plus,
    plus_square,
    plus_times,
    point,
    product,
    put,
    times,
    weighted,
)


@inner_kernel
def set_offsets(block, corners):
    # Set the midside offsets of the edges, and return True if an edge is curved.
    is_curved = False
    for k in range(6):
        p, q = corners[EDGES[k, 0]], corners[EDGES[k, 1]]
        block.offset[k, 0] = block.offset[k, 1] = block.offset[k, 2] = 0.0
        for row in range(block.curve_start[p], block.curve_start[p + 1]):
            if block.curve_end[row] == q:
                is_curved = True
                for d in range(3):
                    block.offset[k, d] = block.curve_offset[row, d]
    return is_curved


@inner_kernel
def slopes_at(position, block, corners, at):
    tangent = block.tangent
    for k in range(4):
        for d in range(3):
            tangent[k, d] = position[corners[k], d]
    for k in range(6):
        p, q = corners_of_edge(k)
        for d in range(3):
            tangent[p, d] += 4.0 * at[q] * block.offset[k, d]
            tangent[q, d] += 4.0 * at[p] * block.offset[k, d]
    return set_slopes(tangent, block.slope, 0, 1, 2, 3)


@inner_kernel
def is_folded(position, block, corners):
    least = MIN_JACOBIAN * set_slopes(position, block.slope, *corners)
    for k in range(4):
        at = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0, 1.0 if k == 3 else 0.0)
        if not slopes_at(position, block, corners, at) > least:
            return True
    return False


@inner_kernel
def set_functions(block, i, at):
    # Set the gradients of the functions, and return the value and the gradient of u.
    g, u = block.slope, block.local
    value, gradient = 0.0, ZERO
    for k in range(10):
        if k < 4:
            size = at[k]
            slope = point(g, k)
        else:
            p, q = corners_of_edge(k - 4)
            size = 4.0 * at[p] * at[q]
            slope = times(4.0, weighted(at[p], point(g, q), at[q], point(g, p)))
        put(block.gradient, k, slope)
        value += u[i, k] * size
        gradient = plus_times(gradient, u[i, k], slope)
    return value, gradient


@inner_kernel
def add_unknowns_at(block, i, at, h, m, pull, field, wanted):
    # `pull` is the source times the volume of the point.
    gradient, dof = block.gradient, block.dof
    x = point(block.slope, 0)
    across, turned = dot(h, x), product(m, x)
    for own in range(10):
        row = dof[i, own]
        if row < 0:
            continue
        size = at[own] if own < 4 else 4.0 * at[EDGES[own - 4, 0]] * at[EDGES[own - 4, 1]]
        e = point(gradient, own)
        rest = dot(h, e) - pull * size
        t = product(m, e)
        block.rest[row] += rest
        for other in range(own + 1):
            column = dof[i, other]
            if column >= 0:
                block.stiffness[max(row, column), min(row, column)] += dot(t, point(gradient, other))
        if wanted == POSITION:
            add_to(block.mixed, row, combined(rest, x, -across, e, -dot(e, turned), field))


@inner_kernel
def add_by_points(position, trial, block, i, region, load, six, corners, wanted, is_curved):
    # Add the derivatives of an element with a law or with `block.offset` to the block, and return the results of
    # `add_element`. The arrays of the block and `six` are already set for straight elements, whose derivatives by
    # moments take 0.7 times as long as by points.
    if is_curved and is_folded(position, block, corners):
        return 0.0, np.inf, ZERO, ZEROS
    t = block.field
    energy = push = pulled = 0.0
    by_place, by_both = ZERO, ZEROS
    a, b, c, d = corners
    ranks = rank(a, b, c, d), rank(b, a, c, d), rank(c, a, b, d), rank(d, a, b, c)
    has_law = trial.laws.number[region] >= 0
    flux = times(6.0, point(trial.sixth_flux, region))
    shift = times(1.0 if has_law else 0.0, point(trial.shift, region))
    points, weights = (block.point, block.weight) if has_law else (block.curve_point, block.curve_weight)
    if wanted > VALUE:
        block.force[:] = 0.0
        block.curvature[:] = 0.0
        block.turn[:] = 0.0
    for q in range(weights.shape[0]):
        at = (points[q, ranks[0]], points[q, ranks[1]], points[q, ranks[2]], points[q, ranks[3]])
        source = 0.0
        if is_curved:
            six = slopes_at(position, block, corners, at)
            value, field = set_functions(block, i, at)
            source = 24.0 * load * value
        else:
            field = combined(at[0], point(t, 0), at[1], point(t, 1), at[2], point(t, 2))
            field = plus_times(field, at[3], point(t, 3))
        g = minus(field, shift)
        w = six / 6.0 * weights[q]
        density, rate, curve = density_at(trial, region, g)
        along = dot(flux, field)
        energy += w * density
        push += w * along
        pulled += w * source
        if wanted == VALUE:
            continue
        h, m = force_and_curvature(w, rate, curve, g, flux)
        if is_curved:
            add_unknowns_at(block, i, at, h, m, 24.0 * load * w, field, wanted)
        else:
            add_moments(block, at, h, m)
        if wanted < POSITION:
            continue
        x = point(block.slope, 0)
        turned = product(m, x)
        by_place = plus_times(plus_times(by_place, w * (density - along - source), x), -dot(h, x), field)
        by_both = plus_square(by_both, dot(turned, x), field)
        if not is_curved:
            add_turn(block, at, turned, field)
    if not is_curved:
        pulled = load * six * integral_of(block.local, i)
        if wanted > VALUE:
            add_moments_to_unknowns(block, i, load * six, wanted)
        if wanted == POSITION:
            by_place = plus_times(by_place, -pulled, point(block.slope, 0))
    return energy + abs(pulled) + abs(push), energy - pulled - push, by_place, by_both


@inner_kernel
def integral_of(u, i):
    """Return the integral of u over an element, divided by a quarter of the volume."""
    edges = u[i, 4] + u[i, 5] + u[i, 6] + u[i, 7] + u[i, 8] + u[i, 9]
    return u[i, 0] + u[i, 1] + u[i, 2] + u[i, 3] + OF_EDGE * edges


@inner_kernel
def add_element(position, trial, block, i, region, load, corners, wanted):
    """Add the derivatives of an element to the block, and return its functional.

    Parameters
    ----------
    i
        Row of the block with coefficients and unknowns of the element.
    region, load
        Region of the element, and a 24th of the source.
    corners
        Nodes (a, b, c, d), in positive order.
    wanted
        VALUE, BLOCK or POSITION. Derivatives by the position of a beyond the level `wanted` are 0.

    Returns
    -------
    magnitude, total, gradient, hessian
        Sum of magnitudes of all terms, functional, and derivatives (x, y, z) and (xx, xy, xz, yy, yz, zz).
    """
    g, t, u = block.slope, block.field, block.local
    if block.curve_end.shape[0] > 0 and set_offsets(block, corners):
        return add_by_points(position, trial, block, i, region, load, 0.0, corners, wanted, True)
    six = set_slopes(position, g, *corners)
    set_fields(g, t, u, i)
    if trial.laws.number[region] >= 0:
        return add_by_points(position, trial, block, i, region, load, six, corners, wanted, False)
    total, moment = ZERO, ZEROS
    for k in range(4):
        total, moment = plus(total, point(t, k)), plus_square(moment, 1.0, point(t, k))
    moment = plus_square(moment, 1.0, total)
    for k in range(4):
        add_to(t, k, total)
    weight, pull = six * trial.twelfth[region], load * six
    flux = times(six, point(trial.sixth_flux, region))
    energy = 0.05 * weight * (moment[0] + moment[3] + moment[5])
    pulled = pull * integral_of(u, i)
    push = 0.25 * dot(flux, total)
    if wanted > VALUE:
        add_unknowns(block, i, weight, pull, flux, wanted)
    magnitude, level = energy + abs(pulled) + abs(push), energy - pulled - push
    if wanted < POSITION:
        return magnitude, level, ZERO, ZEROS
    x = point(g, 0)
    tenth = 0.1 * weight
    gradient = combined(level, x, -tenth, product(moment, x), 0.25 * dot(flux, x), total)
    return magnitude, level, gradient, times(tenth * dot(x, x), moment)


@inner_kernel
def set_fields(g, t, u, i):
    for d in range(3):
        constant = u[i, 0] * g[0, d] + u[i, 1] * g[1, d] + u[i, 2] * g[2, d] + u[i, 3] * g[3, d]
        for k in range(4):
            t[k, d] = constant
    for edge in range(6):
        p, q = corners_of_edge(edge)
        mode = 4.0 * u[i, 4 + edge]
        for d in range(3):
            t[p, d] += mode * g[q, d]
            t[q, d] += mode * g[p, d]


@inner_kernel
def sum_of_slopes(t):
    # S = sum T_k / 5
    return times(0.2, plus(plus(plus(point(t, 0), point(t, 1)), point(t, 2)), point(t, 3)))


@inner_kernel
def add_unknowns(block, i, weight, pull, flux, wanted):
    # Add the derivatives of an element by its unknowns.
    # `weight`, `pull` and `flux` are D times coefficient / 12, source / 24 and flux / 6.
    g, t, dof, products = block.slope, block.field, block.dof, block.product
    for j in range(4):
        for k in range(j + 1):
            products[j, k] = products[k, j] = dot(point(g, j), point(g, k))
    for own in range(10):
        row = dof[i, own]
        if row < 0:
            continue
        if own < 4:
            e = point(g, own)
            rest = 0.5 * weight * dot(e, sum_of_slopes(t)) - pull
        else:
            p, q = corners_of_edge(own - 4)
            e = plus(point(g, p), point(g, q))
            rest = dot(point(g, p), point(t, q)) + dot(point(g, q), point(t, p))
            rest = 0.4 * weight * rest - OF_EDGE * pull
        rest -= dot(flux, e)
        block.rest[row] += rest
        for other in range(own + 1):
            column = dof[i, other]
            if column >= 0:
                block.stiffness[max(row, column), min(row, column)] += weight * stiffness_of(products, own, other)
        if wanted == POSITION:
            add_mixed(block, row, own, weight, rest, flux)


@inner_kernel
def stiffness_of(product, own, other):
    if own < 4:
        return 2.0 * product[own, other]
    i, j = corners_of_edge(own - 4)
    if other < 4:
        return 2.0 * (product[i, other] + product[j, other])
    k, m = corners_of_edge(other - 4)
    total = product[j, m] + product[j, k] + product[i, m] + product[i, k]
    if i == k:
        total += product[j, m]
    if i == m:
        total += product[j, k]
    if j == k:
        total += product[i, m]
    if j == m:
        total += product[i, k]
    return 1.6 * total


@inner_kernel
def add_mixed(block, row, own, weight, rest, flux):
    g, t, products = block.slope, block.field, block.product
    x = point(block.slope, 0)
    along = dot(flux, x)
    if own < 4:
        e, s = point(g, own), sum_of_slopes(t)
        part = weighted(dot(s, x), e, products[own, 0], s)
        add_to(block.mixed, row, combined(rest, x, along, e, -0.5 * weight, part))
        return
    p, q = corners_of_edge(own - 4)
    at_p, at_q = point(t, p), point(t, q)
    part = combined(dot(at_q, x), point(g, p), dot(at_p, x), point(g, q), products[p, 0], at_q)
    part = plus_times(part, products[q, 0], at_p)
    add_to(block.mixed, row, combined(rest, x, along, plus(point(g, p), point(g, q)), -0.4 * weight, part))
