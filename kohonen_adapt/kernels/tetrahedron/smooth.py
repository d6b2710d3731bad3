"""Smoothing of tetrahedra to a node density, by Newton's method.

The sum over elements of w S^4 / |K| is minimised, with S the sum of the squared edges and the weight w =
rho^(5/3). For good elements the summand is, up to a constant, the squared interpolation error |K|^(5/3)
rho^(5/3) of a function for whose second derivatives the density is optimal, as in optimal Delaunay smoothing
(Chen and Xu, "Optimal Delaunay triangulations", J. Comput. Math. 22, 2004), times 1 / quality to the fourth
power, which penalises slivers (good edges without volume). In the position of one node S is quadratic and |K|
linear, so the sum is convex. In a metric the edges of S are measured by the mean shape of the corners.
"""

import numpy as np

from kohonen_adapt.kernels.arrays import BY_QUALITY, BY_REACH, HALVINGS, MOVED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, ON_PATCH, PLANE
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, allowed, sum_of_squares
from kohonen_adapt.kernels.tetrahedron.metric import is_round, mean_of_four, mean_shape, relieved, squares_in_metric
from kohonen_adapt.kernels.tetrahedron.surfaces import (
    signed_distance,
    slid,
    tangent_of_ridge,
    within_reach,
)
from kohonen_adapt.kernels.tetrahedron.vectors import cross, determinant, dot, from_to, plus, product


@inner_kernel
def star_energy(position, star, metric, weight, v, x, y, z):
    total, worst = 0.0, 2.0
    for j in range(star.start[v], star.start[v + 1]):
        b, c, d = star.link[j, 0], star.link[j, 1], star.link[j, 2]
        ux, uy, uz = position[b, 0] - x, position[b, 1] - y, position[b, 2] - z
        vx, vy, vz = position[c, 0] - x, position[c, 1] - y, position[c, 2] - z
        wx, wy, wz = position[d, 0] - x, position[d, 1] - y, position[d, 2] - z
        volume = ux * (vy * wz - vz * wy) + uy * (vz * wx - vx * wz) + uz * (vx * wy - vy * wx)
        squares = sum_of_squares(ux, uy, uz, vx, vy, vz, wx, wy, wz)
        quality = 432.0 * volume * abs(volume) / (squares * squares * squares)
        if not is_round(metric):
            shape = mean_of_four(metric.shape, v, b, c, d)
            squares = squares_in_metric(shape, (ux, uy, uz), (vx, vy, vz), (wx, wy, wz))
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
    x = position[v, 0], position[v, 1], position[v, 2]
    gx = gy = gz = xx = xy = xz = yy = yz = zz = 0.0
    for j in range(star.start[v], star.start[v + 1]):
        b, c, d = star.link[j, 0], star.link[j, 1], star.link[j, 2]
        p, q, r = from_to(x, position, b), from_to(x, position, c), from_to(x, position, d)
        shape, normal, total = mean_shape(metric, v, b, c, d), cross(q, r), plus(plus(p, q), r)
        volume, squares = dot(p, normal), squares_in_metric(shape, p, q, r)
        total = product(shape, total)
        px, py, pz = plus(normal, plus(cross(r, p), cross(p, q)))  # gradient of the volume is -p
        energy, per_volume, per_square = squares * squares, -1.0 / volume, -2.0 / squares
        energy *= energy * weight[star.element[j]] / volume
        px, py, pz = per_volume * px, per_volume * py, per_volume * pz
        sx, sy, sz = per_square * total[0], per_square * total[1], per_square * total[2]
        gx += energy * (4.0 * sx - px)
        gy += energy * (4.0 * sy - py)
        gz += energy * (4.0 * sz - pz)
        # 12 s s - 4 (s p + p s) + 2 p p = 2 (p - 2 s) (p - 2 s) + 4 s s
        px, py, pz = px - 2.0 * sx, py - 2.0 * sy, pz - 2.0 * sz
        even = 24.0 / squares
        xx += energy * (2.0 * px * px + 4.0 * sx * sx + even * shape[0])
        xy += energy * (2.0 * px * py + 4.0 * sx * sy + even * shape[1])
        xz += energy * (2.0 * px * pz + 4.0 * sx * sz + even * shape[2])
        yy += energy * (2.0 * py * py + 4.0 * sy * sy + even * shape[3])
        yz += energy * (2.0 * py * pz + 4.0 * sy * sz + even * shape[4])
        zz += energy * (2.0 * pz * pz + 4.0 * sz * sz + even * shape[5])
    return (gx, gy, gz), (xx, xy, xz, yy, yz, zz)


@inner_kernel
def step_inside(gradient, hessian):
    (gx, gy, gz), (xx, xy, xz, yy, yz, zz) = gradient, hessian
    a, b, c = yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    scale = -1.0 / (xx * a + xy * b + xz * c)
    return (
        scale * (a * gx + b * gy + c * gz),
        scale * (b * gx + d * gy + e * gz),
        scale * (c * gx + e * gy + f * gz),
    )


@inner_kernel
def multiply(tx, ty, tz, hessian):
    xx, xy, xz, yy, yz, zz = hessian
    return xx * tx + xy * ty + xz * tz, xy * tx + yy * ty + yz * tz, xz * tx + yz * ty + zz * tz


@inner_kernel
def step_across(nx, ny, nz, gradient, hessian):
    gx, gy, gz = gradient
    if abs(nx) <= abs(ny) and abs(nx) <= abs(nz):
        tx, ty, tz = 0.0, nz, -ny
    elif abs(ny) <= abs(nz):
        tx, ty, tz = -nz, 0.0, nx
    else:
        tx, ty, tz = ny, -nx, 0.0
    scale = 1.0 / np.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = scale * tx, scale * ty, scale * tz
    sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    hx, hy, hz = multiply(tx, ty, tz, hessian)
    tt, st = tx * hx + ty * hy + tz * hz, sx * hx + sy * hy + sz * hz
    hx, hy, hz = multiply(sx, sy, sz, hessian)
    ss, gt, gs = sx * hx + sy * hy + sz * hz, gx * tx + gy * ty + gz * tz, gx * sx + gy * sy + gz * sz
    scale = -1.0 / (tt * ss - st * st)
    t, s = scale * (ss * gt - st * gs), scale * (tt * gs - st * gt)
    return t * tx + s * sx, t * ty + s * sy, t * tz + s * sz


@inner_kernel
def newton_step(position, star, constraints, weight, v):
    x, y, z = position[v, 0], position[v, 1], position[v, 2]
    surfaces, freedom = constraints.surfaces, constraints.freedom
    gradient, hessian = derivatives(position, star, constraints.metric, weight, v)
    place = np.int64(freedom.place[v])
    if freedom.number[v] == INSIDE:
        return step_inside(gradient, hessian)
    if freedom.number[v] == ON_PATCH:
        _, nx, ny, nz = signed_distance(surfaces, place, x, y, z)
        return step_across(nx, ny, nz, gradient, hessian)
    tx, ty, tz = tangent_of_ridge(surfaces, place, x, y, z)
    hx, hy, hz = multiply(tx, ty, tz, hessian)
    gx, gy, gz = gradient
    length = -(gx * tx + gy * ty + gz * tz) / (tx * hx + ty * hy + tz * hz)
    return length * tx, length * ty, length * tz


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
    for node in order:
        v = np.int64(node)
        if freedom.number[v] == HELD or freedom.pinned[v]:
            continue
        x, y, z = position[v, 0], position[v, 1], position[v, 2]
        before, worst_before = star_energy(position, star, metric, weight, v, x, y, z)
        dx, dy, dz = newton_step(position, star, mesh.constraints, weight, v)
        curved, cause = is_curved(surfaces, freedom, v), MOVED
        for _ in range(HALVINGS + 1):
            x, y, z = slid(position, mesh.constraints, v, dx, dy, dz)
            after, worst = star_energy(position, star, metric, weight, v, x, y, z)
            cause = MOVED
            if not allowed(worst, worst_before, floor):
                cause = BY_QUALITY
            elif after < before:
                if not curved or within_reach(position, elements, star, surfaces, v, x, y, z):
                    position[v, 0], position[v, 1], position[v, 2] = x, y, z
                    break
                cause = BY_REACH
            dx, dy, dz = 0.5 * dx, 0.5 * dy, 0.5 * dz
        by_quality, by_reach = by_quality + (cause == BY_QUALITY), by_reach + (cause == BY_REACH)
    return by_quality, by_reach
