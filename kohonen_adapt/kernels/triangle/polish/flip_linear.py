"""Edge flips that decrease functionals of P1 functions."""

import numpy as np

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import CONSTANTS, HALF_COEFFICIENT, SIXTH_SOURCE
from kohonen_adapt.kernels.triangle.flip import flip_edge, mark_neighbours, may_flip
from kohonen_adapt.kernels.triangle.geometry import corners_around
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.varying import flux_term


@kernel
def descend_flips(position, elements, trials, floor, gainful, first, last, marks):
    """Flip edges of the elements `first` to `last` if the functional falls.

    Only elements marked in `gainful`, shape (m,), are visited, and every flip marks the neighbours. If `marks`, no
    edge is flipped, and elements are marked whose edge to an element of greater index is gainful. Return the gain and
    the number of flips.
    """
    gain, flips = 0.0, 0
    for e in range(first, last):
        gainful[e] &= not marks
        for k in range(3):
            other = np.int64(elements.neighbour[e, k])
            if gainful[e] == marks or other < e or elements.chain[e, k] >= 0:
                continue
            decrease = gain_of_flip(position, elements.node, trials, e, k, other)
            if marks:
                gainful[e] = decrease > 0.0
            elif decrease > 0.0 and may_flip(position, elements, e, k, other, floor):
                flip_edge(elements, e, k)
                gain += decrease
                flips += 1
                mark_neighbours(elements, e, gainful)
                mark_neighbours(elements, other, gainful)
    return gain, flips


@inner_kernel
def gain_of_flip(position, node, trials, e, k, other):
    gain, magnitude = change_by_flip(position, node, trials.primal, e, k, other)
    if trials.dual.value.shape[0] > 0:
        dual_gain, dual_magnitude = change_by_flip(position, node, trials.dual, e, k, other)
        gain, magnitude = gain + dual_gain, magnitude + dual_magnitude
    return gain if gain > ROUNDING * magnitude else 0.0


@inner_kernel
def change_by_flip(position, node, trial, e, k, other):
    value, data, laws = trial.value, trial.data, trial.laws
    p, q, r, s = corners_around(node, e, k, other)
    x, y, own = position[r, 0], position[r, 1], value[r]
    px, py, u = position[p, 0] - x, position[p, 1] - y, value[p] - own
    qx, qy, v = position[q, 0] - x, position[q, 1] - y, value[q] - own
    sx, sy, w = position[s, 0] - x, position[s, 1] - y, value[s] - own
    coefficient, load = 2.0 * data[e, HALF_COEFFICIENT], data[e, SIXTH_SOURCE]
    law = laws.number[e]
    if law >= 0:
        coefficient, before = 1.0, law_energy(laws, law, px, py, u, qx, qy, v)
        before += law_energy(laws, law, qx - sx, qy - sy, v - w, px - sx, py - sy, u - w)
        after = law_energy(laws, law, px, py, u, sx, sy, w) + law_energy(laws, law, sx, sy, w, qx, qy, v)
    else:
        before = dirichlet_energy(px, py, u, qx, qy, v) + dirichlet_energy(
            qx - sx, qy - sy, v - w, px - sx, py - sy, u - w
        )
        after = dirichlet_energy(px, py, u, sx, sy, w) + dirichlet_energy(sx, sy, w, qx, qy, v)
    inner, outer = px * qy - py * qx, (qx - sx) * (py - sy) - (qy - sy) * (px - sx)
    left, right = px * sy - py * sx, sx * qy - sy * qx
    if not (left > 0.0 and right > 0.0):
        return 0.0, 0.0
    pulled = load * (left * (u + w) + right * (w + v) - inner * (u + v) - outer * (u + v + w))
    gain = coefficient * (before - after) + pulled
    # Constant fluxes contribute equally before and after: the boundary of the pair determines the mean gradient.
    if data.shape[1] > CONSTANTS:
        gain += flux_term(data, e, x, y, px, py, u, sx, sy, w) + flux_term(data, e, x, y, sx, sy, w, qx, qy, v)
        gain -= flux_term(data, e, x, y, px, py, u, qx, qy, v)
        gain -= flux_term(data, e, x + sx, y + sy, qx - sx, qy - sy, v - w, px - sx, py - sy, u - w)
    return gain, coefficient * (before + after) + abs(load) * (inner + outer) * (abs(u) + abs(v) + abs(w))


@inner_kernel
def dirichlet_energy(ax, ay, u, bx, by, v):
    """Return int |grad|^2 / 2 over (0, a, b) for the nodal values 0, u, v."""
    nx, ny = v * ax - u * bx, v * ay - u * by
    return 0.25 * (nx * nx + ny * ny) / (ax * by - ay * bx)


@inner_kernel
def law_energy(laws, law, ax, ay, u, bx, by, v):
    nx, ny, doubled = v * ax - u * bx, v * ay - u * by, ax * by - ay * bx
    return 0.5 * doubled * energy_density(laws, law, (nx * nx + ny * ny) / (doubled * doubled))[0]
