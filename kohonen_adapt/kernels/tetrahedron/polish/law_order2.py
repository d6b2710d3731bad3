"""Functional of a nonlinear law at order 2 on tetrahedra, by quadrature.

With the field c_k at corner k, grad u = sum L_k c_k at a point. A function has the gradient e = sum L_a v_a there, with
v_a = g_i for corner i, and v_p = 4 g_q, v_q = 4 g_p for edge pq. With r = grad u - s, h = dW/d(grad u) - flux and the
second derivative M of W, and with all coefficients fixed, the derivatives by corner 0 and by a coefficient are

    E_d = int (W - flux . grad u) g_0 - (h . g_0) grad u,    E_dd = int (g_0 . M g_0) grad u grad u^T,
    E_i = int h . e,    E_ij = int e_i . M e_j,    E_id = int (h . e) g_0 - (h . g_0) e - (e . M g_0) grad u.

The integrals of L_a h, L_a L_b M and L_a (M g_0) grad u^T serve all functions, which keeps the many points of a law
cheap. Corners are in the order of their nodes, so that the functional of an element does not depend on its rotation.
"""

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import POSITION
from kohonen_adapt.kernels.tetrahedron.geometry import corners_of_edge
from kohonen_adapt.kernels.vectors import (
    ZERO,
    add_to,
    combined,
    dot,
    matrix,
    plus_square,
    plus_times,
    point,
    product,
    times,
    weighted,
)

OF_EDGE = 0.8  # ratio of the integrals of edge and corner functions


@inner_kernel
def rank(node, b, c, d):
    return (1 if b < node else 0) + (1 if c < node else 0) + (1 if d < node else 0)


@inner_kernel
def force_and_curvature(weight, rate, curve, r, flux):
    """Return h and M times a weight, by the derivatives of the density by |r|^2."""
    first = 2.0 * weight * rate
    isotropic = first, 0.0, 0.0, first, 0.0, first
    return weighted(first, r, -weight, flux), plus_square(isotropic, 4.0 * weight * curve, r)


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
            v = corner_slope(g, own, a)
            rest += dot(point(force, a), v)
            apply_curvature(block, a, v)
        block.rest[row] += rest
        for other in range(own + 1):
            column = dof[i, other]
            total = 0.0
            if column < 0:
                continue
            for b in range(4):
                total += dot(point(applied, b), corner_slope(g, other, b))
            block.stiffness[max(row, column), min(row, column)] += total
        if wanted == POSITION:
            add_mixed_by_law(block, row, own, rest)


@inner_kernel
def corner_slope(g, own, a):
    # Return the gradient of a function at corner a.
    if own < 4:
        return point(g, own)
    p, q = corners_of_edge(own - 4)
    if a == p:
        return times(4.0, point(g, q))
    return times(4.0, point(g, p)) if a == q else ZERO


@inner_kernel
def apply_curvature(block, a, x):
    if x[0] == 0.0 and x[1] == 0.0 and x[2] == 0.0:
        return
    for b in range(4):
        add_to(block.applied, b, product(matrix(block.curvature[max(a, b)], min(a, b)), x))


@inner_kernel
def add_mixed_by_law(block, row, own, rest):
    g, mixed = block.slope, block.mixed
    add_to(mixed, row, times(rest, point(g, 0)))
    for a in range(4):
        v = corner_slope(g, own, a)
        turn = block.turn[a]
        across = dot(point(block.force, a), point(g, 0))
        part = combined(across, v, v[0], point(turn, 0), v[1], point(turn, 1))
        add_to(mixed, row, times(-1.0, plus_times(part, v[2], point(turn, 2))))
