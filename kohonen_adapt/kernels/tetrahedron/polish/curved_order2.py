"""Curved edges at moved nodes, and the functional of slivers at quadratic faces.

A quadratic face deviates from the surface by a vector v of the order h^4. With the density W and its derivative q by
grad u, the integral of Eshelby's tensor over the face,

    S = int W (v . n) - (q . n) (grad u . v),

summed over both elements, is the change of the functional to first order if the face and the function move by v. The
descent lowers the functional plus S + |S|, for the reasons in `slivers.py`.
"""

import math

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import (
    SHIFT_X,
    SHIFT_Y,
    SHIFT_Z,
    SIXTH_FLUX_X,
    SIXTH_FLUX_Y,
    SIXTH_FLUX_Z,
)
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, corner_of
from kohonen_adapt.kernels.tetrahedron.polish.energy import source_around
from kohonen_adapt.kernels.tetrahedron.polish.energy_order2 import density_at, set_functions, set_offsets, slopes_at
from kohonen_adapt.kernels.tetrahedron.surfaces import onto_patch, onto_ridge, signed_distance

SHORT = 1e-4  # step of central differences, relative to an edge

# Radon's rule of degree 5 on a triangle. v is 0 at corners and midpoints.
NEAR, FAR = (6.0 - math.sqrt(15.0)) / 21.0, (6.0 + math.sqrt(15.0)) / 21.0
FACE_POINTS = np.array(
    [[1.0 / 3.0] * 3]
    + [[1.0 - 2.0 * a if i == k else a for i in range(3)] for a in (NEAR, FAR) for k in range(3)]
)  # fmt: skip
FACE_WEIGHTS = np.array([0.225] + [(155.0 - math.sqrt(15.0)) / 1200.0] * 3 + [(155.0 + math.sqrt(15.0)) / 1200.0] * 3)


@inner_kernel
def has_curves(block, v):
    return block.curve_end.shape[0] > 0 and block.curve_start[v] < block.curve_start[v + 1]


@inner_kernel
def follow_surfaces(position, surfaces, block, v):
    patches = surfaces.shape.shape[0]
    for row in range(block.curve_start[v], block.curve_start[v + 1]):
        place, w = np.int64(block.curve_place[row]), np.int64(block.curve_end[row])
        if place < 0:
            continue
        x, y, z = position[v, 0] + position[w, 0], position[v, 1] + position[w, 1], position[v, 2] + position[w, 2]
        x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
        if place < patches:
            px, py, pz = onto_patch(surfaces, place, x, y, z)
        else:
            px, py, pz = onto_ridge(surfaces, place - patches, x, y, z)
        for back in range(block.curve_start[w], block.curve_start[w + 1]):
            if block.curve_end[back] == v:
                set_offset(block, back, px - x, py - y, pz - z)
        set_offset(block, row, px - x, py - y, pz - z)


@inner_kernel
def set_offset(block, row, x, y, z):
    block.curve_offset[row, 0], block.curve_offset[row, 1], block.curve_offset[row, 2] = x, y, z


@inner_kernel
def slivers_at(mesh, quadratic, v):
    # the sum of S + abs(S) over the faces at v, for the coefficients in the block
    star, elements, counted, total = mesh.star, mesh.elements, quadratic.trial.counted, 0.0
    for row in range(star.start[v], star.start[v + 1]):
        e = np.int64(star.element[row])
        for j in range(4):
            p, across = np.int64(elements.patch[e, j]), np.int64(elements.neighbour[e, j])
            if p < 0 or not counted[p] or elements.node[e, j] == v or 0 <= across < e:
                continue
            own = sliver_of(mesh, quadratic, v, row, j, p)
            for other in range(star.start[v], star.start[v + 1]):
                if star.element[other] == across:
                    own += sliver_of(mesh, quadratic, v, other, corner_of(elements.neighbour, across, e), p)
            total += own + abs(own)
    return total


@inner_kernel
def sliver_of(mesh, quadratic, v, row, j, p):
    # of the element in a row of the star, at its face j on patch p
    element = np.int64(mesh.star.element[row])
    corners = v, np.int64(mesh.star.link[row, 0]), np.int64(mesh.star.link[row, 1]), np.int64(mesh.star.link[row, 2])
    k = 1
    while corners[k] != mesh.elements.node[element, j]:
        k += 1
    trial, block, total = quadratic.trial, quadratic.block, 0.0
    region, position = mesh.elements.region[element], mesh.position
    data, load, shift = trial.data, source_around(trial, region, v), 1.0 if trial.laws.number[region] >= 0 else 0.0
    sx, sy, sz = shift * data[region, SHIFT_X], shift * data[region, SHIFT_Y], shift * data[region, SHIFT_Z]
    fx, fy, fz = 6.0 * data[region, SIXTH_FLUX_X], 6.0 * data[region, SIXTH_FLUX_Y], 6.0 * data[region, SIXTH_FLUX_Z]
    set_offsets(block, corners)
    for q in range(FACE_WEIGHTS.shape[0]):
        at = (
            FACE_POINTS[q, 0],
            0.0 if k == 1 else FACE_POINTS[q, 1],
            0.0 if k == 2 else FACE_POINTS[q, 1 if k == 1 else 2],
            0.0 if k == 3 else FACE_POINTS[q, 2],
        )
        half = 0.5 * FACE_WEIGHTS[q] * slopes_at(position, block, corners, at)
        value, (px, py, pz) = set_functions(block, row - mesh.star.start[v], at)
        x, y, z = point_of(position, block, corners, at)
        distance, vx, vy, vz = signed_distance(mesh.constraints.surfaces, p, x, y, z)
        vx, vy, vz = -distance * vx, -distance * vy, -distance * vz
        nx, ny, nz = -half * block.slope[k, 0], -half * block.slope[k, 1], -half * block.slope[k, 2]
        rx, ry, rz = px - sx, py - sy, pz - sz
        density, rate, _ = density_at(trial, region, rx, ry, rz)
        density -= fx * px + fy * py + fz * pz + 24.0 * load * value
        rate *= 2.0
        across = (rate * rx - fx) * nx + (rate * ry - fy) * ny + (rate * rz - fz) * nz
        total += density * (vx * nx + vy * ny + vz * nz) - across * (px * vx + py * vy + pz * vz)
    return total


@inner_kernel
def point_of(position, block, corners, at):
    x = y = z = 0.0
    for i in range(4):
        px, py, pz = position[corners[i], 0], position[corners[i], 1], position[corners[i], 2]
        x, y, z = x + at[i] * px, y + at[i] * py, z + at[i] * pz
    for i in range(6):
        size = 4.0 * at[EDGES[i, 0]] * at[EDGES[i, 1]]
        x, y, z = x + size * block.offset[i, 0], y + size * block.offset[i, 1], z + size * block.offset[i, 2]
    return x, y, z
