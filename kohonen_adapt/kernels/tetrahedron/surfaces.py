"""Distances, projections and tangents of patches and ridges."""

import math

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import (
    CIRCLE,
    CYLINDER,
    HELD,
    INSIDE,
    LINE,
    ON_PATCH,
    PLANE,
    PROJECTED,
    SPHERE,
)

STEPS = 20  # maximum number of Newton steps
TURN = math.cos(math.radians(30.0))  # maximum angle between the normals at the ends of an edge
NEAR = 1e-15  # distance from both patches at convergence, relative to the coordinates


@inner_kernel
def signed_distance(surfaces, p, x, y, z):
    """Return the signed distance from a patch, and the gradient (a unit vector)."""
    if surfaces.shape[p] == PROJECTED:
        return height_above(surfaces.samples, p, x, y, z)
    px, py, pz = x - surfaces.origin[p, 0], y - surfaces.origin[p, 1], z - surfaces.origin[p, 2]
    ax, ay, az = surfaces.axis[p, 0], surfaces.axis[p, 1], surfaces.axis[p, 2]
    along, shape, size = px * ax + py * ay + pz * az, surfaces.shape[p], surfaces.size[p]
    if shape == PLANE:
        return along, ax, ay, az
    if shape == SPHERE:
        radius = math.sqrt(px * px + py * py + pz * pz)
        return radius - size, px / radius, py / radius, pz / radius
    rx, ry, rz = px - along * ax, py - along * ay, pz - along * az
    radius = math.sqrt(rx * rx + ry * ry + rz * rz)
    rx, ry, rz = rx / radius, ry / radius, rz / radius
    if shape == CYLINDER:
        return radius - size, rx, ry, rz
    cosine, sine = math.cos(size), math.sin(size)
    return radius * cosine - along * sine, cosine * rx - sine * ax, cosine * ry - sine * ay, cosine * rz - sine * az


@inner_kernel
def height_above(samples, p, x, y, z):
    row = nearest_sample(samples, p, x, y, z)
    hessian, nx, ny, nz = samples.hessian, samples.normal[row, 0], samples.normal[row, 1], samples.normal[row, 2]
    px, py, pz = x - samples.point[row, 0], y - samples.point[row, 1], z - samples.point[row, 2]
    bx = hessian[row, 0, 0] * px + hessian[row, 0, 1] * py + hessian[row, 0, 2] * pz
    by = hessian[row, 1, 0] * px + hessian[row, 1, 1] * py + hessian[row, 1, 2] * pz
    bz = hessian[row, 2, 0] * px + hessian[row, 2, 1] * py + hessian[row, 2, 2] * pz
    height = px * nx + py * ny + pz * nz - 0.5 * (px * bx + py * by + pz * bz)
    nx, ny, nz = nx - bx, ny - by, nz - bz
    slope = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return slope * height, slope * nx, slope * ny, slope * nz


@inner_kernel
def nearest_sample(samples, p, x, y, z):
    """Return the row of the sample of patch `p` nearest to (x, y, z).

    The children of row i of the k-d tree are rows 2 i + 1 and 2 i + 2, with cuts across x, y and z in turn. The search
    has no stack, because every step follows from the previous row (Wald, "A Stack-Free Traversal Algorithm for
    Left-Balanced k-d Trees", 2022).
    """
    point, root, rows = samples.point, np.int64(samples.start[p]), samples.start[p + 1] - samples.start[p]
    here, before, depth, found, least = np.int64(0), np.int64(-1), 0, root, np.inf
    while here >= 0:
        above = (here + 1) // 2 - 1
        if here >= rows:
            here, before, depth = above, here, depth - 1
            continue
        row = root + here
        dx, dy, dz = x - point[row, 0], y - point[row, 1], z - point[row, 2]
        if before < here:
            squared = dx * dx + dy * dy + dz * dz
            if squared < least:
                found, least = row, squared
        distance = dx if depth % 3 == 0 else dy if depth % 3 == 1 else dz
        near = 2 * here + (2 if distance > 0.0 else 1)
        far = 4 * here + 3 - near
        if before < here:
            onward = near
        elif before == near and distance * distance < least:
            onward = far
        else:
            onward = above
        depth += -1 if onward == above else 1
        here, before = onward, here
    return found


@inner_kernel
def onto_patch(surfaces, p, x, y, z):
    distance, nx, ny, nz = signed_distance(surfaces, p, x, y, z)
    return x - distance * nx, y - distance * ny, z - distance * nz


@inner_kernel
def onto_ridge(surfaces, r, x, y, z):
    px, py, pz = x - surfaces.ridge_origin[r, 0], y - surfaces.ridge_origin[r, 1], z - surfaces.ridge_origin[r, 2]
    ax, ay, az = surfaces.ridge_axis[r, 0], surfaces.ridge_axis[r, 1], surfaces.ridge_axis[r, 2]
    along = px * ax + py * ay + pz * az
    if surfaces.ridge_shape[r] == LINE:
        return (
            surfaces.ridge_origin[r, 0] + along * ax,
            surfaces.ridge_origin[r, 1] + along * ay,
            surfaces.ridge_origin[r, 2] + along * az,
        )
    if surfaces.ridge_shape[r] == CIRCLE:
        rx, ry, rz = px - along * ax, py - along * ay, pz - along * az
        scale = surfaces.ridge_size[r] / math.sqrt(rx * rx + ry * ry + rz * rz)
        return (
            surfaces.ridge_origin[r, 0] + scale * rx,
            surfaces.ridge_origin[r, 1] + scale * ry,
            surfaces.ridge_origin[r, 2] + scale * rz,
        )
    return onto_both(surfaces, surfaces.meets[r, 0], surfaces.meets[r, 1], x, y, z)


@inner_kernel
def onto_both(surfaces, p, q, x, y, z):
    for _ in range(STEPS):
        f, ax, ay, az = signed_distance(surfaces, p, x, y, z)
        g, bx, by, bz = signed_distance(surfaces, q, x, y, z)
        if abs(f) + abs(g) <= NEAR * (abs(x) + abs(y) + abs(z)):
            break
        between = ax * bx + ay * by + az * bz
        factor = 1.0 / max(1.0 - between * between, NEAR)
        s, t = factor * (f - between * g), factor * (g - between * f)
        x, y, z = x - s * ax - t * bx, y - s * ay - t * by, z - s * az - t * bz
    return x, y, z


@inner_kernel
def tangent_of_ridge(surfaces, r, x, y, z):
    ax, ay, az = surfaces.ridge_axis[r, 0], surfaces.ridge_axis[r, 1], surfaces.ridge_axis[r, 2]
    if surfaces.ridge_shape[r] == LINE:
        return ax, ay, az
    if surfaces.ridge_shape[r] == CIRCLE:
        bx, by, bz = x - surfaces.ridge_origin[r, 0], y - surfaces.ridge_origin[r, 1], z - surfaces.ridge_origin[r, 2]
    else:
        _, ax, ay, az = signed_distance(surfaces, surfaces.meets[r, 0], x, y, z)
        _, bx, by, bz = signed_distance(surfaces, surfaces.meets[r, 1], x, y, z)
    tx, ty, tz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    scale = 1.0 / math.sqrt(tx * tx + ty * ty + tz * tz)
    return scale * tx, scale * ty, scale * tz


@inner_kernel
def ridge_distance(surfaces, r, x, y, z):
    if surfaces.ridge_shape[r] != LINE and surfaces.ridge_shape[r] != CIRCLE:
        return 0.0
    qx, qy, qz = onto_ridge(surfaces, r, x, y, z)
    return (x - qx) ** 2 + (y - qy) ** 2 + (z - qz) ** 2


@inner_kernel
def exceeds_sagitta(mesh, p, a, b):
    if mesh.surfaces.shape[p] == PLANE:
        return False
    return edge_sagitta(mesh, p, a, b) > mesh.origins.sagitta[p]


@inner_kernel
def edge_sagitta(mesh, p, a, b):
    position = mesh.position
    x, y, z = position[a, 0] + position[b, 0], position[a, 1] + position[b, 1], position[a, 2] + position[b, 2]
    return abs(signed_distance(mesh.surfaces, p, 0.5 * x, 0.5 * y, 0.5 * z)[0])


@inner_kernel
def slid(position, constraints, v, dx, dy, dz):
    """Return the position of v after a step along its patch or ridge.

    Steps on planes and lines are projected instead of positions, so that coordinates of nodes on planes across an
    axis do not change. Rounding errors elsewhere are removed by the final projection.
    """
    freedom, surfaces = constraints.freedom, constraints.surfaces
    number, place = freedom.number[v], np.int64(freedom.place[v])
    x, y, z = position[v, 0], position[v, 1], position[v, 2]
    if number == INSIDE:
        return x + dx, y + dy, z + dz
    if number == HELD:
        return x, y, z
    if number == ON_PATCH:
        if surfaces.shape[place] != PLANE:
            return onto_patch(surfaces, place, x + dx, y + dy, z + dz)
        nx, ny, nz = surfaces.axis[place, 0], surfaces.axis[place, 1], surfaces.axis[place, 2]
        across = dx * nx + dy * ny + dz * nz
        return x + (dx - across * nx), y + (dy - across * ny), z + (dz - across * nz)
    if surfaces.ridge_shape[place] != LINE:
        return onto_ridge(surfaces, place, x + dx, y + dy, z + dz)
    ax, ay, az = surfaces.ridge_axis[place, 0], surfaces.ridge_axis[place, 1], surfaces.ridge_axis[place, 2]
    along = dx * ax + dy * ay + dz * az
    return x + along * ax, y + along * ay, z + along * az


@inner_kernel
def within_reach(position, elements, star, surfaces, v, x, y, z):
    """Return True if no face at v turns by more than 30 degrees or its former angle.

    The angle is that between the surface normals at the ends of an edge, with v at (x, y, z).
    """
    for k in range(star.start[v], star.start[v + 1]):
        e = np.int64(star.element[k])
        for j in range(4):
            p = np.int64(elements.patch[e, j])
            if p < 0 or elements.node[e, j] == v or surfaces.shape[p] == PLANE:
                continue
            _, nx, ny, nz = signed_distance(surfaces, p, x, y, z)
            _, ux, uy, uz = signed_distance(surfaces, p, position[v, 0], position[v, 1], position[v, 2])
            for i in range(4):
                w = elements.node[e, i]
                if i != j and w != v:
                    _, wx, wy, wz = signed_distance(surfaces, p, position[w, 0], position[w, 1], position[w, 2])
                    if not nx * wx + ny * wy + nz * wz >= min(TURN, ux * wx + uy * wy + uz * wz):
                        return False
    return True


@kernel
def measure_sagittas(mesh, sagitta):
    elements = mesh.elements
    for e in range(elements.node.shape[0]):
        if elements.node[e, 0] < 0:
            continue
        for k in range(4):
            p = elements.patch[e, k]
            if p < 0 or mesh.surfaces.shape[p] == PLANE:
                continue
            for i in range(4):
                for j in range(i):
                    if i != k and j != k:
                        sagitta[p] = max(sagitta[p], edge_sagitta(mesh, p, elements.node[e, i], elements.node[e, j]))
