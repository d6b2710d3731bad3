"""Functional of a tetrahedron with curved edges at order 2, by quadrature.

At a point the map of the element has the derivatives of a straight tetrahedron, whose corners move with the corners of
the element (`tangent_corners`). The derivatives of the functional are those of `law_order2`, with the slopes and the
volume of the point. The functional of an element that nearly folds is infinite.
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
from kohonen_adapt.kernels.tetrahedron.polish.law_order2 import rank
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
