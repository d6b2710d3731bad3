"""Descent of the Ritz functional by moves of nodes, for P1 and P2 functions.

A node moves to where the minimum over its value, and at order 2 over the coefficients of its edges, is lower. Dirichlet
values follow their linear function. With a law, or beside curved faces, the minimum is that of one step of Newton's
method, by the functional itself.
"""

import math

import numpy as np

from kohonen_adapt.kernels.arrays import HALVINGS
from kohonen_adapt.kernels.functionals import substitute
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import BLOCK, HELD, INSIDE, ON_PATCH, POSITION, VALUE
from kohonen_adapt.kernels.tetrahedron.geometry import allowed, corner_of, star_quality
from kohonen_adapt.kernels.tetrahedron.polish.cavity_order2 import add_correction
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING
from kohonen_adapt.kernels.tetrahedron.polish.slivers import has_slivers
from kohonen_adapt.kernels.tetrahedron.polish.star import (
    EDGES_FROM,
    derivatives_order2,
    number_star,
    place,
    star_of,
)
from kohonen_adapt.kernels.tetrahedron.surfaces import signed_distance, slid, tangent_of_ridge, within_reach
from kohonen_adapt.kernels.vectors import (
    ZERO,
    ZEROS,
    combined,
    divided,
    dot,
    minus,
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
TRIES = 4  # halvings of a Newton step of a value in nonlinear material
TURNS = 24  # Jacobi rotations, three per cycle of axes
DIAGONAL = 1e-20  # sum of squared off-diagonal entries at convergence, relative to the squared norm


@kernel
def descend_nodes(mesh, trial, quadratic, order, floor):
    """Move nodes in order, and return the decrease of the functional.

    The value of a node is eliminated, or follows the Dirichlet function, and at order 2, with `quadratic`, the
    coefficients of its edges are eliminated. `floor` is the cube of a quality.
    """
    fall = 0.0
    for v in order:
        fall += move_node(mesh, trial, quadratic, v, floor)
    return fall


@inner_kernel
def move_node(mesh, trial, quadratic, v, floor):
    """Move a node, and return the decrease of the functional.

    The value of the node changes, and at order 2 the coefficients of the edges.
    """
    freedom, x = mesh.constraints.freedom, point(mesh.position, v)
    held, given = freedom.number[v] == HELD, trial.fixed[v]
    curved = quadratic is None and has_slivers(mesh, trial, v)
    if quadratic is None:
        if given and held:
            return 0.0
    elif not number_star(mesh, quadratic, v):
        return 0.0
    level = BLOCK if held else POSITION
    sizes, gradient, by_w, hessian, mixed, ww = star_of(mesh, trial, quadratic, v, x, 0.0, level, curved)
    magnitude, total, least, before, nonlinear = sizes
    if not least < np.inf:  # of elements that fold
        return 0.0
    start = 0.0 if given else -by_w / ww
    gain = total - least + 0.5 * start * start * ww
    if quadratic is not None:
        take_correction(quadratic.block, start)
        start = 0.0
    if nonlinear:
        start, gain = settled(mesh, trial, quadratic, v, start, total, curved)
    further, w = 0.0, start
    if not held:
        rate = point(trial.rate, rates_row(mesh.constraints, v)) if given else divided(mixed, -ww)
        gradient, hessian = follow_value(gradient, by_w, hessian, mixed, ww, rate)
        if freedom.number[v] != INSIDE:
            gradient, hessian = tangential(mesh, v, gradient, hessian)
        now = total - gain
        if quadratic is not None:
            before = star_quality(mesh.position, mesh.star, v, x, -np.inf)
            rate = rate if given else ZERO
        step = newton_step(gradient, hessian)
        if -dot(step, gradient) > ROUNDING * magnitude:
            kind = given, nonlinear, curved
            now, limits = (now, ROUNDING * magnitude), (before, floor)
            further, w = search(mesh, trial, quadratic, v, step, rate, start, now, limits, kind)
    trial.value[v] += w
    if quadratic is not None and (further > 0.0 or not nonlinear):
        change_star(mesh, quadratic, v)
    return gain + further


@inner_kernel
def settled(mesh, trial, quadratic, v, w, total, curved):
    """Return a change of the value of v in place, and the decrease from `total`.

    Both are 0 if the functional does not decrease. At order 1 the value changes by up to w, and one more step of
    Newton's method. At order 2 the correction of the unknowns is applied, and values in the block remain
    relative to the former value of v, so that their source term is comparable.
    """
    if quadratic is not None:
        gain = total - corrected(mesh, quadratic, v)
        if not gain > 0.0:
            return 0.0, 0.0
        add_correction(quadratic.block, mesh.star.start[v + 1] - mesh.star.start[v], 1.0)
        change_star(mesh, quadratic, v)
        return 0.0, gain
    x = point(mesh.position, v)
    for _ in range(0 if trial.fixed[v] else TRIES):
        sizes, _, by_w, _, _, ww = star_of(mesh, trial, quadratic, v, x, w, BLOCK, curved)
        gain = total - sizes[1]
        if gain >= 0.0:
            further = w - by_w / ww
            more = total - star_of(mesh, trial, quadratic, v, x, further, BLOCK, curved)[0][1]
            return (further, more) if more > gain else (w, gain)
        w *= 0.5
    return 0.0, 0.0


@inner_kernel
def search(mesh, trial, quadratic, v, step, rate, start, now, limits, kind):
    """Return the decrease by a move, 0 if v stays, and the change of its value.

    `now` is the functional before the move and its rounding error, `limits` the worst quality before and the floor.
    After a move at order 2 `correction` belongs to the new position.
    """
    x = point(mesh.position, v)
    own = 0.0 if quadratic is None else quadratic.block.local[0, 0]
    surfaces = mesh.constraints.surfaces
    for _ in range(HALVINGS + 1):
        y = slid(mesh.position, mesh.constraints, v, step)
        if not kind[2] or within_reach(mesh.position, mesh.elements, mesh.star, surfaces, v, y):
            least, w, change = least_at(mesh, trial, quadratic, v, y, start + dot(rate, minus(y, x)), limits, kind)
            if now[0] - least > now[1]:
                put(mesh.position, v, y)
                if quadratic is not None:
                    take_correction(quadratic.block, change)
                return now[0] - least, w
            if quadratic is not None:
                place(mesh, quadratic.block, v, x, own)
        step = times(0.5, step)
    return 0.0, start


@inner_kernel
def least_at(mesh, trial, quadratic, v, y, w, limits, kind):
    """Return the least functional with v at y, and changes of values.

    The changes are those of the value of v, and at order 2 of the first unknown. The functional is inf if an element
    would be too bad. For nonlinear material of order 1 the candidates are w and one Newton step from w. At order 2 the
    node stays at y.
    """
    given, nonlinear, curved = kind
    if quadratic is not None:
        worst = star_quality(mesh.position, mesh.star, v, y, min(limits[1], limits[0]))
        if not allowed(worst, *limits):
            return np.inf, w, 0.0
        place(mesh, quadratic.block, v, y, quadratic.block.local[0, 0] + w)
    sizes, _, by_w, _, _, ww = star_of(mesh, trial, quadratic, v, y, w, BLOCK, curved)
    least, change = sizes[2], 0.0 if given else -by_w / ww
    least -= 0.5 * change * change * ww
    if quadratic is None:
        if not allowed(sizes[3], *limits):
            return np.inf, w, 0.0
        if nonlinear and not given:
            least = star_of(mesh, trial, quadratic, v, y, w + change, VALUE, curved)[0][1]
            if not least < sizes[1]:
                return sizes[1], w, 0.0
        return least, w + change, 0.0
    if nonlinear and least < np.inf:
        take_correction(quadratic.block, change)
        least = corrected(mesh, quadratic, v)
    return least, w, change


@inner_kernel
def take_correction(block, w):
    """Compute the change of the unknowns to the minimum, w for the first."""
    count = block.unknowns[0]
    for i in range(1, count):
        block.correction[i] = -block.rest[i]
    block.correction[0] = w * block.stiffness[0, 0]
    substitute(block.stiffness, block.correction, 0, count)


@inner_kernel
def corrected(mesh, quadratic, v):
    # Return the functional of the star after the correction of the unknowns, which are not changed.
    block, count = quadratic.block, mesh.star.start[v + 1] - mesh.star.start[v]
    add_correction(block, count, 1.0)
    total = derivatives_order2(mesh, quadratic, v, VALUE)[1]
    add_correction(block, count, -1.0)
    return total


@inner_kernel
def change_star(mesh, quadratic, v):
    star, block, modes = mesh.star, quadratic.block, quadratic.modes
    begin = star.start[v]
    quadratic.trial.value[v] += block.correction[0]
    for row in range(begin, star.start[v + 1]):
        e = star.element[row]
        k = corner_of(mesh.elements.node, e, v)
        for i in range(3):
            if block.dof[row - begin, 4 + i] >= 0:
                modes.side[e, EDGES_FROM[k, i], 0] += block.correction[block.dof[row - begin, 4 + i]]


@inner_kernel
def rates_row(constraints, v):
    place = constraints.freedom.place[v]
    if constraints.freedom.number[v] == ON_PATCH:
        return place
    return constraints.surfaces.shape.shape[0] + place


@inner_kernel
def follow_value(gradient, by_w, hessian, mixed, ww, rate):
    hessian = plus_products(hessian, plus_times(mixed, 0.5 * ww, rate), rate)
    return plus_times(gradient, by_w, rate), hessian


@inner_kernel
def tangential(mesh, v, gradient, hessian):
    surfaces, place = mesh.constraints.surfaces, mesh.constraints.freedom.place[v]
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
