"""Distances, projections and tangents of patches and ridges."""

import math

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
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
from kohonen_adapt.kernels.vectors import (
    cross,
    divided,
    dot,
    midpoint,
    minus,
    norm,
    plus,
    plus_times,
    point,
    times,
    weighted,
)

STEPS = 20  # maximum number of Newton steps
TURN = math.cos(math.radians(30.0))  # maximum angle between the normals at the ends of an edge
NEAR = 1e-15  # distance from both patches at convergence, relative to the coordinates


@inner_kernel
def signed_distance(surfaces, p, x):
    """Return the signed distance from a patch, and the gradient (a unit vector)."""
    if surfaces.shape[p] == PROJECTED:
        return height_above(surfaces.samples, p, x)
    offset, axis = minus(x, point(surfaces.origin, p)), point(surfaces.axis, p)
    along = dot(offset, axis)
    shape, size = surfaces.shape[p], surfaces.size[p]
    if shape == PLANE:
        return along, axis
    if shape == SPHERE:
        radius = norm(offset)
        return radius - size, divided(offset, radius)
    across = plus_times(offset, -along, axis)
    radius = norm(across)
    across = divided(across, radius)
    if shape == CYLINDER:
        return radius - size, across
    cosine, sine = math.cos(size), math.sin(size)
    return radius * cosine - along * sine, weighted(cosine, across, -sine, axis)


@inner_kernel
def height_above(samples, p, x):
    row = nearest_sample(samples, p, x)
    offset, normal = minus(x, point(samples.point, row)), point(samples.normal, row)
    hessian = samples.hessian[row]
    tilt = dot(point(hessian, 0), offset), dot(point(hessian, 1), offset), dot(point(hessian, 2), offset)
    height = dot(offset, normal) - 0.5 * dot(offset, tilt)
    normal = minus(normal, tilt)
    slope = 1.0 / norm(normal)
    return slope * height, times(slope, normal)


@inner_kernel
def nearest_sample(samples, p, x):
    """Return the row of the sample of patch `p` nearest to x.

    The children of row i of the k-d tree are rows 2 i + 1 and 2 i + 2, with cuts across x, y and z in turn. The search
    has no stack, because every step follows from the previous row (Wald, "A Stack-Free Traversal Algorithm for
    Left-Balanced k-d Trees", 2022).
    """
    root = samples.start[p]
    rows = samples.start[p + 1] - samples.start[p]
    here, before = 0, -1
    depth = 0
    found, least = root, np.inf
    while here >= 0:
        above = (here + 1) // 2 - 1
        if here >= rows:
            here, before = above, here
            depth -= 1
            continue
        row = root + here
        offset = minus(x, point(samples.point, row))
        if before < here:
            squared = dot(offset, offset)
            if squared < least:
                found, least = row, squared
        distance = offset[0] if depth % 3 == 0 else offset[1] if depth % 3 == 1 else offset[2]
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
def onto_patch(surfaces, p, x):
    distance, normal = signed_distance(surfaces, p, x)
    return plus_times(x, -distance, normal)


@inner_kernel
def onto_ridge(surfaces, r, x):
    origin, axis = point(surfaces.ridge_origin, r), point(surfaces.ridge_axis, r)
    offset = minus(x, origin)
    along = dot(offset, axis)
    if surfaces.ridge_shape[r] == LINE:
        return plus_times(origin, along, axis)
    if surfaces.ridge_shape[r] == CIRCLE:
        across = plus_times(offset, -along, axis)
        return plus_times(origin, surfaces.ridge_size[r] / norm(across), across)
    return onto_both(surfaces, surfaces.meets[r, 0], surfaces.meets[r, 1], x)


@inner_kernel
def onto_both(surfaces, p, q, x):
    for _ in range(STEPS):
        f, a = signed_distance(surfaces, p, x)
        g, b = signed_distance(surfaces, q, x)
        if abs(f) + abs(g) <= NEAR * (abs(x[0]) + abs(x[1]) + abs(x[2])):
            break
        cosine = dot(a, b)
        factor = 1.0 / max(1.0 - cosine * cosine, NEAR)
        x = plus_times(plus_times(x, -factor * (f - cosine * g), a), -factor * (g - cosine * f), b)
    return x


@inner_kernel
def tangent_of_ridge(surfaces, r, x):
    axis = point(surfaces.ridge_axis, r)
    if surfaces.ridge_shape[r] == LINE:
        return axis
    if surfaces.ridge_shape[r] == CIRCLE:
        tangent = cross(axis, minus(x, point(surfaces.ridge_origin, r)))
    else:
        first, second = surfaces.meets[r, 0], surfaces.meets[r, 1]
        tangent = cross(signed_distance(surfaces, first, x)[1], signed_distance(surfaces, second, x)[1])
    return times(1.0 / norm(tangent), tangent)


@inner_kernel
def ridge_distance(surfaces, r, x):
    if surfaces.ridge_shape[r] != LINE and surfaces.ridge_shape[r] != CIRCLE:
        return 0.0
    offset = minus(x, onto_ridge(surfaces, r, x))
    return dot(offset, offset)


@inner_kernel
def exceeds_sagitta(mesh, p, a, b):
    if mesh.surfaces.shape[p] == PLANE:
        return False
    return edge_sagitta(mesh, p, a, b) > mesh.origins.sagitta[p]


@inner_kernel
def edge_sagitta(mesh, p, a, b):
    return abs(signed_distance(mesh.surfaces, p, midpoint(mesh.position, a, b))[0])


@inner_kernel
def slid(position, constraints, v, step):
    """Return the position of v after a step along its patch or ridge.

    Steps on planes and lines are projected instead of positions, so that coordinates of nodes on planes across an
    axis do not change. Rounding errors elsewhere are removed by the final projection.
    """
    freedom, surfaces = constraints.freedom, constraints.surfaces
    number, place = freedom.number[v], freedom.place[v]
    x = point(position, v)
    if number == INSIDE:
        return plus(x, step)
    if number == HELD:
        return x
    if number == ON_PATCH:
        if surfaces.shape[place] != PLANE:
            return onto_patch(surfaces, place, plus(x, step))
        normal = point(surfaces.axis, place)
        return plus(x, plus_times(step, -dot(step, normal), normal))
    if surfaces.ridge_shape[place] != LINE:
        return onto_ridge(surfaces, place, plus(x, step))
    axis = point(surfaces.ridge_axis, place)
    return plus_times(x, dot(step, axis), axis)


@inner_kernel
def within_reach(position, elements, star, surfaces, v, x):
    """Return True if no face at v turns by more than 30 degrees or its former angle.

    The angle is that between the surface normals at the ends of an edge, with v at x.
    """
    for k in rows_of(star, v):
        e = star.element[k]
        for j in range(4):
            p = elements.patch[e, j]
            if p < 0 or elements.node[e, j] == v or surfaces.shape[p] == PLANE:
                continue
            normal = signed_distance(surfaces, p, x)[1]
            before = signed_distance(surfaces, p, point(position, v))[1]
            for i in range(4):
                w = elements.node[e, i]
                if i != j and w != v:
                    there = signed_distance(surfaces, p, point(position, w))[1]
                    if not dot(normal, there) >= min(TURN, dot(before, there)):
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
