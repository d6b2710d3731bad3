"""Smoothing of tetrahedra to a node density, by Newton's method.

The sum over elements of w S^4 / |K| is minimised, with S the sum of the squared edges and the weight w =
rho^(5/3). For good elements the summand is, up to a constant, the squared interpolation error |K|^(5/3)
rho^(5/3) of a function for whose second derivatives the density is optimal, as in optimal Delaunay smoothing
(Chen and Xu, "Optimal Delaunay triangulations", J. Comput. Math. 22, 2004), times 1 / quality to the fourth
power, which penalises slivers (good edges without volume). In the position of one node S is quadratic and |K|
linear, so the sum is convex. In a metric the edges of S are measured by the mean shape of the corners.
"""

from kohonen_adapt.kernels.arrays import BY_QUALITY, BY_REACH, HALVINGS, MOVED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, ON_PATCH, PLANE
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, allowed, cubed_of, others, sum_of_squares
from kohonen_adapt.kernels.tetrahedron.metric import ROUND, is_round, mean_of_four, relieved, squares_in_metric
from kohonen_adapt.kernels.tetrahedron.surfaces import (
    signed_distance,
    slid,
    tangent_of_ridge,
    within_reach,
)
from kohonen_adapt.kernels.vectors import (
    ZERO,
    ZEROS,
    cross,
    determinant,
    dot,
    from_to,
    minus,
    norm,
    plus,
    plus_square,
    plus_times,
    point,
    product,
    put,
    times,
    weighted,
)


@inner_kernel
def star_energy(position, star, metric, weight, v, x):
    total, worst = 0.0, 2.0
    for j in rows_of(star, v):
        b, c, d = others(star, j)
        p, q, r = from_to(x, position, b), from_to(x, position, c), from_to(x, position, d)
        volume, squares = dot(p, cross(q, r)), sum_of_squares(p, q, r)
        quality = cubed_of(volume, squares)
        if not is_round(metric):
            shape = mean_of_four(metric.shape, v, b, c, d)
            squares = squares_in_metric(shape, p, q, r)
            if metric.relief != 1.0:
                in_metric = 432.0 * determinant(shape) * volume * abs(volume) / (squares * squares * squares)
                quality = relieved(metric, quality, in_metric)
        if not quality >= worst:
            worst = quality
            if not quality > FLAT:
                break
        squares *= squares
        total += weight[star.element[j]] * squares * squares / volume
    return total, worst


@inner_kernel
def derivatives(position, star, metric, weight, v):
    x = point(position, v)
    gradient, hessian = ZERO, ZEROS
    for j in rows_of(star, v):
        b, c, d = others(star, j)
        p, q, r = from_to(x, position, b), from_to(x, position, c), from_to(x, position, d)
        normal = cross(q, r)
        shape = ROUND if is_round(metric) else mean_of_four(metric.shape, v, b, c, d)
        volume, squares = dot(p, normal), squares_in_metric(shape, p, q, r)
        energy = squares * squares
        energy *= energy * weight[star.element[j]] / volume
        by_square = times(-2.0 / squares, product(shape, plus(plus(p, q), r)))
        # gradient of the volume is minus the sum
        by_volume = times(-1.0 / volume, plus(normal, plus(cross(r, p), cross(p, q))))
        gradient = plus_times(gradient, energy, minus(times(4.0, by_square), by_volume))
        # 12 s s - 4 (s p + p s) + 2 p p = 2 (p - 2 s) (p - 2 s) + 4 s s
        both = plus_square(ZEROS, 2.0, plus_times(by_volume, -2.0, by_square))
        both = plus_times(plus_square(both, 4.0, by_square), 24.0 / squares, shape)
        hessian = plus_times(hessian, energy, both)
    return gradient, hessian


@inner_kernel
def step_inside(gradient, hessian):
    xx, xy, xz, yy, yz, zz = hessian
    a, b, c = yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    return times(-1.0 / (xx * a + xy * b + xz * c), product((a, b, c, d, e, f), gradient))


@inner_kernel
def step_across(normal, gradient, hessian):
    x, y, z = normal
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        t = 0.0, z, -y
    elif abs(y) <= abs(z):
        t = -z, 0.0, x
    else:
        t = y, -x, 0.0
    t = times(1.0 / norm(t), t)
    s = cross(normal, t)
    along = product(hessian, t)
    tt, st, ss = dot(t, along), dot(s, along), dot(s, product(hessian, s))
    gt, gs = dot(gradient, t), dot(gradient, s)
    scale = -1.0 / (tt * ss - st * st)
    return weighted(scale * (ss * gt - st * gs), t, scale * (tt * gs - st * gt), s)


@inner_kernel
def newton_step(position, star, constraints, weight, v):
    surfaces, freedom = constraints.surfaces, constraints.freedom
    gradient, hessian = derivatives(position, star, constraints.metric, weight, v)
    x = point(position, v)
    place = freedom.place[v]
    if freedom.number[v] == INSIDE:
        return step_inside(gradient, hessian)
    if freedom.number[v] == ON_PATCH:
        return step_across(signed_distance(surfaces, place, x)[1], gradient, hessian)
    tangent = tangent_of_ridge(surfaces, place, x)
    return times(-dot(gradient, tangent) / dot(tangent, product(hessian, tangent)), tangent)


@inner_kernel
def is_curved(surfaces, freedom, v):
    return freedom.number[v] != INSIDE and not (
        freedom.number[v] == ON_PATCH and surfaces.shape[freedom.place[v]] == PLANE
    )


@kernel
def smooth_nodes(mesh, weight, floor, order):
    """Move nodes in order by damped Newton steps.

    `weight` (m,) is rho^(5/3) up to a factor, `floor` the cube of a quality. Returned are the numbers of nodes whose
    move the quality and the reach refused.
    """
    by_quality, by_reach = 0, 0
    position, elements, star = mesh.position, mesh.elements, mesh.star
    surfaces, freedom, metric = mesh.constraints.surfaces, mesh.constraints.freedom, mesh.constraints.metric
    for v in order:
        if freedom.number[v] == HELD or freedom.pinned[v]:
            continue
        before, worst_before = star_energy(position, star, metric, weight, v, point(position, v))
        step = newton_step(position, star, mesh.constraints, weight, v)
        curved = is_curved(surfaces, freedom, v)
        cause = MOVED
        for _ in range(HALVINGS + 1):
            x = slid(position, mesh.constraints, v, step)
            after, worst = star_energy(position, star, metric, weight, v, x)
            cause = MOVED
            if not allowed(worst, worst_before, floor):
                cause = BY_QUALITY
            elif after < before:
                if not curved or within_reach(position, elements, star, surfaces, v, x):
                    put(position, v, x)
                    break
                cause = BY_REACH
            step = times(0.5, step)
        by_quality += cause == BY_QUALITY
        by_reach += cause == BY_REACH
    return by_quality, by_reach
