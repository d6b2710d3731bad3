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
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    OFFSET,
    ON_PATCH,
    SHIFT_X,
    SHIFT_Y,
    SHIFT_Z,
    SIXTH_FLUX_X,
    SIXTH_FLUX_Y,
    SIXTH_FLUX_Z,
    TWELFTH_COEFFICIENT,
)
from kohonen_adapt.kernels.tetrahedron.geometry import allowed, squared_distance, sum_of_squares
from kohonen_adapt.kernels.tetrahedron.polish.applied_field import follows_field, rise_at
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING, source_around, value_at
from kohonen_adapt.kernels.tetrahedron.polish.slivers import has_slivers, sliver_gradient, slivers_around
from kohonen_adapt.kernels.tetrahedron.polish.star_values import best_value, improve_value, least_near, with_slivers
from kohonen_adapt.kernels.tetrahedron.surfaces import signed_distance, slid, tangent_of_ridge, within_reach

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
    x, y, z = position[v, 0], position[v, 1], position[v, 2]
    magnitude = total = by_x = by_y = by_z = by_w = 0.0
    xx = xy = xz = yy = yz = zz = xw = yw = zw = ww = 0.0
    worst, nonlinear = 2.0, False
    for j in range(star.start[v], star.start[v + 1]):
        a, b, c = star.link[j, 0], star.link[j, 1], star.link[j, 2]
        region = mesh.elements.region[star.element[j]]
        own = value_at(trial, region, v)
        ax, ay, az = position[a, 0] - x, position[a, 1] - y, position[a, 2] - z
        bx, by, bz = position[b, 0] - x, position[b, 1] - y, position[b, 2] - z
        cx, cy, cz = position[c, 0] - x, position[c, 1] - y, position[c, 2] - z
        alpha, beta, gamma = value_at(trial, region, a), value_at(trial, region, b), value_at(trial, region, c)
        alpha, beta, gamma = alpha - own, beta - own, gamma - own
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        six = ax * px + ay * py + az * pz
        squares = sum_of_squares(ax, ay, az, bx, by, bz, cx, cy, cz)
        worst = min(worst, 432.0 * six * abs(six) / (squares * squares * squares))
        sx, sy, sz = px + qx + rx, py + qy + ry, pz + qz + rz
        nx = alpha * px + beta * qx + gamma * rx
        ny = alpha * py + beta * qy + gamma * ry
        nz = alpha * pz + beta * qz + gamma * rz
        tx = alpha * (bx - cx) + beta * (cx - ax) + gamma * (ax - bx)
        ty = alpha * (by - cy) + beta * (cy - ay) + gamma * (ay - by)
        tz = alpha * (bz - cz) + beta * (cz - az) + gamma * (az - bz)
        inverse = 1.0 / six
        gx, gy, gz = inverse * nx, inverse * ny, inverse * nz
        # r by x, y, z; r by w is -S
        x_x, x_y, x_z = gx * sx, gy * sx - tz, gz * sx + ty
        y_x, y_y, y_z = gx * sy + tz, gy * sy, gz * sy - tx
        z_x, z_y, z_z = gx * sz - ty, gy * sz + tx, gz * sz
        law = trial.laws.number[region]
        if law >= 0:
            gx, gy, gz = gx - data[region, SHIFT_X], gy - data[region, SHIFT_Y], gz - data[region, SHIFT_Z]
        square = gx * gx + gy * gy + gz * gz
        g_x, g_y, g_z = gx * x_x + gy * x_y + gz * x_z, gx * y_x + gy * y_y + gz * y_z, gx * z_x + gy * z_y + gz * z_z
        g_w = -(gx * sx + gy * sy + gz * sz)
        if law >= 0:
            nonlinear = True
            density, rate, curve = energy_density(trial.laws, law, square)
            energy, weight, per_volume = six * density / 6.0, rate * inverse / 3.0, density / 6.0
            curve *= 2.0 * inverse / 3.0
            xx += curve * g_x * g_x
            xy += curve * g_x * g_y
            xz += curve * g_x * g_z
            yy += curve * g_y * g_y
            yz += curve * g_y * g_z
            zz += curve * g_z * g_z
            xw += curve * g_x * g_w
            yw += curve * g_y * g_w
            zw += curve * g_z * g_w
            ww += curve * g_w * g_w
        else:
            weight, per_volume = 2.0 * data[region, TWELFTH_COEFFICIENT] * inverse, data[region, TWELFTH_COEFFICIENT]
            per_volume *= square
            energy = per_volume * six
        load = source_around(trial, region, v)
        fx, fy, fz = data[region, SIXTH_FLUX_X], data[region, SIXTH_FLUX_Y], data[region, SIXTH_FLUX_Z]
        around = alpha + beta + gamma
        pull, push = load * six * around, fx * nx + fy * ny + fz * nz
        magnitude += energy + abs(pull) + abs(push)
        total += energy - pull - push
        along, lost = weight * six, load * around - per_volume  # dD/dx = -S
        by_x += along * g_x + lost * sx + fy * tz - fz * ty
        by_y += along * g_y + lost * sy + fz * tx - fx * tz
        by_z += along * g_z + lost * sz + fx * ty - fy * tx
        by_w += along * g_w - load * six + fx * sx + fy * sy + fz * sz
        xx += weight * (x_x * x_x + x_y * x_y + x_z * x_z)
        xy += weight * (x_x * y_x + x_y * y_y + x_z * y_z)
        xz += weight * (x_x * z_x + x_y * z_y + x_z * z_z)
        yy += weight * (y_x * y_x + y_y * y_y + y_z * y_z)
        yz += weight * (y_x * z_x + y_y * z_y + y_z * z_z)
        zz += weight * (z_x * z_x + z_y * z_y + z_z * z_z)
        xw += load * sx - weight * (x_x * sx + x_y * sy + x_z * sz)
        yw += load * sy - weight * (y_x * sx + y_y * sy + y_z * sz)
        zw += load * sz - weight * (z_x * sx + z_y * sy + z_z * sz)
        ww += weight * (sx * sx + sy * sy + sz * sz)
    hessian = xx, xy, xz, yy, yz, zz
    return (magnitude, total, worst, nonlinear), (by_x, by_y, by_z), by_w, hessian, (xw, yw, zw), ww


@inner_kernel
def move_node(mesh, trial, v, floor):
    if follows_field(trial, v):
        return slide_in_field(mesh, trial, v, floor)
    position, freedom, given = mesh.position, mesh.constraints.freedom, trial.fixed[v]
    (magnitude, total, before, nonlinear), gradient, by_w, hessian, mixed, ww = derivatives(mesh, trial, v)
    curved = has_slivers(mesh, trial, v)
    px, py, pz = position[v, 0], position[v, 1], position[v, 2]
    if curved:
        more, more_by_w, more_ww = slivers_around(mesh, trial, v, px, py, pz, 0.0)
        total, by_w, ww, pull = total + more, by_w + more_by_w, ww + more_ww, sliver_gradient(mesh, trial, v)
        gradient = gradient[0] + pull[0], gradient[1] + pull[1], gradient[2] + pull[2]
        magnitude, nonlinear = magnitude + abs(more), True  # the material across a face may be nonlinear
    unmoved, now = 0.0, total
    if given:
        row = rates_row(mesh.constraints, v)
        rate = trial.rate[row, 0], trial.rate[row, 1], trial.rate[row, 2]
    else:
        rate = -mixed[0] / ww, -mixed[1] / ww, -mixed[2] / ww
        unmoved, now = -by_w / ww, total - 0.5 * by_w * by_w / ww
    gradient, hessian = follow_value(gradient, by_w, hessian, mixed, ww, rate)
    if freedom.number[v] != INSIDE:
        gradient, hessian = tangential(mesh, v, gradient, hessian)
    dx, dy, dz = newton_step(gradient, hessian)
    if -(dx * gradient[0] + dy * gradient[1] + dz * gradient[2]) > ROUNDING * magnitude:
        if nonlinear and not given:
            now, unmoved, _ = best_value(mesh, trial, v, (px, py, pz), unmoved, nonlinear, curved)
            now = min(now, total)
        for _ in range(HALVINGS + 1):
            x, y, z = slid(position, mesh.constraints, v, dx, dy, dz)
            w = rate[0] * (x - px) + rate[1] * (y - py) + rate[2] * (z - pz)
            if given:
                least, _, _, worst = with_slivers(mesh, trial, v, x, y, z, w, curved)
            else:
                least, w, worst = best_value(mesh, trial, v, (x, y, z), unmoved + w, nonlinear, curved)
            if (
                allowed(worst, before, floor)
                and now - least > ROUNDING * magnitude
                and turn_allowed(mesh, v, curved, x, y, z)
            ):
                position[v, 0], position[v, 1], position[v, 2] = x, y, z
                trial.value[v] += w
                return total - least
            dx, dy, dz = 0.5 * dx, 0.5 * dy, 0.5 * dz
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
    px, py, pz = mesh.position[v, 0], mesh.position[v, 1], mesh.position[v, 2]
    total, _, _, before = with_slivers(mesh, trial, v, px, py, pz, 0.0, False)
    now, unmoved, _ = best_value(mesh, trial, v, (px, py, pz), 0.0, True, False)
    gradient, hessian = differences(mesh, trial, v, unmoved)
    gradient, hessian = tangential(mesh, v, gradient, hessian)
    dx, dy, dz = newton_step(gradient, hessian)
    for _ in range(HALVINGS + 1):
        x, y, z = slid(mesh.position, mesh.constraints, v, dx, dy, dz)
        least, w, worst = best_value(mesh, trial, v, (x, y, z), unmoved, True, False)
        if allowed(worst, before, floor) and now - least > ROUNDING * abs(total):
            trial.surface[v, OFFSET] -= rise_at(mesh, trial, v, x, y, z)
            mesh.position[v, 0], mesh.position[v, 1], mesh.position[v, 2] = x, y, z
            trial.value[v] += w
            return total - least
        dx, dy, dz = 0.5 * dx, 0.5 * dy, 0.5 * dz
    return improve_value(mesh, trial, v, False)


@inner_kernel
def differences(mesh, trial, v, w):
    # gradient and Hessian of the functional by the position of v, with the best value near w
    other = mesh.star.link[mesh.star.start[v], 0]
    x, y, z = mesh.position[v, 0], mesh.position[v, 1], mesh.position[v, 2]
    h = STEP * math.sqrt(squared_distance(mesh.position, v, other))
    now = least_near(mesh, trial, v, x, y, z, w)
    right, left = least_near(mesh, trial, v, x + h, y, z, w), least_near(mesh, trial, v, x - h, y, z, w)
    far, near = least_near(mesh, trial, v, x, y + h, z, w), least_near(mesh, trial, v, x, y - h, z, w)
    above, below = least_near(mesh, trial, v, x, y, z + h, w), least_near(mesh, trial, v, x, y, z - h, w)
    xy = least_near(mesh, trial, v, x + h, y + h, z, w) - right - far + now
    xz = least_near(mesh, trial, v, x + h, y, z + h, w) - right - above + now
    yz = least_near(mesh, trial, v, x, y + h, z + h, w) - far - above + now
    half, square = 0.5 / h, 1.0 / (h * h)
    xx, yy, zz = right - 2.0 * now + left, far - 2.0 * now + near, above - 2.0 * now + below
    hessian = square * xx, square * xy, square * xz, square * yy, square * yz, square * zz
    return (half * (right - left), half * (far - near), half * (above - below)), hessian


@inner_kernel
def turn_allowed(mesh, v, curved, x, y, z):
    if not curved:
        return True
    return within_reach(mesh.position, mesh.elements, mesh.star, mesh.constraints.surfaces, v, x, y, z)


@inner_kernel
def rates_row(constraints, v):
    place = np.int64(constraints.freedom.place[v])
    if constraints.freedom.number[v] == ON_PATCH:
        return place
    return constraints.surfaces.shape.shape[0] + place


@inner_kernel
def follow_value(gradient, by_w, hessian, mixed, ww, rate):
    (gx, gy, gz), (xx, xy, xz, yy, yz, zz), (mx, my, mz), (x, y, z) = gradient, hessian, mixed, rate
    px, py, pz = mx + 0.5 * ww * x, my + 0.5 * ww * y, mz + 0.5 * ww * z
    hessian = (
        xx + 2.0 * px * x,
        xy + px * y + py * x,
        xz + px * z + pz * x,
        yy + 2.0 * py * y,
        yz + py * z + pz * y,
        zz + 2.0 * pz * z,
    )
    return (gx + by_w * x, gy + by_w * y, gz + by_w * z), hessian


@inner_kernel
def multiply(hessian, x, y, z):
    xx, xy, xz, yy, yz, zz = hessian
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inner_kernel
def tangential(mesh, v, gradient, hessian):
    surfaces, place = mesh.constraints.surfaces, np.int64(mesh.constraints.freedom.place[v])
    px, py, pz = mesh.position[v, 0], mesh.position[v, 1], mesh.position[v, 2]
    gx, gy, gz = gradient
    if mesh.constraints.freedom.number[v] == ON_PATCH:
        _, x, y, z = signed_distance(surfaces, place, px, py, pz)
        across = gx * x + gy * y + gz * z
        hx, hy, hz = multiply(hessian, x, y, z)
        half = 0.5 * (hx * x + hy * y + hz * z)
        hx, hy, hz = hx - half * x, hy - half * y, hz - half * z
        xx, xy, xz, yy, yz, zz = hessian
        hessian = (
            xx - 2.0 * hx * x,
            xy - hx * y - hy * x,
            xz - hx * z - hz * x,
            yy - 2.0 * hy * y,
            yz - hy * z - hz * y,
            zz - 2.0 * hz * z,
        )
        return (gx - across * x, gy - across * y, gz - across * z), hessian
    x, y, z = tangent_of_ridge(surfaces, place, px, py, pz)
    along = gx * x + gy * y + gz * z
    hx, hy, hz = multiply(hessian, x, y, z)
    k = hx * x + hy * y + hz * z
    return (along * x, along * y, along * z), (k * x * x, k * x * y, k * x * z, k * y * y, k * y * z, k * z * z)


@inner_kernel
def newton_step(gradient, hessian):
    """Return an over-relaxed descent step with magnitudes of the eigenvalues.

    The eigenvectors are computed by Jacobi rotations in the plane of x and y. The axes are permuted cyclically
    after each rotation, so that every pair of axes is rotated.
    """
    (gx, gy, gz), (xx, xy, xz, yy, yz, zz) = gradient, hessian
    ux, uy, uz, vx, vy, vz, wx, wy, wz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    enough = DIAGONAL * (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz))
    for _ in range(TURNS):
        if xy * xy + xz * xz + yz * yz <= enough:
            break
        if xy != 0.0:
            half = 0.5 * (yy - xx) / xy
            tangent = math.copysign(1.0 / (abs(half) + math.sqrt(half * half + 1.0)), half)
            c = 1.0 / math.sqrt(tangent * tangent + 1.0)
            s = tangent * c
            xx, yy, xz, yz = xx - tangent * xy, yy + tangent * xy, c * xz - s * yz, s * xz + c * yz
            ux, vx, uy, vy = c * ux - s * vx, s * ux + c * vx, c * uy - s * vy, s * uy + c * vy
            uz, vz = c * uz - s * vz, s * uz + c * vz
            xy = 0.0
        xx, yy, zz, xy, yz, xz = yy, zz, xx, yz, xz, xy
        ux, uy, uz, vx, vy, vz, wx, wy, wz = vx, vy, vz, wx, wy, wz, ux, uy, uz
    least = LEAST_CURVATURE * max(abs(xx), abs(yy), abs(zz))
    if not least > 0.0:
        return 0.0, 0.0, 0.0
    a = -OVERSTEP * (gx * ux + gy * uy + gz * uz) / max(abs(xx), least)
    b = -OVERSTEP * (gx * vx + gy * vy + gz * vz) / max(abs(yy), least)
    c = -OVERSTEP * (gx * wx + gy * wy + gz * wz) / max(abs(zz), least)
    return a * ux + b * vx + c * wx, a * uy + b * vy + c * wy, a * uz + b * vz + c * wz
