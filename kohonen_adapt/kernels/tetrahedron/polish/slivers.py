"""Slivers between faces of tetrahedra and curved surfaces, with a P1 function.

A face inscribed in a sphere, cylinder or cone is a chord. An element outside the surface covers the sliver,
which has the material of the element inside, or none. An element inside an outer boundary is extended into
the sliver, with a linear Dirichlet function if there is one. The functional of the function in the true
domain is that of the mesh plus, for every sliver, S = volume times change of the density at one gradient. The
descent lowers the functional plus S + |S|, an upper bound for both domains. With S alone the longest faces
would be at places without a jump of the field, and results on the mesh would suffer from the missing volume.
"""

import math

from kohonen_adapt.kernels.functionals import energy_density
from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import (
    SHIFT_X,
    SHIFT_Y,
    SHIFT_Z,
    SIXTH_FLUX_X,
    SIXTH_FLUX_Y,
    SIXTH_FLUX_Z,
    TWELFTH_COEFFICIENT,
)
from kohonen_adapt.kernels.tetrahedron.geometry import OPPOSITE
from kohonen_adapt.kernels.tetrahedron.polish.energy import value_at
from kohonen_adapt.kernels.tetrahedron.surfaces import onto_patch, signed_distance

SHORT = 1e-4  # step of central differences, relative to an edge
UNMOVED = (-1, 0.0, 0.0, 0.0, 0.0)  # `moved` without a node: (node, x, y, z, change of value)


@inner_kernel
def position_of(position, node, moved):
    if node == moved[0]:
        return moved[1], moved[2], moved[3]
    return position[node, 0], position[node, 1], position[node, 2]


@inner_kernel
def midpoint_depth(surfaces, p, a, b):
    return -signed_distance(surfaces, p, 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))[0]


@inner_kernel
def sliver_volume(surfaces, p, a, b, c):
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    height = midpoint_depth(surfaces, p, a, b) + midpoint_depth(surfaces, p, b, c) + midpoint_depth(surfaces, p, c, a)
    return math.sqrt(nx * nx + ny * ny + nz * nz) * height / 6.0


@inner_kernel
def density(trial, region, slope, hat):
    """Return the functional per volume, and two derivatives by a nodal value.

    `hat` is the gradient of the shape function of the node.
    """
    (gx, gy, gz), (hx, hy, hz) = slope, hat
    data, law = trial.data, trial.laws.number[region]
    qx, qy, qz = 6.0 * data[region, SIXTH_FLUX_X], 6.0 * data[region, SIXTH_FLUX_Y], 6.0 * data[region, SIXTH_FLUX_Z]
    mx, my, mz = gx, gy, gz
    if law >= 0:
        mx, my, mz = gx - data[region, SHIFT_X], gy - data[region, SHIFT_Y], gz - data[region, SHIFT_Z]
    square, along = mx * mx + my * my + mz * mz, mx * hx + my * hy + mz * hz
    rate, curve = 6.0 * data[region, TWELFTH_COEFFICIENT], 0.0
    held = rate * square
    if law >= 0:
        held, rate, curve = energy_density(trial.laws, law, square)
    first = 2.0 * rate * along - (qx * hx + qy * hy + qz * hz)
    second = 2.0 * rate * (hx * hx + hy * hy + hz * hz) + 4.0 * curve * along * along
    return held - (qx * gx + qy * gy + qz * gz), first, second


@inner_kernel
def gradients(position, elements, trial, e, moved):
    """Return gradient, gradient of the shape function, and six times the volume.

    The shape function is that of the node in `moved`.
    """
    node, region = elements.node, elements.region[e]
    v, w = moved[0], moved[4]
    i, j, k, o = node[e, 0], node[e, 1], node[e, 2], node[e, 3]
    ox, oy, oz = position_of(position, o, moved)
    ax, ay, az = position_of(position, i, moved)
    bx, by, bz = position_of(position, j, moved)
    cx, cy, cz = position_of(position, k, moved)
    ax, ay, az, bx, by, bz = ax - ox, ay - oy, az - oz, bx - ox, by - oy, bz - oz
    cx, cy, cz = cx - ox, cy - oy, cz - oz
    px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
    rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    six = ax * px + ay * py + az * pz
    at_o, alpha = value_at(trial, region, o), value_at(trial, region, i)
    beta, gamma = value_at(trial, region, j), value_at(trial, region, k)
    alpha, beta, gamma = alpha - at_o, beta - at_o, gamma - at_o
    one, two, three = (1.0 if i == v else 0.0), (1.0 if j == v else 0.0), (1.0 if k == v else 0.0)
    if o == v:
        one, two, three = -1.0, -1.0, -1.0
    hx, hy, hz = one * px + two * qx + three * rx, one * py + two * qy + three * ry, one * pz + two * qz + three * rz
    hx, hy, hz = hx / six, hy / six, hz / six
    gx = (alpha * px + beta * qx + gamma * rx) / six + w * hx
    gy = (alpha * py + beta * qy + gamma * ry) / six + w * hy
    gz = (alpha * pz + beta * qz + gamma * rz) / six + w * hz
    return (gx, gy, gz), (hx, hy, hz), six


@inner_kernel
def is_outside(surfaces, p, a, b, c, top):
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    x, y, z = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
    _, sx, sy, sz = signed_distance(surfaces, p, x, y, z)
    up = nx * (top[0] - a[0]) + ny * (top[1] - a[1]) + nz * (top[2] - a[2])
    return up * (nx * sx + ny * sy + nz * sz) > 0.0


@inner_kernel
def sliver(position, elements, surfaces, trial, e, k, moved):
    """Return S + abs(S) at face k of e, and two derivatives by the value in `moved`.

    The volume of a covered sliver is at most that of the element.
    """
    p, node = elements.patch[e, k], elements.node
    a = position_of(position, node[e, OPPOSITE[k, 0]], moved)
    b = position_of(position, node[e, OPPOSITE[k, 1]], moved)
    c = position_of(position, node[e, OPPOSITE[k, 2]], moved)
    top, across = position_of(position, node[e, k], moved), elements.neighbour[e, k]
    own, outer = elements.region[e], is_outside(surfaces, p, a, b, c, top)
    if across >= 0 and not outer:
        return 0.0, 0.0, 0.0  # counted in the element outside
    volume = sliver_volume(surfaces, p, a, b, c)
    slope, hat, six = gradients(position, elements, trial, e, moved)
    if not outer and trial.follows[p]:
        slope, hat = (trial.rate[p, 0], trial.rate[p, 1], trial.rate[p, 2]), (0.0, 0.0, 0.0)
    there, by_w, ww = density(trial, own, slope, hat)
    if outer:
        there, by_w, ww, volume = -there, -by_w, -ww, min(volume, abs(six) / 6.0)
        if across >= 0:
            more, more_by_w, more_ww = density(trial, elements.region[across], slope, hat)
            there, by_w, ww = there + more, by_w + more_by_w, ww + more_ww
    if there < 0.0:
        return 0.0, 0.0, 0.0
    return 2.0 * volume * there, 2.0 * volume * by_w, 2.0 * volume * ww


@inner_kernel
def slivers_of(position, elements, surfaces, trial, e, moved):
    total = by_w = ww = 0.0
    for k in range(4):
        p = elements.patch[e, k]
        if p >= 0 and trial.counted[p]:
            one, two, three = sliver(position, elements, surfaces, trial, e, k, moved)
            total, by_w, ww = total + one, by_w + two, ww + three
    return total, by_w, ww


@inner_kernel
def has_slivers(mesh, trial, v):
    for j in range(mesh.star.start[v], mesh.star.start[v + 1]):
        for k in range(4):
            p = mesh.elements.patch[mesh.star.element[j], k]
            if p >= 0 and trial.counted[p]:
                return True
    return False


@inner_kernel
def slivers_around(mesh, trial, v, x, y, z, w):
    total = by_w = ww = 0.0
    surfaces, moved = mesh.constraints.surfaces, (v, x, y, z, w)
    for j in range(mesh.star.start[v], mesh.star.start[v + 1]):
        e = mesh.star.element[j]
        one, two, three = slivers_of(mesh.position, mesh.elements, surfaces, trial, e, moved)
        total, by_w, ww = total + one, by_w + two, ww + three
    return total, by_w, ww


@inner_kernel
def sliver_gradient(mesh, trial, v):
    position, other = mesh.position, mesh.star.link[mesh.star.start[v], 0]
    x, y, z = position[v, 0], position[v, 1], position[v, 2]
    dx, dy, dz = position[other, 0] - x, position[other, 1] - y, position[other, 2] - z
    h = SHORT * math.sqrt(dx * dx + dy * dy + dz * dz)
    gx = slivers_around(mesh, trial, v, x + h, y, z, 0.0)[0] - slivers_around(mesh, trial, v, x - h, y, z, 0.0)[0]
    gy = slivers_around(mesh, trial, v, x, y + h, z, 0.0)[0] - slivers_around(mesh, trial, v, x, y - h, z, 0.0)[0]
    gz = slivers_around(mesh, trial, v, x, y, z + h, 0.0)[0] - slivers_around(mesh, trial, v, x, y, z - h, 0.0)[0]
    return 0.5 * gx / h, 0.5 * gy / h, 0.5 * gz / h


@inner_kernel
def energy_error(position, elements, trial, e, k):
    """Return the energy error per volume of a sliver with the wrong gradient.

    The error is half the coefficient times the squared difference between the gradients on both sides of the
    face, 0 on an outer boundary without Dirichlet values.
    """
    across, p = elements.neighbour[e, k], elements.patch[e, k]
    slope, _, _ = gradients(position, elements, trial, e, UNMOVED)
    if across >= 0:
        there, own = gradients(position, elements, trial, across, UNMOVED)[0], elements.region[across]
    elif trial.follows[p]:
        there, own = slope, elements.region[e]
        slope = (trial.rate[p, 0], trial.rate[p, 1], trial.rate[p, 2])
    else:
        return 0.0
    rate, law = 6.0 * trial.data[own, TWELFTH_COEFFICIENT], trial.laws.number[own]
    if law >= 0:
        x, y, z = (
            there[0] - trial.data[own, SHIFT_X],
            there[1] - trial.data[own, SHIFT_Y],
            there[2] - trial.data[own, SHIFT_Z],
        )
        rate = energy_density(trial.laws, law, x**2 + y**2 + z**2)[1]
    x, y, z = slope[0] - there[0], slope[1] - there[1], slope[2] - there[2]
    return rate * (x * x + y * y + z * z)


@inner_kernel
def filled_by_split(mesh, trial, e, k, a, b):
    """Return the gain of a new node on the surface half-way along ab.

    The sliver shrinks. In the volume between the old and new faces the wrong gradient is replaced by the right
    gradient, and |S| decreases.
    """
    position, elements, surfaces, p = mesh.position, mesh.elements, mesh.surfaces, mesh.elements.patch[e, k]
    corners = OPPOSITE[k]
    c = elements.node[e, corners[0]]
    for i in range(1, 3):
        if c in (a, b):
            c = elements.node[e, corners[i]]
    start = position_of(position, a, UNMOVED)
    end, third = position_of(position, b, UNMOVED), position_of(position, c, UNMOVED)
    if elements.neighbour[e, k] >= 0 and not is_outside(
        surfaces, p, start, end, third, position_of(position, elements.node[e, k], UNMOVED)
    ):
        return 0.0
    middle = onto_patch(surfaces, p, 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2]))
    before = sliver_volume(surfaces, p, start, end, third)
    after = sliver_volume(surfaces, p, start, middle, third) + sliver_volume(surfaces, p, middle, end, third)
    own = sliver(position, elements, surfaces, trial, e, k, UNMOVED)[0]
    return (before - after) * energy_error(position, elements, trial, e, k) + (1.0 - after / before) * 0.5 * own
