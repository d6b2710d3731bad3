"""Ritz functional of a P2 function on tetrahedra, with derivatives.

With the gradients g_k of the barycentric coordinates, the gradient of u is linear in an element, c_k at corner k. With
S = sum c_k, T_k = S + c_k and six times the volume D,

    int |grad u|^2 = D (|S|^2 + sum |c_k|^2) / 120,    int L_k grad u = D T_k / 120,    int grad u = D S / 24.

The function 4 L_i L_j of an edge has the gradient 4 (L_i g_j + L_j g_i) and the integral D / 30, so all derivatives by
coefficients follow without quadrature. If corner 0 moves by d and all coefficients are fixed, D changes by the factor
1 + s with s = g_0 . d, and with P = int grad u grad u^T / D

    E(d) = c D / 2 ((1 + s) tr P - 2 g_0 . P d + |g_0|^2 d . P d / (1 + s)) - (source and flux, linear in d),

so the second derivative c D |g_0|^2 P is never negative. Derivatives of order 1 in `descend.py` are those of constant
gradients. `law_order2` has nonlinear laws, `curved_order2` slivers at curved surfaces.
"""

import numpy as np

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import (
    POSITION,
    SHIFT_X,
    SHIFT_Y,
    SHIFT_Z,
    SIXTH_FLUX_X,
    SIXTH_FLUX_Y,
    SIXTH_FLUX_Z,
    TWELFTH_COEFFICIENT,
    VALUE,
)
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, set_slopes
from kohonen_adapt.kernels.tetrahedron.polish.law_order2 import OF_EDGE, add_by_law, rank
from kohonen_adapt.kernels.triangle.polish.by_points import MIN_JACOBIAN


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
        p, q = EDGES[k, 0], EDGES[k, 1]
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
    g, gradient, u = block.slope, block.gradient, block.local
    value = px = py = pz = 0.0
    for k in range(10):
        if k < 4:
            size = at[k]
            for d in range(3):
                gradient[k, d] = g[k, d]
        else:
            p, q = EDGES[k - 4, 0], EDGES[k - 4, 1]
            size = 4.0 * at[p] * at[q]
            for d in range(3):
                gradient[k, d] = 4.0 * (at[p] * g[q, d] + at[q] * g[p, d])
        value += u[i, k] * size
        px, py, pz = px + u[i, k] * gradient[k, 0], py + u[i, k] * gradient[k, 1], pz + u[i, k] * gradient[k, 2]
    return value, (px, py, pz)


@inner_kernel
def times(m, x, y, z):
    return m[0] * x + m[1] * y + m[2] * z, m[1] * x + m[3] * y + m[4] * z, m[2] * x + m[4] * y + m[5] * z


@inner_kernel
def add_unknowns_at(block, i, at, h, m, pull, field, wanted):
    # `pull` is the source times the volume of the point.
    gradient, dof, (x, y, z) = block.gradient, block.dof, block.slope[0]
    across, turned = h[0] * x + h[1] * y + h[2] * z, times(m, x, y, z)
    for own in range(10):
        row = dof[i, own]
        if row < 0:
            continue
        size = at[own] if own < 4 else 4.0 * at[EDGES[own - 4, 0]] * at[EDGES[own - 4, 1]]
        ex, ey, ez = gradient[own, 0], gradient[own, 1], gradient[own, 2]
        rest = h[0] * ex + h[1] * ey + h[2] * ez - pull * size
        block.rest[row] += rest
        tx, ty, tz = times(m, ex, ey, ez)
        for other in range(own + 1):
            column = dof[i, other]
            if column >= 0:
                product = tx * gradient[other, 0] + ty * gradient[other, 1] + tz * gradient[other, 2]
                block.stiffness[max(row, column), min(row, column)] += product
        if wanted == POSITION:
            turn = ex * turned[0] + ey * turned[1] + ez * turned[2]
            for d in range(3):
                part = rest * block.slope[0, d] - across * gradient[own, d] - turn * field[d]
                block.mixed[row, d] += part


@inner_kernel
def density_at(trial, region, x, y, z):
    # Return the energy density at a gradient less the shift, and its derivatives by the square.
    law = trial.laws.number[region]
    if law >= 0:
        return energy_density(trial.laws, law, x * x + y * y + z * z)
    half = 6.0 * trial.data[region, TWELFTH_COEFFICIENT]
    return half * (x * x + y * y + z * z), half, 0.0


@inner_kernel
def add_curved(position, trial, block, i, region, load, corners, wanted):
    # Add the derivatives of an element with `block.offset` to the block, and return the results of `add_element`.
    data, has_law = trial.data, trial.laws.number[region] >= 0
    energy = push = pulled = by_x = by_y = by_z = xx = xy = xz = yy = yz = zz = 0.0
    if is_folded(position, block, corners):
        return 0.0, np.inf, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    a, b, c, d = corners
    ranks = rank(a, b, c, d), rank(b, a, c, d), rank(c, a, b, d), rank(d, a, b, c)
    shift = 1.0 if has_law else 0.0
    sx, sy, sz = shift * data[region, SHIFT_X], shift * data[region, SHIFT_Y], shift * data[region, SHIFT_Z]
    fx, fy, fz = 6.0 * data[region, SIXTH_FLUX_X], 6.0 * data[region, SIXTH_FLUX_Y], 6.0 * data[region, SIXTH_FLUX_Z]
    points, weights = (block.point, block.weight) if has_law else (block.curve_point, block.curve_weight)
    for q in range(weights.shape[0]):
        at = points[q, ranks[0]], points[q, ranks[1]], points[q, ranks[2]], points[q, ranks[3]]
        w = slopes_at(position, block, corners, at) / 6.0 * weights[q]
        value, (px, py, pz) = set_functions(block, i, at)
        rx, ry, rz = px - sx, py - sy, pz - sz
        density, rate, curve = density_at(trial, region, rx, ry, rz)
        along, source = fx * px + fy * py + fz * pz, 24.0 * load * value
        energy, push, pulled = energy + w * density, push + w * along, pulled + w * source
        if wanted == VALUE:
            continue
        first, second = 2.0 * w * rate, 4.0 * w * curve
        h = first * rx - w * fx, first * ry - w * fy, first * rz - w * fz
        mixed = second * rx * ry, second * rx * rz, second * ry * rz
        m = first + second * rx * rx, mixed[0], mixed[1], first + second * ry * ry, mixed[2], first + second * rz * rz
        add_unknowns_at(block, i, at, h, m, 24.0 * load * w, (px, py, pz), wanted)
        if wanted < POSITION:
            continue
        x, y, z = block.slope[0, 0], block.slope[0, 1], block.slope[0, 2]
        ux, uy, uz = times(m, x, y, z)
        own, across, square = w * (density - along - source), h[0] * x + h[1] * y + h[2] * z, ux * x + uy * y + uz * z
        by_x, by_y, by_z = by_x + own * x - across * px, by_y + own * y - across * py, by_z + own * z - across * pz
        xx, xy, xz = xx + square * px * px, xy + square * px * py, xz + square * px * pz
        yy, yz, zz = yy + square * py * py, yz + square * py * pz, zz + square * pz * pz
    magnitude, total = energy + abs(pulled) + abs(push), energy - pulled - push
    return magnitude, total, (by_x, by_y, by_z), (xx, xy, xz, yy, yz, zz)


@inner_kernel
def clear(block, count):
    block.unknowns[0] = count
    for i in range(count):
        block.rest[i] = block.mixed[i, 0] = block.mixed[i, 1] = block.mixed[i, 2] = 0.0
        for j in range(i + 1):
            block.stiffness[i, j] = 0.0


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
    g, t, u, data = block.slope, block.field, block.local, trial.data
    if block.curve_end.shape[0] > 0 and set_offsets(block, corners):
        return add_curved(position, trial, block, i, region, load, corners, wanted)
    six = set_slopes(position, g, *corners)
    set_fields(g, t, u, i)
    if trial.laws.number[region] >= 0:
        return add_by_law(trial, block, i, region, load, six, corners, wanted)
    xx = xy = xz = yy = yz = zz = sx = sy = sz = 0.0
    for k in range(4):
        x, y, z = t[k, 0], t[k, 1], t[k, 2]
        sx, sy, sz = sx + x, sy + y, sz + z
        xx, xy, xz, yy, yz, zz = xx + x * x, xy + x * y, xz + x * z, yy + y * y, yz + y * z, zz + z * z
    xx, xy, xz, yy, yz, zz = xx + sx * sx, xy + sx * sy, xz + sx * sz, yy + sy * sy, yz + sy * sz, zz + sz * sz
    for k in range(4):
        t[k, 0], t[k, 1], t[k, 2] = t[k, 0] + sx, t[k, 1] + sy, t[k, 2] + sz
    edges = u[i, 4] + u[i, 5] + u[i, 6] + u[i, 7] + u[i, 8] + u[i, 9]
    weight, pull = six * data[region, TWELFTH_COEFFICIENT], load * six
    fx, fy, fz = six * data[region, SIXTH_FLUX_X], six * data[region, SIXTH_FLUX_Y], six * data[region, SIXTH_FLUX_Z]
    energy = 0.05 * weight * (xx + yy + zz)
    pulled = pull * (u[i, 0] + u[i, 1] + u[i, 2] + u[i, 3] + OF_EDGE * edges)
    push = 0.25 * (fx * sx + fy * sy + fz * sz)
    if wanted > VALUE:
        add_unknowns(block, i, weight, pull, fx, fy, fz, wanted)
    magnitude, total = energy + abs(pulled) + abs(push), energy - pulled - push
    if wanted < POSITION:
        return magnitude, total, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    x, y, z = g[0, 0], g[0, 1], g[0, 2]
    tenth, along = 0.1 * weight, 0.25 * (fx * x + fy * y + fz * z)
    by_x = total * x - tenth * (xx * x + xy * y + xz * z) + along * sx
    by_y = total * y - tenth * (xy * x + yy * y + yz * z) + along * sy
    by_z = total * z - tenth * (xz * x + yz * y + zz * z) + along * sz
    tenth *= x * x + y * y + z * z
    hessian = tenth * xx, tenth * xy, tenth * xz, tenth * yy, tenth * yz, tenth * zz
    return magnitude, total, (by_x, by_y, by_z), hessian


@inner_kernel
def set_fields(g, t, u, i):
    for d in range(3):
        constant = u[i, 0] * g[0, d] + u[i, 1] * g[1, d] + u[i, 2] * g[2, d] + u[i, 3] * g[3, d]
        for k in range(4):
            t[k, d] = constant
    for edge in range(6):
        p, q, mode = EDGES[edge, 0], EDGES[edge, 1], 4.0 * u[i, 4 + edge]
        for d in range(3):
            t[p, d] += mode * g[q, d]
            t[q, d] += mode * g[p, d]


@inner_kernel
def sum_of_slopes(t):
    x, y = t[0, 0] + t[1, 0] + t[2, 0] + t[3, 0], t[0, 1] + t[1, 1] + t[2, 1] + t[3, 1]
    z = t[0, 2] + t[1, 2] + t[2, 2] + t[3, 2]
    return 0.2 * x, 0.2 * y, 0.2 * z  # S = sum T_k / 5


@inner_kernel
def add_unknowns(block, i, weight, pull, fx, fy, fz, wanted):
    # Add the derivatives of an element by its unknowns.
    # `weight`, `pull` and (`fx`, `fy`, `fz`) are D times coefficient / 12, source / 24 and flux / 6.
    g, t, dof, product = block.slope, block.field, block.dof, block.product
    for j in range(4):
        for k in range(j + 1):
            product[j, k] = product[k, j] = g[j, 0] * g[k, 0] + g[j, 1] * g[k, 1] + g[j, 2] * g[k, 2]
    for own in range(10):
        row = dof[i, own]
        if row < 0:
            continue
        if own < 4:
            x, y, z = sum_of_slopes(t)
            ex, ey, ez = g[own, 0], g[own, 1], g[own, 2]
            rest = 0.5 * weight * (ex * x + ey * y + ez * z) - pull
        else:
            p, q = EDGES[own - 4, 0], EDGES[own - 4, 1]
            ex, ey, ez = g[p, 0] + g[q, 0], g[p, 1] + g[q, 1], g[p, 2] + g[q, 2]
            rest = g[p, 0] * t[q, 0] + g[p, 1] * t[q, 1] + g[p, 2] * t[q, 2]
            rest += g[q, 0] * t[p, 0] + g[q, 1] * t[p, 1] + g[q, 2] * t[p, 2]
            rest = 0.4 * weight * rest - OF_EDGE * pull
        rest -= fx * ex + fy * ey + fz * ez
        block.rest[row] += rest
        for other in range(own + 1):
            column = dof[i, other]
            if column >= 0:
                block.stiffness[max(row, column), min(row, column)] += weight * stiffness_of(product, own, other)
        if wanted == POSITION:
            add_mixed(block, row, own, weight, rest, fx, fy, fz)


@inner_kernel
def stiffness_of(product, own, other):
    if own < 4:
        return 2.0 * product[own, other]
    i, j = EDGES[own - 4, 0], EDGES[own - 4, 1]
    if other < 4:
        return 2.0 * (product[i, other] + product[j, other])
    k, m = EDGES[other - 4, 0], EDGES[other - 4, 1]
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
def add_mixed(block, row, own, weight, rest, fx, fy, fz):
    g, t, product, mixed = block.slope, block.field, block.product, block.mixed
    x, y, z = g[0, 0], g[0, 1], g[0, 2]
    along = fx * x + fy * y + fz * z
    if own < 4:
        sx, sy, sz = sum_of_slopes(t)
        half, inner, turn = 0.5 * weight, sx * x + sy * y + sz * z, product[own, 0]
        mixed[row, 0] += rest * x + along * g[own, 0] - half * (inner * g[own, 0] + turn * sx)
        mixed[row, 1] += rest * y + along * g[own, 1] - half * (inner * g[own, 1] + turn * sy)
        mixed[row, 2] += rest * z + along * g[own, 2] - half * (inner * g[own, 2] + turn * sz)
        return
    p, q = EDGES[own - 4, 0], EDGES[own - 4, 1]
    on_p, on_q = t[p, 0] * x + t[p, 1] * y + t[p, 2] * z, t[q, 0] * x + t[q, 1] * y + t[q, 2] * z
    for d in range(3):
        part = on_q * g[p, d] + on_p * g[q, d] + product[p, 0] * t[q, d] + product[q, 0] * t[p, d]
        mixed[row, d] += rest * g[0, d] + along * (g[p, d] + g[q, d]) - 0.4 * weight * part
