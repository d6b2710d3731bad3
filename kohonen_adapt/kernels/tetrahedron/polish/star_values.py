"""Ritz functional of a P1 function around a node, by place and value there."""

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import (
    LOAD,
    REDUCED,
    SIXTH_FLUX_X,
    SIXTH_FLUX_Y,
    SIXTH_FLUX_Z,
    TWELFTH_COEFFICIENT,
)
from kohonen_adapt.kernels.tetrahedron.geometry import sum_of_squares
from kohonen_adapt.kernels.tetrahedron.polish.applied_field import follows_field, rise_at, work_around
from kohonen_adapt.kernels.tetrahedron.polish.energy import shifted, source_around, value_at
from kohonen_adapt.kernels.tetrahedron.polish.slivers import slivers_around

TRIES = 4  # halvings of a Newton step of a value in nonlinear material


@inner_kernel
def parabola(mesh, trial, v, x, y, z, w, rise):
    """Return functional, derivatives by w (first, second), and worst cubed quality.

    Node v is at (x, y, z) with its value changed by w, in reduced regions by w + rise. Values are relative to the
    value of v as in `derivatives`. Without laws the functional is a parabola in w.
    """
    position, star, data = mesh.position, mesh.star, trial.data
    total = by_w = ww = 0.0
    worst = 2.0
    for j in range(star.start[v], star.start[v + 1]):
        a, b, c = star.link[j, 0], star.link[j, 1], star.link[j, 2]
        region = mesh.elements.region[star.element[j]]
        change = w + data[region, REDUCED] * rise
        own = value_at(trial, region, v) + change
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
        quality = 432.0 * six * abs(six) / (squares * squares * squares)
        if not quality >= worst:
            worst = quality
        sx, sy, sz = px + qx + rx, py + qy + ry, pz + qz + rz
        nx = alpha * px + beta * qx + gamma * rx
        ny = alpha * py + beta * qy + gamma * ry
        nz = alpha * pz + beta * qz + gamma * rz
        mx, my, mz = shifted(trial, region, six, nx, ny, nz)
        square, along = mx * mx + my * my + mz * mz, mx * sx + my * sy + mz * sz
        load, law = source_around(trial, region, v) * six, trial.laws.number[region]
        fx, fy, fz = data[region, SIXTH_FLUX_X], data[region, SIXTH_FLUX_Y], data[region, SIXTH_FLUX_Z]
        weight = 2.0 * data[region, TWELFTH_COEFFICIENT] / six
        if law >= 0:
            density, rate, curve = energy_density(trial.laws, law, square / (six * six))
            weight = rate / (3.0 * six)
            total += six * density / 6.0
            ww += 2.0 * curve * along * along / (3.0 * six * six * six)
        else:
            total += 0.5 * weight * square
        total -= load * (alpha + beta + gamma + 4.0 * change) + fx * nx + fy * ny + fz * nz
        by_w -= weight * along + load - fx * sx - fy * sy - fz * sz
        ww += weight * (sx * sx + sy * sy + sz * sz)
    return total, by_w, ww, worst


@inner_kernel
def with_slivers(mesh, trial, v, x, y, z, w, curved):
    rise = rise_at(mesh, trial, v, x, y, z)
    c, r, k, worst = parabola(mesh, trial, v, x, y, z, w, rise)
    if trial.surface.shape[0] > 0:
        c, r = c - trial.surface[v, LOAD] * (w + rise), r - trial.surface[v, LOAD]
    if follows_field(trial, v):
        work, by_w = work_around(mesh, trial, v, x, y, z, w + rise)
        c, r = c - work, r - by_w
    if curved:
        more, by_w, ww = slivers_around(mesh, trial, v, x, y, z, w)
        c, r, k = c + more, r + by_w, k + ww
    return c, r, k, worst


@inner_kernel
def best_value(mesh, trial, v, place, w, nonlinear, curved):
    # The least functional of the star, the value change, and the quality. For nonlinear material the candidates are w
    # and one Newton step from w.
    x, y, z = place
    c, r, k, worst = with_slivers(mesh, trial, v, x, y, z, w, curved)
    further = w - r / k
    least = c - 0.5 * r * r / k
    if nonlinear:
        least = with_slivers(mesh, trial, v, x, y, z, further, curved)[0]
        if not least < c:
            return c, w, worst
    return least, further, worst


@inner_kernel
def improve_value(mesh, trial, v, curved):
    x, y, z = mesh.position[v, 0], mesh.position[v, 1], mesh.position[v, 2]
    c, r, k, _ = with_slivers(mesh, trial, v, x, y, z, 0.0, curved)
    w = -r / k
    for _ in range(TRIES):
        least = with_slivers(mesh, trial, v, x, y, z, w, curved)[0]
        if least <= c:
            trial.value[v] += w
            return c - least
        w *= 0.5
    return 0.0


@inner_kernel
def least_near(mesh, trial, v, x, y, z, w):
    # by one Newton step of the value from w
    c, r, k, _ = with_slivers(mesh, trial, v, x, y, z, w, False)
    return c - 0.5 * r * r / k
