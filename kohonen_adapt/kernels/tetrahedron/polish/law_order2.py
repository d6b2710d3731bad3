"""Functional of a nonlinear law at order 2 on tetrahedra, by quadrature.

With the field c_k at corner k, grad u = sum L_k c_k at a point. A function has the gradient e = sum L_a v_a there, with
v_a = g_i for corner i, and v_p = 4 g_q, v_q = 4 g_p for edge pq. With r = grad u - s, h = dW/d(grad u) - flux and the
second derivative M of W, and with all coefficients fixed, the derivatives by corner 0 and by a coefficient are

    E_d = int (W - flux . grad u) g_0 - (h . g_0) grad u,    E_dd = int (g_0 . M g_0) grad u grad u^T,
    E_i = int h . e,    E_ij = int e_i . M e_j,    E_id = int (h . e) g_0 - (h . g_0) e - (e . M g_0) grad u.

The integrals of L_a h, L_a L_b M and L_a (M g_0) grad u^T serve all functions, which keeps the many points of a law
cheap. Corners are in the order of their nodes, so that the functional of an element does not depend on its rotation.
"""

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
    VALUE,
)
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES

OF_EDGE = 0.8  # ratio of the integrals of edge and corner functions


@inner_kernel
def rank(node, b, c, d):
    return (1 if b < node else 0) + (1 if c < node else 0) + (1 if d < node else 0)


@inner_kernel
def clear_moments(block):
    block.force[:] = 0.0
    block.curvature[:] = 0.0
    block.turn[:] = 0.0


@inner_kernel
def add_by_law(trial, block, i, region, load, six, corners, wanted):
    # Add the derivatives of an element with a law to the block, and return the results of `add_element`.
    # `block.slope` and `block.field` are the gradients of the barycentric coordinates, and grad u at the corners.
    g, t, u, data, law = block.slope, block.field, block.local, trial.data, trial.laws.number[region]
    a, b, c, d = corners
    at_a, at_b, at_c, at_d = rank(a, b, c, d), rank(b, a, c, d), rank(c, a, b, d), rank(d, a, b, c)
    sx, sy, sz = data[region, SHIFT_X], data[region, SHIFT_Y], data[region, SHIFT_Z]
    fx, fy, fz = 6.0 * data[region, SIXTH_FLUX_X], 6.0 * data[region, SIXTH_FLUX_Y], 6.0 * data[region, SIXTH_FLUX_Z]
    x, y, z = g[0, 0], g[0, 1], g[0, 2]
    energy = push = by_x = by_y = by_z = xx = xy = xz = yy = yz = zz = 0.0
    if wanted > VALUE:
        clear_moments(block)
    for q in range(block.weight.shape[0]):
        at = block.point[q, at_a], block.point[q, at_b], block.point[q, at_c], block.point[q, at_d]
        px = at[0] * t[0, 0] + at[1] * t[1, 0] + at[2] * t[2, 0] + at[3] * t[3, 0]
        py = at[0] * t[0, 1] + at[1] * t[1, 1] + at[2] * t[2, 1] + at[3] * t[3, 1]
        pz = at[0] * t[0, 2] + at[1] * t[1, 2] + at[2] * t[2, 2] + at[3] * t[3, 2]
        rx, ry, rz = px - sx, py - sy, pz - sz
        w = six / 6.0 * block.weight[q]
        density, rate, curve = energy_density(trial.laws, law, rx * rx + ry * ry + rz * rz)
        along = fx * px + fy * py + fz * pz
        energy, push = energy + w * density, push + w * along
        if wanted == VALUE:
            continue
        first, second = 2.0 * w * rate, 4.0 * w * curve
        h = first * rx - w * fx, first * ry - w * fy, first * rz - w * fz
        m = (
            first + second * rx * rx,
            second * rx * ry,
            second * rx * rz,
            first + second * ry * ry,
            second * ry * rz,
            first + second * rz * rz,
        )
        add_moments(block, at, h, m)
        if wanted < POSITION:
            continue
        ux, uy, uz = m[0] * x + m[1] * y + m[2] * z, m[1] * x + m[3] * y + m[4] * z, m[2] * x + m[4] * y + m[5] * z
        own, across, second_own = w * (density - along), h[0] * x + h[1] * y + h[2] * z, ux * x + uy * y + uz * z
        by_x, by_y, by_z = by_x + own * x - across * px, by_y + own * y - across * py, by_z + own * z - across * pz
        xx, xy, xz = xx + second_own * px * px, xy + second_own * px * py, xz + second_own * px * pz
        yy, yz, zz = yy + second_own * py * py, yz + second_own * py * pz, zz + second_own * pz * pz
        add_turn(block, at, (ux, uy, uz), (px, py, pz))
    pull = load * six
    pulled = u[i, 0] + u[i, 1] + u[i, 2] + u[i, 3]
    pulled = pull * (pulled + OF_EDGE * (u[i, 4] + u[i, 5] + u[i, 6] + u[i, 7] + u[i, 8] + u[i, 9]))
    if wanted > VALUE:
        add_moments_to_unknowns(block, i, pull, wanted)
    magnitude, total = energy + abs(pulled) + abs(push), energy - pulled - push
    if wanted == POSITION:
        by_x, by_y, by_z = by_x - pulled * x, by_y - pulled * y, by_z - pulled * z
    return magnitude, total, (by_x, by_y, by_z), (xx, xy, xz, yy, yz, zz)


@inner_kernel
def add_moments(block, at, h, m):
    for a in range(4):
        for d in range(3):
            block.force[a, d] += at[a] * h[d]
        for b in range(a + 1):
            product = at[a] * at[b]
            for k in range(6):
                block.curvature[a, b, k] += product * m[k]


@inner_kernel
def add_turn(block, at, vector, field):
    for a in range(4):
        for j in range(3):
            part = at[a] * vector[j]
            for k in range(3):
                block.turn[a, j, k] += part * field[k]


@inner_kernel
def add_moments_to_unknowns(block, i, pull, wanted):
    g, dof, force, applied = block.slope, block.dof, block.force, block.applied
    for own in range(10):
        row = dof[i, own]
        if row < 0:
            continue
        applied[:] = 0.0
        rest = -pull if own < 4 else -OF_EDGE * pull
        for a in range(4):
            vx, vy, vz = corner_slope(g, own, a)
            rest += force[a, 0] * vx + force[a, 1] * vy + force[a, 2] * vz
            apply_curvature(block, a, vx, vy, vz)
        block.rest[row] += rest
        for other in range(own + 1):
            column, product = dof[i, other], 0.0
            if column < 0:
                continue
            for b in range(4):
                vx, vy, vz = corner_slope(g, other, b)
                product += applied[b, 0] * vx + applied[b, 1] * vy + applied[b, 2] * vz
            block.stiffness[max(row, column), min(row, column)] += product
        if wanted == POSITION:
            add_mixed_by_law(block, row, own, rest)


@inner_kernel
def corner_slope(g, own, a):
    # Return the gradient of a function at corner a.
    if own < 4:
        return g[own, 0], g[own, 1], g[own, 2]
    p, q = EDGES[own - 4, 0], EDGES[own - 4, 1]
    if a == p:
        return 4.0 * g[q, 0], 4.0 * g[q, 1], 4.0 * g[q, 2]
    if a == q:
        return 4.0 * g[p, 0], 4.0 * g[p, 1], 4.0 * g[p, 2]
    return 0.0, 0.0, 0.0


@inner_kernel
def apply_curvature(block, a, x, y, z):
    applied, m = block.applied, block.curvature
    if x == 0.0 and y == 0.0 and z == 0.0:
        return
    for b in range(4):
        i, j = max(a, b), min(a, b)
        xy, xz, yz = m[i, j, 1], m[i, j, 2], m[i, j, 4]
        applied[b, 0] += m[i, j, 0] * x + xy * y + xz * z
        applied[b, 1] += xy * x + m[i, j, 3] * y + yz * z
        applied[b, 2] += xz * x + yz * y + m[i, j, 5] * z


@inner_kernel
def add_mixed_by_law(block, row, own, rest):
    g, force, turn, mixed = block.slope, block.force, block.turn, block.mixed
    for d in range(3):
        mixed[row, d] += rest * g[0, d]
    for a in range(4):
        x, y, z = corner_slope(g, own, a)
        across = force[a, 0] * g[0, 0] + force[a, 1] * g[0, 1] + force[a, 2] * g[0, 2]
        mixed[row, 0] -= across * x + x * turn[a, 0, 0] + y * turn[a, 1, 0] + z * turn[a, 2, 0]
        mixed[row, 1] -= across * y + x * turn[a, 0, 1] + y * turn[a, 1, 1] + z * turn[a, 2, 1]
        mixed[row, 2] -= across * z + x * turn[a, 0, 2] + y * turn[a, 1, 2] + z * turn[a, 2, 2]
