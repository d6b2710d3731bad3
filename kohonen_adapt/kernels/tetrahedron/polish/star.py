"""Ritz functional of the elements around a node, with derivatives.

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

At order 2 the unknowns of a node are its value and the coefficients of its edges. The latter are eliminated, so that
both orders have derivatives by place and value.
"""

import numpy as np

from kohonen_adapt.kernels.functionals import clear, eliminate, energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD, POSITION, UNKNOWNS, VALUE
from kohonen_adapt.kernels.tetrahedron.geometry import (
    EDGES,
    OPPOSITE,
    corner_of,
    corners_around,
    cubed_of,
    others,
    sum_of_squares,
)
from kohonen_adapt.kernels.tetrahedron.polish.energy import less_shift, source_around, value_at
from kohonen_adapt.kernels.tetrahedron.polish.energy_order2 import add_element
from kohonen_adapt.kernels.tetrahedron.polish.slivers import slivers_around
from kohonen_adapt.kernels.vectors import (
    ZERO,
    ZEROS,
    between,
    cofactors,
    combined,
    dot,
    from_to,
    gram,
    minus,
    norm,
    plus,
    plus_cross,
    plus_dot,
    plus_square,
    plus_times,
    point,
    put,
    times,
    weighted,
)

STEP = 1e-4  # of differences, relative to an edge
EDGE_OF = np.full((4, 4), -1)  # edge between two corners
EDGE_OF[EDGES[:, 0], EDGES[:, 1]] = EDGE_OF[EDGES[:, 1], EDGES[:, 0]] = np.arange(6)
ORDERS = np.column_stack([np.arange(4), OPPOSITE])
EDGES_FROM = EDGE_OF[ORDERS[:, EDGES[:, 0]], ORDERS[:, EDGES[:, 1]]]  # edges between the corners (k, *OPPOSITE[k])


@inner_kernel
def derivatives(mesh, trial, v, x, w, wanted):
    """Return the functional of order 1 of the star of v at x, and derivatives.

    The value of v is changed by w. Returned are (sum of magnitudes, value, worst cubed
    quality, True if nonlinear), the gradient by (x, y, z), by w, the Hessian by (xx, xy, xz, yy, yz, zz), by (xw, yw,
    zw), and by ww. Derivatives by place are those of the level POSITION only. Values are relative to the value of v,
    which shifts the load by a constant, because moves do not change the volume of the star in any region.
    """
    position, star = mesh.position, mesh.star
    magnitude = total = by_w = ww = 0.0
    gradient, hessian, mixed = ZERO, ZEROS, ZERO
    worst, nonlinear = 2.0, False
    for row in rows_of(star, v):
        i, j, k = others(star, row)
        region = mesh.elements.region[star.element[row]]
        a, b, c = from_to(x, position, i), from_to(x, position, j), from_to(x, position, k)
        law, own = trial.laws.number[region], value_at(trial, region, v) + w
        alpha, beta = value_at(trial, region, i) - own, value_at(trial, region, j) - own
        gamma = value_at(trial, region, k) - own
        p, q, r = cofactors(a, b, c)
        six = dot(a, p)
        quality = cubed_of(six, sum_of_squares(a, b, c))
        if not quality >= worst:
            worst = quality
        s, n = plus(plus(p, q), r), combined(alpha, p, beta, q, gamma, r)
        inverse = 1.0 / six
        slope = times(inverse, n)
        g = less_shift(trial, region, slope)
        square, g_w = dot(g, g), -dot(g, s)
        curve = 0.0
        if law >= 0:
            nonlinear = True
            density, rate, curve = energy_density(trial.laws, law, square)
            energy, per_volume = six * density / 6.0, density / 6.0
            weight = rate * inverse / 3.0
            curve *= 2.0 * inverse / 3.0
            ww += curve * g_w * g_w
        else:
            weight, per_volume = 2.0 * trial.twelfth[region] * inverse, trial.twelfth[region]
            per_volume *= square
            energy = per_volume * six
        load, flux = source_around(trial, region, v), point(trial.sixth_flux, region)
        around, volume = alpha + beta + gamma, weight * six
        pull, push = load * six * (around + 4.0 * w), dot(flux, n)
        magnitude += energy + abs(pull) + abs(push)
        total += energy - pull - push
        by_w += plus_dot(volume * g_w - load * six, flux, s)
        ww += weight * dot(s, s)
        if wanted < POSITION:
            continue
        t = combined(alpha, minus(b, c), beta, minus(c, a), gamma, minus(a, b))
        # r by x, y, z; r by w is -S
        x_r = slope[0] * s[0], slope[1] * s[0] - t[2], slope[2] * s[0] + t[1]
        y_r = slope[0] * s[1] + t[2], slope[1] * s[1], slope[2] * s[1] - t[0]
        z_r = slope[0] * s[2] - t[1], slope[1] * s[2] + t[0], slope[2] * s[2]
        along = dot(g, x_r), dot(g, y_r), dot(g, z_r)
        if law >= 0:
            hessian = plus_square(hessian, curve, along)
            mixed = plus_times(mixed, g_w, times(curve, along))
        lost = load * around - per_volume  # dD/dx = -S
        gradient = plus(gradient, plus_cross(weighted(volume, along, lost, s), flux, t))
        hessian = plus_times(hessian, weight, gram(x_r, y_r, z_r))
        mixed = plus(mixed, weighted(load, s, -weight, (dot(x_r, s), dot(y_r, s), dot(z_r, s))))
    return (magnitude, total, worst, nonlinear), gradient, by_w, hessian, mixed, ww


@inner_kernel
def gradient_of_slivers(mesh, trial, v):
    h = STEP * norm(between(mesh.position, v, mesh.star.link[mesh.star.start[v], 0]))
    x, y, z = (h, 0.0, 0.0), (0.0, h, 0.0), (0.0, 0.0, h)
    return times(
        0.5 / h,
        (
            slivers_after(mesh, trial, v, x) - slivers_after(mesh, trial, v, times(-1.0, x)),
            slivers_after(mesh, trial, v, y) - slivers_after(mesh, trial, v, times(-1.0, y)),
            slivers_after(mesh, trial, v, z) - slivers_after(mesh, trial, v, times(-1.0, z)),
        ),
    )


@inner_kernel
def slivers_after(mesh, trial, v, step):
    return slivers_around(mesh, trial, v, plus(point(mesh.position, v), step), 0.0)[0]


@inner_kernel
def place(mesh, block, v, x, value):
    put(mesh.position, v, x)
    for row in range(mesh.star.start[v + 1] - mesh.star.start[v]):
        block.local[row, 0] = value


@inner_kernel
def star_of_order_1(mesh, trial, v, x, w, wanted, curved):
    (magnitude, total, worst, nonlinear), gradient, by_w, hessian, mixed, ww = derivatives(mesh, trial, v, x, w, wanted)
    if trial.surface.shape[0] > 0:
        total, by_w = total - trial.surface[v, LOAD] * w, by_w - trial.surface[v, LOAD]
    if curved:
        more = slivers_around(mesh, trial, v, x, w)
        total, by_w, ww = plus((total, by_w, ww), more)
        magnitude, nonlinear = magnitude + abs(more[0]), True  # the material across a face may be nonlinear
        if wanted == POSITION:
            gradient = plus(gradient, gradient_of_slivers(mesh, trial, v))
    return (magnitude, total, total, worst, nonlinear), gradient, by_w, hessian, mixed, ww


@inner_kernel
def number_star(mesh, quadratic, v):
    star, block, modes, trial = mesh.star, quadratic.block, quadratic.modes, quadratic.trial
    begin, own = star.start[v], trial.value[v]
    count = 1
    if star.start[v + 1] - begin > block.local.shape[0]:
        return False
    for row in range(begin, star.start[v + 1]):
        j, e = row - begin, star.element[row]
        k, region = corner_of(mesh.elements.node, e, v), mesh.elements.region[e]
        for i in range(10):
            block.dof[j, i] = -1
        block.local[j, 0], block.dof[j, 0] = value_at(trial, region, v) - own, 0
        for i in range(6):
            block.local[j, 4 + i] = modes.side[e, EDGES_FROM[k, i], 0]
        for i in range(3):
            other = star.link[row, i]
            block.local[j, 1 + i] = value_at(trial, region, other) - own
            if modes.dirichlet[e, EDGES_FROM[k, i]]:
                continue
            s = 1
            while s < count and block.end[s, 0] != other:
                s += 1
            if s == count:
                if count == UNKNOWNS:
                    return False
                block.end[s, 0] = other
                count += 1
            block.dof[j, 4 + i] = s
    block.unknowns[0] = count
    return True


@inner_kernel
def derivatives_order2(mesh, quadratic, v, wanted):
    star, trial, block = mesh.star, quadratic.trial, quadratic.block
    magnitude = total = 0.0
    gradient, hessian = ZERO, ZEROS
    if wanted > VALUE:
        clear(block, block.unknowns[0])
    begin = star.start[v]
    for row in range(begin, star.start[v + 1]):
        region, corners = mesh.elements.region[star.element[row]], corners_around(star, row, v)
        load = source_around(trial, region, v)
        part = add_element(mesh.position, trial, block, row - begin, region, load, corners, wanted)
        magnitude, total = magnitude + part[0], total + part[1]
        gradient, hessian = plus(gradient, part[2]), plus(hessian, part[3])
    return magnitude, total, gradient, hessian


@inner_kernel
def has_law(mesh, trial, v):
    for row in rows_of(mesh.star, v):
        if trial.laws.number[mesh.elements.region[mesh.star.element[row]]] >= 0:
            return True
    return False


@inner_kernel
def star_of_order_2(mesh, quadratic, v, wanted):
    block, count = quadratic.block, quadratic.block.unknowns[0]
    magnitude, total, gradient, hessian = derivatives_order2(mesh, quadratic, v, wanted)
    columns, square = 3 if wanted == POSITION else 0, 0.0
    nonlinear = has_law(mesh, quadratic.trial, v)
    solved = total < np.inf and eliminate(block.stiffness, block.rest, block.mixed, columns, 0, count)[0]
    for i in range(1, count if solved else 1):
        rest, mixed = block.rest[i], point(block.mixed, i)
        square += rest * rest
        gradient, hessian = plus_times(gradient, -rest, mixed), plus_square(hessian, -1.0, mixed)
    least, root = (total - 0.5 * square if solved else np.inf), block.stiffness[0, 0]
    mixed = times(root, point(block.mixed, 0))
    return (magnitude, total, least, 0.0, nonlinear), gradient, root * block.rest[0], hessian, mixed, root * root


@inner_kernel
def star_of(mesh, trial, quadratic, v, x, w, wanted, curved):
    """Return the functional of the star of v at x, and derivatives.

    The value of v is changed by w. At order 2 the edges of v are eliminated, and place and value must be those of x and
    w already. Returned are (sum of magnitudes, value, value after the elimination or inf if this fails, worst cubed
    quality at order 1, True if nonlinear) and the derivatives of `derivatives`.
    """
    if quadratic is None:
        return star_of_order_1(mesh, trial, v, x, w, wanted, curved)
    return star_of_order_2(mesh, quadratic, v, wanted)
