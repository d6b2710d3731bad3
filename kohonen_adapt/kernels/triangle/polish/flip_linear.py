"""Edge flips that decrease functionals of P1 functions."""

import numpy as np

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.arrays import CONSTANTS, HALF_COEFFICIENT, SIXTH_SOURCE
from kohonen_adapt.kernels.triangle.flip import flip_edge, mark_neighbours, may_flip
from kohonen_adapt.kernels.triangle.geometry import corners_around
from kohonen_adapt.kernels.triangle.polish.descend import ROUNDING
from kohonen_adapt.kernels.triangle.polish.varying import flux_term
from kohonen_adapt.kernels.vectors import cross, dot, from_to, minus, plus, weighted, xy


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
    x = xy(position, r)
    own, law = value[r], laws.number[e]
    at_p, at_q, at_s = from_to(x, position, p), from_to(x, position, q), from_to(x, position, s)
    u, v, w = value[p] - own, value[q] - own, value[s] - own
    s_to_p, s_to_q = minus(at_p, at_s), minus(at_q, at_s)
    coefficient, load = 2.0 * data[e, HALF_COEFFICIENT], data[e, SIXTH_SOURCE]
    if law >= 0:
        coefficient, before = 1.0, law_energy(laws, law, at_p, u, at_q, v)
        before += law_energy(laws, law, s_to_q, v - w, s_to_p, u - w)
        after = law_energy(laws, law, at_p, u, at_s, w) + law_energy(laws, law, at_s, w, at_q, v)
    else:
        before = dirichlet_energy(at_p, u, at_q, v) + dirichlet_energy(s_to_q, v - w, s_to_p, u - w)
        after = dirichlet_energy(at_p, u, at_s, w) + dirichlet_energy(at_s, w, at_q, v)
    inner, outer = cross(at_p, at_q), cross(s_to_q, s_to_p)
    left, right = cross(at_p, at_s), cross(at_s, at_q)
    if not (left > 0.0 and right > 0.0):
        return 0.0, 0.0
    pulled = load * (left * (u + w) + right * (w + v) - inner * (u + v) - outer * (u + v + w))
    gain = coefficient * (before - after) + pulled
    # Constant fluxes contribute equally before and after: the boundary of the pair determines the mean gradient.
    if data.shape[1] > CONSTANTS:
        gain += flux_term(data, e, x, at_p, u, at_s, w) + flux_term(data, e, x, at_s, w, at_q, v)
        gain -= flux_term(data, e, x, at_p, u, at_q, v)
        gain -= flux_term(data, e, plus(x, at_s), s_to_q, v - w, s_to_p, u - w)
    return gain, coefficient * (before + after) + abs(load) * (inner + outer) * (abs(u) + abs(v) + abs(w))


@inner_kernel
def dirichlet_energy(a, u, b, v):
    """Return int |grad|^2 / 2 over (0, a, b) for the nodal values 0, u, v."""
    n = weighted(v, a, -u, b)
    return 0.25 * dot(n, n) / cross(a, b)


@inner_kernel
def law_energy(laws, law, a, u, b, v):
    n, doubled = weighted(v, a, -u, b), cross(a, b)
    return 0.5 * doubled * energy_density(laws, law, dot(n, n) / (doubled * doubled))[0]
