"""Magnetic field strength of windings with uniform current densities.

A straight bar is a polyhedron with one current density J. Because ``grad' (1/r)`` integrates to the surface,

    H(x) = 1/(4 pi) sum over faces (J x n) I,    I = int dS / |x - x'| = sum over edges d L - h Omega,

with L = ln((s + l) / (s - l)) of an edge of length l with distances s = r_a + r_b of its ends from x, the distance d of
its line in the plane of the face, the distance h of the plane, and the solid angle Omega of the face (Wilton et al.,
IEEE Trans. Antennas Propag. 32, 1984). Faces at an edge have L in common, and their d are linear in x, so that an edge
contributes ``M (c - x) L`` with a matrix M.

An arc has a rectangular section and an azimuthal current density of constant magnitude. Integrals over the section are
closed forms (Urankar, IEEE Trans. Magn. 18, 1982), and the integral over the angle is a quadrature. Far from x, Gauss
rules of few points suffice (Trefethen, SIAM Review 50, 2008); beside x, points cluster where the arc is nearest to x.
"""

import math
from typing import NamedTuple

from kohonen_adapt.kernels.numba.array_types import I1, I2, R1, R2, R3
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel, record
from kohonen_adapt.kernels.vectors import (
    ZERO,
    add_to,
    combined,
    dot,
    from_to,
    minus,
    norm,
    plus,
    plus_times,
    point,
    put,
    times,
)

__all__ = ["Arcs", "Bars", "add_arcs", "add_bars"]

TINY = 1e-14  # of s - l relative to s, below which x is on an edge, whose term is 0


@record
class Bars(NamedTuple):
    """Polyhedra of k corners, e edges and f faces, with uniform current densities."""

    corner: R2  # (k, 3)
    end: I2  # (e, 2): corners at the ends of an edge
    length: R1  # (e,)
    matrix: R3  # (e, 3, 3): M / (4 pi)
    face: I2  # (f, 4): corners, counter-clockwise around the normal
    normal: R2  # (f, 3)
    weight: R2  # (f, 3): J x n / (4 pi)
    area: R2  # (f, 2): twice the areas of both triangles of a face


@record
class Arcs(NamedTuple):
    """Arcs of rectangular section, and quadrature rules of at most q points."""

    centre: R2  # (a, 3)
    frame: R3  # (a, 3, 3): unit vectors as rows: to the middle of the arc, across, and the axis
    half_angle: R1  # (a,)
    bounds: R2  # (a, 4): inner and outer radius, lowest and highest z
    density: R1  # (a,): current density / (4 pi), positive around the axis
    npoints: I1  # (r,): points of a rule
    reach: R1  # (r,): least large half-axis of an ellipse, see `rule_for`; falls to 0
    fraction: R2  # (r, q): points on [0, 1], which cluster at 0 in the last rule
    weight: R2  # (r, q)


@kernel
def add_bars(bars, x, first, last, scratch, field):
    """Add H of bars at the points `x` from `first` to `last`.

    `x` and `field` have shape (n, 3), and `scratch` has shape (k, 4).
    """
    for p in range(first, last):
        for k in range(bars.corner.shape[0]):
            corner = from_to(point(x, p), bars.corner, k)
            put(scratch, k, corner)
            scratch[k, 3] = norm(corner)
        add_to(field, p, minus(edge_terms(bars, scratch), face_terms(bars, scratch)))


@inner_kernel
def edge_terms(bars, scratch):
    field = ZERO
    for e in range(bars.end.shape[0]):
        a, b, length = bars.end[e, 0], bars.end[e, 1], bars.length[e]
        total = scratch[a, 3] + scratch[b, 3]
        if total - length > TINY * total:
            value = math.log((total + length) / (total - length))
            field = plus(field, transformed(bars.matrix[e], times(value, point(scratch, a))))
    return field


@inner_kernel
def face_terms(bars, scratch):
    """Return the sum of ``weight h Omega``.

    The solid angles of both triangles of a face are the arguments of complex numbers (Van Oosterom and Strackee, IEEE
    Trans. Biomed. Eng. 30, 1983), so that the face has the argument of their product.
    """
    total = ZERO
    for f in range(bars.face.shape[0]):
        a, b, c, d = bars.face[f, 0], bars.face[f, 1], bars.face[f, 2], bars.face[f, 3]
        ra, rb, rc, rd = scratch[a, 3], scratch[b, 3], scratch[c, 3], scratch[d, 3]
        p, q, r, s = point(scratch, a), point(scratch, b), point(scratch, c), point(scratch, d)
        height, diagonal = dot(p, point(bars.normal, f)), dot(p, r)
        one = ra * rb * rc + dot(p, q) * rc + diagonal * rb + dot(q, r) * ra
        other = ra * rc * rd + diagonal * rd + dot(p, s) * rc + dot(r, s) * ra
        first, second = height * bars.area[f, 0], height * bars.area[f, 1]
        angle = 2.0 * height * math.atan2(one * second + other * first, one * other - first * second)
        total = plus_times(total, angle, point(bars.weight, f))
    return total


@inner_kernel
def transformed(matrix, a):
    return dot(point(matrix, 0), a), dot(point(matrix, 1), a), dot(point(matrix, 2), a)


@kernel
def add_arcs(arcs, x, first, last, field):
    for p in range(first, last):
        for a in range(arcs.centre.shape[0]):
            frame = arcs.frame[a]
            u, v, z = transformed(frame, minus(point(x, p), point(arcs.centre, a)))
            radius, angle = math.sqrt(u * u + v * v), math.atan2(v, u)
            outward, around, axial = arc_field(arcs, a, radius, angle, z)
            cosine, sine = math.cos(angle), math.sin(angle)
            u, v = outward * cosine - around * sine, outward * sine + around * cosine
            add_to(field, p, combined(u, point(frame, 0), v, point(frame, 1), axial, point(frame, 2)))


@inner_kernel
def arc_field(arcs, a, radius, angle, z):
    half = arcs.half_angle[a]
    if half >= math.pi:
        outward, _, axial = stretch_field(arcs, a, radius, z, 0.0, math.pi)
        return 2.0 * outward, 0.0, 2.0 * axial
    if abs(angle) < half:
        if rule_for(arcs, a, radius, z, -half - angle, half - angle) < len(arcs.npoints) - 1:
            return stretch_field(arcs, a, radius, z, -half - angle, half - angle)
        ahead = stretch_field(arcs, a, radius, z, 0.0, half - angle)
        return minus(ahead, stretch_field(arcs, a, radius, z, 0.0, -half - angle))
    if angle > 0.0:
        return times(-1.0, stretch_field(arcs, a, radius, z, half - angle, -half - angle))
    return stretch_field(arcs, a, radius, z, -half - angle, half - angle)


@inner_kernel
def stretch_field(arcs, a, radius, z, start, end):
    # outwards, around the axis and along the axis
    total = ZERO
    rule = rule_for(arcs, a, radius, z, start, end)
    for i in range(arcs.npoints[rule]):
        psi = start + (end - start) * arcs.fraction[rule, i]
        cosine, sine = math.cos(psi), math.sin(psi)
        across, along = section_field(arcs, a, radius, z, cosine, sine)
        weight = arcs.weight[rule, i]
        total = plus(total, (weight * across * cosine, weight * across * sine, weight * along))
    return times(arcs.density[a] * (end - start), total)


@inner_kernel
def rule_for(arcs, a, radius, z, start, end):
    # A Gauss rule converges by the sum of the half-axes of the largest ellipse around the interval in which the
    # integrand is analytic. The nearest singularity has the imaginary part y with cosh(y) = 1 + d^2 / (2 r radius) for
    # the least distance d of the point from the section.
    height = max(arcs.bounds[a, 2] - z, z - arcs.bounds[a, 3], 0.0)
    r = min(max(math.sqrt(radius * radius + height * height), arcs.bounds[a, 0]), arcs.bounds[a, 1])
    squared = (r - radius) ** 2 + height * height
    if squared <= 0.0:
        return len(arcs.npoints) - 1
    if 1e-9 * squared >= 2.0 * r * radius:
        return 0
    excess = squared / (2.0 * r * radius)
    y = math.log1p(excess + math.sqrt(excess * (2.0 + excess)))
    size = 0.5 * abs(end - start)
    x = 0.5 * (start + end)
    x -= 2.0 * math.pi * math.floor(0.5 * x / math.pi + 0.5)
    axis = 0.5 * (math.hypot(x - size, y) + math.hypot(x + size, y))
    rule = 0
    while axis < arcs.reach[rule] * size:
        rule += 1
    return rule


@inner_kernel
def section_field(arcs, a, radius, z, cosine, sine):
    """Return the integrals over the section at one angle, across and along the axis.

    The integrands are ``r (z - z') / D^3`` and ``r (r - radius cosine) / D^3``. D is the distance from the point
    (r, z') of the section. Logarithms and arctangents of the corners are added before they are evaluated.
    """
    shift, b = radius * cosine, radius * abs(sine)
    low, high = z - arcs.bounds[a, 2], z - arcs.bounds[a, 3]
    across = along = 0.0
    of_low = of_high = of_heights = 1.0
    for i in range(2):
        u, sign = arcs.bounds[a, i] - shift, 1.0 - 2.0 * i
        squared = u * u + b * b
        to_low, to_high = math.sqrt(squared + low * low), math.sqrt(squared + high * high)
        across += sign * (to_low - to_high)
        first, last = sum_with(u, b, low, to_low), sum_with(u, b, high, to_high)
        if squared > 0.0:
            ratio, base = to_low + abs(low), to_high + abs(high)
            ratio *= base / squared if low * high < 0.0 else 1.0 / base
            of_heights = of_heights * ratio if i == 0 else of_heights / ratio
            product = b * b * to_low * to_high + u * u * low * high
            along += sign * b * math.atan2(u * b * (low * to_high - high * to_low), product)
        of_low, of_high = (first, last) if i == 0 else (of_low / first, of_high / last)
    log_low, log_high = math.log(of_low), math.log(of_high)
    across += shift * (log_low - log_high)
    along -= low * log_low - high * log_high
    along += shift * (math.log(of_heights) if low > 0.0 else -math.log(of_heights))
    return across, along


@inner_kernel
def sum_with(u, b, h, distance):
    # u + distance without cancellation; 1 on an edge, where the term is left out
    if u >= 0.0:
        return u + distance if distance > 0.0 else 1.0
    return (b * b + h * h) / (distance - u) if b * b + h * h > 0.0 else 1.0
