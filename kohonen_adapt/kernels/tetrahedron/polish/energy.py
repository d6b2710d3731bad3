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
)
from kohonen_adapt.kernels.vectors import (
    between,
    cofactors,
    combined,
    cross,
    dot,
    minus,
    plus_times,
    point,
    times,
    weighted,
)

ROUNDING = 1e-13  # smallest gain, relative to the sum of magnitudes


@inner_kernel
def source_around(trial, region, v):
    if trial.source.shape[0] > 0:
        return trial.source[v, region]
    return trial.load[region]


@inner_kernel
def source_along(trial, region, a, b):
    if trial.source.shape[0] > 0:
        return 0.5 * (trial.source[a, region] + trial.source[b, region])
    return trial.load[region]


@inner_kernel
def value_at(trial, region, node):
    if trial.surface.shape[0] > 0:
        return trial.value[node] - trial.reduced[region] * trial.surface[node, OFFSET]
    return trial.value[node]


@inner_kernel
def less_shift(trial, region, slope):
    return slope if trial.laws.number[region] < 0 else minus(slope, point(trial.shift, region))


@inner_kernel
def shifted(trial, region, six, n):
    return n if trial.laws.number[region] < 0 else plus_times(n, -six, point(trial.shift, region))


@inner_kernel
def gradient_of(position, trial, region, a, b, c, d):
    """Return the sum of the values, the three cofactors, D and n of an element."""
    at_a, at_b = value_at(trial, region, a), value_at(trial, region, b)
    at_c, at_d = value_at(trial, region, c), value_at(trial, region, d)
    u, v, w = between(position, a, b), between(position, a, c), between(position, a, d)
    p, q, r = cofactors(u, v, w)
    n = combined(at_b - at_a, p, at_c - at_a, q, at_d - at_a, r)
    return at_a + at_b + at_c + at_d, (p, q, r), dot(u, p), n


@inner_kernel
def element_energy(position, trial, region, load, a, b, c, d):
    """Return the functional of an element, and the sum of magnitudes of its terms.

    `load` is a 24th of the source.
    """
    values, _, six, n = gradient_of(position, trial, region, a, b, c, d)
    energy = stored_in(trial, region, six, n)
    pull = load * six * values
    push = dot(point(trial.sixth_flux, region), n)
    return energy - pull - push, energy + abs(pull) + abs(push)


@inner_kernel
def stored_in(trial, region, six, n):
    n = shifted(trial, region, six, n)
    law = trial.laws.number[region]
    square = dot(n, n)
    if law >= 0:
        return six * energy_density(trial.laws, law, square / (six * six))[0] / 6.0
    return trial.twelfth[region] * square / six


@inner_kernel
def triangle_tilts(trial, region, vectors, p, q, r):
    """Return the part of n of a triangle, its first value, and the sum of its values.

    The part be U - al V is the same for all tetrahedra on the triangle, with U and V of `triangle_vectors`.
    """
    u, v, _, _ = vectors
    at_p, at_q, at_r = value_at(trial, region, p), value_at(trial, region, q), value_at(trial, region, r)
    return weighted(at_r - at_p, u, at_p - at_q, v), at_p, at_p + at_q + at_r


@inner_kernel
def energy_on(trial, region, load, vectors, tilts, w, value, side):
    """Return the functional of the tetrahedron of a triangle and a node.

    The node has a value and the vector W from the first node of the triangle, which gives n = W x (be U - al V) + ga
    U x V. `side` is 1 if U x V points to the node, otherwise -1.
    """
    tilt, at_first, values = tilts
    across = vectors[2]
    n = plus_times(cross(w, tilt), value - at_first, across)
    six = side * dot(w, across)
    push = dot(point(trial.sixth_flux, region), n)
    return stored_in(trial, region, six, times(side, n)) - load * six * (values + value) - side * push


@inner_kernel
def density_at(trial, region, g):
    # Return the energy density at a gradient less the shift, and its derivatives by the square.
    law = trial.laws.number[region]
    if law >= 0:
        return energy_density(trial.laws, law, dot(g, g))
    half = 6.0 * trial.twelfth[region]
    return half * dot(g, g), half, 0.0
