"""Descent of the Ritz functional of a P1 function by moves of nodes.

The energy of an element (v, a, b, c) in `energy.py`, with A, B, C the vectors from v to the remaining nodes
and al, be, ga their values minus the value of v, depends on D = A . (B x C) and n = al BxC + be CxA + ga AxB.
By the position x and the value w of v

    dn/dx_k = e_k x T,   dn/dw = -S,   dD/dx = -S,   S = BxC + CxA + AxB,   T = al (B - C) + be (C - A) + ga
    (A - B),

with S and T independent of x and w. Since D and n are affine, |n|^2 / D is jointly convex. With the gradient
g = n / D of u, the Hessian of c |n|^2 / (12 D) is c / (6 D) r_i . r_j, r = dn - g dD. Only the source can
make a Hessian indefinite. Nonlinear material, D W(|g|^2) / 6, has W' / (3 D) instead of c / (6 D), and the
additional term 2 W'' / (3 D) (g . r_i)(g . r_j). With a shift s the law and both factors g . r have g - s in place
of g, but r has g. See Thoutireddy and Ortiz, Int. J. Numer. Meth. Engng 61
(2004).
"""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, OFFSET, ON_PATCH, TWELFTH_COEFFICIENT
from kohonen_adapt.kernels.tetrahedron.geometry import allowed, cubed_of, others, sum_of_squares
from kohonen_adapt.kernels.tetrahedron.polish.applied_field import follows_field, rise_at
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING, shift_of, sixth_flux, source_around, value_at
from kohonen_adapt.kernels.tetrahedron.polish.slivers import has_slivers, sliver_gradient, slivers_around
from kohonen_adapt.kernels.tetrahedron.polish.star_values import best_value, improve_value, least_near, with_slivers
from kohonen_adapt.kernels.tetrahedron.surfaces import signed_distance, slid, tangent_of_ridge, within_reach
from kohonen_adapt.kernels.vectors import (
    ZERO,
    ZEROS,
    between,
    cofactors,
    combined,
    divided,
    dot,
    from_to,
    gram,
    minus,
    norm,
    plus,
    plus_cross,
    plus_dot,
    plus_products,
    plus_square,
    plus_times,
    point,
    product,
    put,
    times,
    weighted,
)

OVERSTEP = 1.6  # over-relaxation of Newton's step, because neighbours move afterwards
LEAST_CURVATURE = 0.3  # smallest eigenvalue used, relative to the largest; limits the step
STEP = 1e-4  # of differences, relative to an edge
TURNS = 24  # Jacobi rotations, three per cycle of axes
DIAGONAL = 1e-20  # sum of squared off-diagonal entries at convergence, relative to the squared norm


@kernel
def descend_nodes(mesh, trial, order, floor):
    """Move nodes in order, and return the decrease of the functional.

    The value of a node is eliminated, or follows the Dirichlet function. `floor` is the cube of a quality.
    """
    number, fall = mesh.constraints.freedom.number, 0.0
    for node in order:
        v = np.int64(node)
        if number[v] != HELD:
            fall += move_node(mesh, trial, v, floor)
        elif not trial.fixed[v]:
            fall += improve_value(mesh, trial, v, has_slivers(mesh, trial, v))
    return fall


@inner_kernel
def derivatives(mesh, trial, v):
    """Return the functional of the star of v, gradient and Hessian in (x, y, z, w).

    The unknown w is the change of the value of v. Returned are (sum of magnitudes, value, worst cubed quality,
    True if nonlinear), the gradient by (x, y, z), by w, the Hessian by (xx, xy, xz, yy, yz, zz), by (xw, yw, zw),
    and by ww. Values are relative to the value of v, which shifts the load by a constant, because moves do not
    change the volume of the star in any region.
    """
    position, star, data = mesh.position, mesh.star, trial.data
    magnitude = total = by_w = ww = 0.0
    at = point(position, v)
    gradient, hessian, mixed = ZERO, ZEROS, ZERO
    worst, nonlinear = 2.0, False
    for row in range(star.start[v], star.start[v + 1]):
        i, j, k = others(star, row)
        region = mesh.elements.region[star.element[row]]
        a, b, c = from_to(at, position, i), from_to(at, position, j), from_to(at, position, k)
        own, law = value_at(trial, region, v), trial.laws.number[region]
        alpha, beta = value_at(trial, region, i) - own, value_at(trial, region, j) - own
        gamma = value_at(trial, region, k) - own
        p, q, r = cofactors(a, b, c)
        six = dot(a, p)
        worst = min(worst, cubed_of(six, sum_of_squares(a, b, c)))
        s, n = plus(plus(p, q), r), combined(alpha, p, beta, q, gamma, r)
        t = combined(alpha, minus(b, c), beta, minus(c, a), gamma, minus(a, b))
        inverse = 1.0 / six
        g = times(inverse, n)
        # r by x, y, z; r by w is -S
        x = g[0] * s[0], g[1] * s[0] - t[2], g[2] * s[0] + t[1]
        y = g[0] * s[1] + t[2], g[1] * s[1], g[2] * s[1] - t[0]
        z = g[0] * s[2] - t[1], g[1] * s[2] + t[0], g[2] * s[2]
        if law >= 0:
            g = minus(g, shift_of(trial, region))
        square, along = dot(g, g), (dot(g, x), dot(g, y), dot(g, z))
        g_w = -dot(g, s)
        if law >= 0:
            nonlinear = True
            density, rate, curve = energy_density(trial.laws, law, square)
            energy, per_volume = six * density / 6.0, density / 6.0
            weight = rate * inverse / 3.0
            curve *= 2.0 * inverse / 3.0
            hessian = plus_square(hessian, curve, along)
            mixed = plus_times(mixed, g_w, times(curve, along))
            ww += curve * g_w * g_w
        else:
            weight, per_volume = 2.0 * data[region, TWELFTH_COEFFICIENT] * inverse, data[region, TWELFTH_COEFFICIENT]
            per_volume *= square
            energy = per_volume * six
        load, flux = source_around(trial, region, v), sixth_flux(trial, region)
        around = alpha + beta + gamma
        pull, push = load * six * around, dot(flux, n)
        magnitude += energy + abs(pull) + abs(push)
        total += energy - pull - push
        volume = weight * six
        lost = load * around - per_volume  # dD/dx = -S
        gradient = plus(gradient, plus_cross(weighted(volume, along, lost, s), flux, t))
        by_w += plus_dot(volume * g_w - load * six, flux, s)
        hessian = plus_times(hessian, weight, gram(x, y, z))
        mixed = plus(mixed, weighted(load, s, -weight, (dot(x, s), dot(y, s), dot(z, s))))
        ww += weight * dot(s, s)
    return (magnitude, total, worst, nonlinear), gradient, by_w, hessian, mixed, ww


@inner_kernel
def move_node(mesh, trial, v, floor):
    if follows_field(trial, v):
        return slide_in_field(mesh, trial, v, floor)
    position, freedom = mesh.position, mesh.constraints.freedom
    given = trial.fixed[v]
    (magnitude, total, before, nonlinear), gradient, by_w, hessian, mixed, ww = derivatives(mesh, trial, v)
    x, curved = point(position, v), has_slivers(mesh, trial, v)
    if curved:
        more = slivers_around(mesh, trial, v, x, 0.0)
        total, by_w, ww = plus((total, by_w, ww), more)
        gradient = plus(gradient, sliver_gradient(mesh, trial, v))
        magnitude += abs(more[0])
        nonlinear = True  # the material across a face may be nonlinear
    unmoved, now = 0.0, total
    if given:
        rate = point(trial.rate, rates_row(mesh.constraints, v))
    else:
        rate = divided(mixed, -ww)
        unmoved, now = -by_w / ww, total - 0.5 * by_w * by_w / ww
    gradient, hessian = follow_value(gradient, by_w, hessian, mixed, ww, rate)
    if freedom.number[v] != INSIDE:
        gradient, hessian = tangential(mesh, v, gradient, hessian)
    step = newton_step(gradient, hessian)
    if -dot(step, gradient) > ROUNDING * magnitude:
        if nonlinear and not given:
            now, unmoved, _ = best_value(mesh, trial, v, x, unmoved, nonlinear, curved)
            now = min(now, total)
        for _ in range(HALVINGS + 1):
            y = slid(position, mesh.constraints, v, step)
            w = dot(rate, minus(y, x))
            if given:
                least, _, _, worst = with_slivers(mesh, trial, v, y, w, curved)
            else:
                least, w, worst = best_value(mesh, trial, v, y, unmoved + w, nonlinear, curved)
            if (
                allowed(worst, before, floor)
                and now - least > ROUNDING * magnitude
                and turn_allowed(mesh, v, curved, y)
            ):
                put(position, v, y)
                trial.value[v] += w
                return total - least
            step = times(0.5, step)
    if given:
        return 0.0
    if nonlinear:
        return improve_value(mesh, trial, v, curved)
    trial.value[v] += unmoved
    return total - now


@inner_kernel
def slide_in_field(mesh, trial, v, floor):
    if has_slivers(mesh, trial, v):
        return improve_value(mesh, trial, v, True)
    x = point(mesh.position, v)
    total, _, _, before = with_slivers(mesh, trial, v, x, 0.0, False)
    now, unmoved, _ = best_value(mesh, trial, v, x, 0.0, True, False)
    gradient, hessian = differences(mesh, trial, v, unmoved)
    gradient, hessian = tangential(mesh, v, gradient, hessian)
    step = newton_step(gradient, hessian)
    for _ in range(HALVINGS + 1):
        y = slid(mesh.position, mesh.constraints, v, step)
        least, w, worst = best_value(mesh, trial, v, y, unmoved, True, False)
        if allowed(worst, before, floor) and now - least > ROUNDING * abs(total):
            trial.surface[v, OFFSET] -= rise_at(mesh, trial, v, y)
            put(mesh.position, v, y)
            trial.value[v] += w
            return total - least
        step = times(0.5, step)
    return improve_value(mesh, trial, v, False)


@inner_kernel
def differences(mesh, trial, v, w):
    # gradient and Hessian of the functional by the position of v, with the best value near w
    x = point(mesh.position, v)
    h = STEP * norm(between(mesh.position, v, mesh.star.link[mesh.star.start[v], 0]))
    i, j, k = (h, 0.0, 0.0), (0.0, h, 0.0), (0.0, 0.0, h)
    now = least_near(mesh, trial, v, x, w)
    right, left = least_near(mesh, trial, v, plus(x, i), w), least_near(mesh, trial, v, minus(x, i), w)
    far, near = least_near(mesh, trial, v, plus(x, j), w), least_near(mesh, trial, v, minus(x, j), w)
    above, below = least_near(mesh, trial, v, plus(x, k), w), least_near(mesh, trial, v, minus(x, k), w)
    xy = least_near(mesh, trial, v, plus(plus(x, i), j), w) - right - far + now
    xz = least_near(mesh, trial, v, plus(plus(x, i), k), w) - right - above + now
    yz = least_near(mesh, trial, v, plus(plus(x, j), k), w) - far - above + now
    xx, yy, zz = right - 2.0 * now + left, far - 2.0 * now + near, above - 2.0 * now + below
    return times(0.5 / h, (right - left, far - near, above - below)), times(1.0 / (h * h), (xx, xy, xz, yy, yz, zz))


@inner_kernel
def turn_allowed(mesh, v, curved, x):
    return not curved or within_reach(mesh.position, mesh.elements, mesh.star, mesh.constraints.surfaces, v, x)


@inner_kernel
def rates_row(constraints, v):
    place = np.int64(constraints.freedom.place[v])
    if constraints.freedom.number[v] == ON_PATCH:
        return place
    return constraints.surfaces.shape.shape[0] + place


@inner_kernel
def follow_value(gradient, by_w, hessian, mixed, ww, rate):
    hessian = plus_products(hessian, plus_times(mixed, 0.5 * ww, rate), rate)
    return plus_times(gradient, by_w, rate), hessian


@inner_kernel
def tangential(mesh, v, gradient, hessian):
    surfaces, place = mesh.constraints.surfaces, np.int64(mesh.constraints.freedom.place[v])
    x = point(mesh.position, v)
    if mesh.constraints.freedom.number[v] == ON_PATCH:
        normal = signed_distance(surfaces, place, x)[1]
        across = product(hessian, normal)
        across = plus_times(across, -0.5 * dot(across, normal), normal)
        hessian = plus_products(hessian, times(-1.0, across), normal)
        return plus_times(gradient, -dot(gradient, normal), normal), hessian
    tangent = tangent_of_ridge(surfaces, place, x)
    curvature = dot(product(hessian, tangent), tangent)
    return times(dot(gradient, tangent), tangent), plus_square(ZEROS, curvature, tangent)


@inner_kernel
def newton_step(gradient, hessian):
    """Return an over-relaxed descent step with magnitudes of the eigenvalues.

    The eigenvectors are computed by Jacobi rotations in the plane of x and y. The axes are permuted cyclically
    after each rotation, so that every pair of axes is rotated.
    """
    xx, xy, xz, yy, yz, zz = hessian
    u, v, w = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    enough = DIAGONAL * (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz))
    for _ in range(TURNS):
        if xy * xy + xz * xz + yz * yz <= enough:
            break
        if xy != 0.0:
            half = 0.5 * (yy - xx) / xy
            tangent = math.copysign(1.0 / (abs(half) + math.sqrt(half * half + 1.0)), half)
            c = 1.0 / math.sqrt(tangent * tangent + 1.0)
            s = tangent * c
            xx, yy = xx - tangent * xy, yy + tangent * xy
            xy = 0.0
            xz, yz = c * xz - s * yz, s * xz + c * yz
            u, v = weighted(c, u, -s, v), weighted(s, u, c, v)
        xx, yy, zz, xy, yz, xz = yy, zz, xx, yz, xz, xy
        u, v, w = v, w, u
    least = LEAST_CURVATURE * max(abs(xx), abs(yy), abs(zz))
    if not least > 0.0:
        return ZERO
    a = -OVERSTEP * dot(gradient, u) / max(abs(xx), least)
    b = -OVERSTEP * dot(gradient, v) / max(abs(yy), least)
    c = -OVERSTEP * dot(gradient, w) / max(abs(zz), least)
    return combined(a, u, b, v, c, w)
