"""Gains of splits and costs of collapses on tetrahedra, for a P1 function."""

import numpy as np

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.geometry import OPPOSITE, corner_of, cubed_quality, face_of
from kohonen_adapt.kernels.tetrahedron.polish.energy import (
    ROUNDING,
    element_energy,
    gradient_of,
    shifted,
    source_along,
    source_around,
    value_at,
)
from kohonen_adapt.kernels.tetrahedron.polish.slivers import UNMOVED, filled_by_split, sliver, slivers_of
from kohonen_adapt.kernels.tetrahedron.surgery import NOWHERE
from kohonen_adapt.kernels.vectors import dot, minus, plus, point


@inner_kernel
def halves_parabola(position, trial, region, a, b, c, d, w):
    """Return the functional of an element with edge ab split at its midpoint.

    The value at the midpoint is the mean in the region plus w. With the gradient G and the gradients S_i / D of the
    shape functions, the half at a has the gradient G + 2 w S_b / D, and the half at b has G + 2 w S_a / D. Returned
    are (sum of magnitudes, value, first and second derivative by w).
    """
    values, (p, q, r), six, n = gradient_of(position, trial, region, a, b, c, d)
    o = plus(plus(p, q), r)  # o = -S_a, p = S_b
    step = 2.0 * w
    m = shifted(trial, region, six, n)
    square, on_p, on_o = dot(m, m), dot(m, p), dot(m, o)
    p_p, o_o = dot(p, p), dot(o, o)
    one = square + step * (2.0 * on_p + step * p_p)
    one, by_one, by_ww_one = half_energy(trial, region, six, one, on_p + step * p_p, p_p)
    two = square - step * (2.0 * on_o - step * o_o)
    two, by_two, by_ww_two = half_energy(trial, region, six, two, step * o_o - on_o, o_o)
    pull = source_along(trial, region, a, b) * six
    flux = point(trial.sixth_flux, region)
    lift = dot(flux, minus(p, o))
    push, down = dot(flux, n) + w * lift, pull * (values + w)
    energy = one + two
    return energy + abs(down) + abs(push), energy - down - push, by_one + by_two - pull - lift, by_ww_one + by_ww_two


@inner_kernel
def half_energy(trial, region, six, square, along, across):
    """Return the stored energy of half an element, and two derivatives by a value.

    The gradient is n / D, and the shape function of the value has the gradient 2 s / D. Arguments are |n|^2, n .
    s and |s|^2.
    """
    law = trial.laws.number[region]
    if law < 0:
        twelfth = trial.twelfth[region]
        return 0.5 * twelfth * square / six, 2.0 * twelfth * along / six, 4.0 * twelfth * across / six
    density, rate, curve = energy_density(trial.laws, law, square / (six * six))
    by_ww = (4.0 * curve * along * along / (six * six) + 2.0 * rate * across) / (3.0 * six)
    return six * density / 12.0, rate * along / (3.0 * six), by_ww


@inner_kernel
def split_parabola(mesh, trial, shell, count, a, b, w):
    magnitude = total = slope = stiffness = 0.0
    nonlinear, node = False, mesh.elements.node
    for i in range(count):
        e = shell[i]
        region = mesh.elements.region[e]
        k, j = corner_of(node, e, a), corner_of(node, e, b)
        c, d = other_corners(node, e, k, j)
        more, value, by_w, by_ww = halves_parabola(mesh.position, trial, region, a, b, c, d, w)
        magnitude, total, slope, stiffness = magnitude + more, total + value, slope + by_w, stiffness + by_ww
        nonlinear = nonlinear or trial.laws.number[region] >= 0
    return magnitude, total, slope, stiffness, nonlinear


@inner_kernel
def other_corners(node, e, k, j):
    for i in range(3):
        if OPPOSITE[k, i] == j:
            return node[e, OPPOSITE[k, (i + 1) % 3]], node[e, OPPOSITE[k, (i + 2) % 3]]
    return NOWHERE, NOWHERE


@inner_kernel
def gain_of_split(mesh, trial, shell, count, a, b):
    """Return the gain of a split at the midpoint of ab, and the value of the node.

    The gain is 0 if below rounding errors. For nonlinear material the value is that of one Newton step.
    """
    magnitude, before, slope, stiffness, nonlinear = split_parabola(mesh, trial, shell, count, a, b, 0.0)
    gain, w = 0.5 * slope * slope / stiffness, -slope / stiffness
    if nonlinear:
        gain = before - split_parabola(mesh, trial, shell, count, a, b, w)[1]
    gain += filled_slivers(mesh, trial, shell, count, a, b)
    region = mesh.elements.region[shell[0]]  # the edge is not on a surface with offsets, which holds edges
    middle = 0.5 * (value_at(trial, region, a) + value_at(trial, region, b))
    return gain if gain > ROUNDING * magnitude else 0.0, middle + w


@inner_kernel
def filled_slivers(mesh, trial, shell, count, a, b):
    gain, elements = 0.0, mesh.elements
    for i in range(count):
        e = shell[i]
        for k in range(4):
            p = elements.patch[e, k]
            if p >= 0 and trial.counted[p] and elements.node[e, k] not in (a, b):
                gain += filled_by_split(mesh, trial, e, k, a, b)
    return gain


@inner_kernel
def energy_merged(mesh, trial, v, w, count, least):
    """Return the functional of the elements around v after merging v into w.

    The elements around v must be in `cavity.old`. Returned is inf if an element would be worse than `least`.
    """
    position, elements, node = mesh.position, mesh.elements, mesh.elements.node
    total = 0.0
    for i in range(count):
        e = mesh.cavity.old[i]
        k = corner_of(node, e, v)
        if corner_of(node, e, w) >= 0:
            p = elements.patch[e, k]
            if p >= 0 and trial.counted[p]:  # face of the neighbour after the collapse
                total += sliver(position, elements, mesh.surfaces, trial, e, k, UNMOVED)[0]
            continue
        face = face_of(node, e, k)
        if not cubed_quality(mesh.position, w, *face) >= least:
            return np.inf
        region = mesh.elements.region[e]
        total += element_energy(position, trial, region, source_around(trial, region, v), w, *face)[0]
        change = value_at(trial, region, w) - value_at(trial, region, v)
        moved = v, point(position, w), change
        total += slivers_of(position, elements, mesh.surfaces, trial, e, moved)[0]
    return total
