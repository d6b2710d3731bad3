"""Ritz functional of a P1 function on tetrahedra.

An element (a, b, c, d) with six times the volume D has, for int c/2 |grad u|^2 - f u - g . grad u,

    c |n|^2 / (12 D) - f D (u_a + u_b + u_c + u_d) / 24 - g . n / 6,    n = al BxC + be CxA + ga AxB,

with A, B, C the vectors from a to the remaining nodes, and al, be, ga the differences of their values, so
that grad u = n / D. Nonlinear material has D W(|grad u - s|^2) / 6 instead of the first term, where the shift s
replaces n by n - D s. In reduced regions u is the value of a node minus its offset.

If f varies inside regions, all elements removed and inserted by a change have one f per region, the weighted
mean around the node or the edge that changes. The error is of first order in the size of the elements,
because only the change of u is multiplied by the error of f. One f per element would add the volume swept by
faces times the jump of f, which is not smaller than the gain.
"""

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import (
    OFFSET,
    REDUCED,
    SHIFT_X,
    SHIFT_Y,
    SHIFT_Z,
    SIXTH_FLUX_X,
    SIXTH_FLUX_Y,
    SIXTH_FLUX_Z,
    SOURCE_24TH,
    TWELFTH_COEFFICIENT,
)

ROUNDING = 1e-13  # smallest gain, relative to the sum of magnitudes


@inner_kernel
def source_around(trial, region, v):
    if trial.source.shape[0] > 0:
        return trial.source[v, region]
    return trial.data[region, SOURCE_24TH]


@inner_kernel
def source_along(trial, region, a, b):
    if trial.source.shape[0] > 0:
        return 0.5 * (trial.source[a, region] + trial.source[b, region])
    return trial.data[region, SOURCE_24TH]


@inner_kernel
def value_at(trial, region, node):
    if trial.surface.shape[0] > 0:
        return trial.value[node] - trial.data[region, REDUCED] * trial.surface[node, OFFSET]
    return trial.value[node]


@inner_kernel
def shifted(trial, region, six, nx, ny, nz):
    if trial.laws.number[region] < 0:
        return nx, ny, nz
    data = trial.data
    return nx - six * data[region, SHIFT_X], ny - six * data[region, SHIFT_Y], nz - six * data[region, SHIFT_Z]


@inner_kernel
def element_energy(position, trial, region, load, a, b, c, d):
    """Return the functional of an element, and the sum of magnitudes of its terms.

    `load` is a 24th of the source.
    """
    data, at_a, at_b = trial.data, value_at(trial, region, a), value_at(trial, region, b)
    at_c, at_d = value_at(trial, region, c), value_at(trial, region, d)
    ax, ay, az = position[a, 0], position[a, 1], position[a, 2]
    ux, uy, uz = position[b, 0] - ax, position[b, 1] - ay, position[b, 2] - az
    vx, vy, vz = position[c, 0] - ax, position[c, 1] - ay, position[c, 2] - az
    wx, wy, wz = position[d, 0] - ax, position[d, 1] - ay, position[d, 2] - az
    alpha, beta, gamma = at_b - at_a, at_c - at_a, at_d - at_a
    px, py, pz = vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx
    qx, qy, qz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    rx, ry, rz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    six = ux * px + uy * py + uz * pz
    nx = alpha * px + beta * qx + gamma * rx
    ny = alpha * py + beta * qy + gamma * ry
    nz = alpha * pz + beta * qz + gamma * rz
    energy = stored_in(trial, region, six, nx, ny, nz)
    pull = load * six * (at_a + at_b + at_c + at_d)
    push = data[region, SIXTH_FLUX_X] * nx + data[region, SIXTH_FLUX_Y] * ny + data[region, SIXTH_FLUX_Z] * nz
    return energy - pull - push, energy + abs(pull) + abs(push)


@inner_kernel
def stored_in(trial, region, six, nx, ny, nz):
    nx, ny, nz = shifted(trial, region, six, nx, ny, nz)
    law, square = trial.laws.number[region], nx * nx + ny * ny + nz * nz
    if law >= 0:
        return six * energy_density(trial.laws, law, square / (six * six))[0] / 6.0
    return trial.data[region, TWELFTH_COEFFICIENT] * square / six


@inner_kernel
def triangle_tilts(trial, region, vectors, p, q, r):
    """Return the part of n of a triangle, its first value, and the sum of its values.

    The part be U - al V is the same for all tetrahedra on the triangle, with U and V of `triangle_vectors`.
    """
    (ux, uy, uz), (vx, vy, vz), _, _ = vectors
    at_p, at_q, at_r = value_at(trial, region, p), value_at(trial, region, q), value_at(trial, region, r)
    alpha, beta = at_q - at_p, at_r - at_p
    tilt = beta * ux - alpha * vx, beta * uy - alpha * vy, beta * uz - alpha * vz
    return tilt, at_p, at_p + at_q + at_r


@inner_kernel
def energy_on(trial, region, load, vectors, tilts, to_node, value, side):
    """Return the functional of the tetrahedron of a triangle and a node.

    The node has a value and the vector `to_node` W from the first node of the triangle, which gives n = W x (be U -
    al V) + ga U x V. `side` is 1 if U x V points to the node, otherwise -1.
    """
    (tx, ty, tz), at_first, values = tilts
    wx, wy, wz = to_node
    _, _, (px, py, pz), _ = vectors
    data, gamma = trial.data, value - at_first
    nx, ny, nz = wy * tz - wz * ty + gamma * px, wz * tx - wx * tz + gamma * py, wx * ty - wy * tx + gamma * pz
    six = side * (wx * px + wy * py + wz * pz)
    push = data[region, SIXTH_FLUX_X] * nx + data[region, SIXTH_FLUX_Y] * ny + data[region, SIXTH_FLUX_Z] * nz
    energy = stored_in(trial, region, six, side * nx, side * ny, side * nz)
    return energy - load * six * (values + value) - side * push
