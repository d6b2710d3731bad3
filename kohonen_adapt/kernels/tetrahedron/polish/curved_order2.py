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
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES, corner_of, corners_around
from kohonen_adapt.kernels.tetrahedron.polish.energy import density_at, less_shift, sixth_flux, source_around
from kohonen_adapt.kernels.tetrahedron.polish.energy_order2 import set_functions, set_offsets, slopes_at
from kohonen_adapt.kernels.tetrahedron.surfaces import onto_patch, onto_ridge, signed_distance
from kohonen_adapt.kernels.vectors import ZERO, dot, midpoint, minus, plus_times, point, put, times

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
        place, w = block.curve_place[row], block.curve_end[row]
        if place < 0:
            continue
        x = midpoint(position, v, w)
        y = onto_patch(surfaces, place, x) if place < patches else onto_ridge(surfaces, place - patches, x)
        put(block.curve_offset, row, minus(y, x))
        for back in range(block.curve_start[w], block.curve_start[w + 1]):
            if block.curve_end[back] == v:
                put(block.curve_offset, back, minus(y, x))


@inner_kernel
def slivers_at(mesh, quadratic, v):
    # the sum of S + abs(S) over the faces at v, for the coefficients in the block
    star, elements, counted = mesh.star, mesh.elements, quadratic.trial.counted
    total = 0.0
    for row in rows_of(star, v):
        e = star.element[row]
        for j in range(4):
            p, across = elements.patch[e, j], elements.neighbour[e, j]
            if p < 0 or not counted[p] or elements.node[e, j] == v or 0 <= across < e:
                continue
            own = sliver_of(mesh, quadratic, v, row, j, p)
            for other in rows_of(star, v):
                if star.element[other] == across:
                    own += sliver_of(mesh, quadratic, v, other, corner_of(elements.neighbour, across, e), p)
            total += own + abs(own)
    return total


@inner_kernel
def sliver_of(mesh, quadratic, v, row, j, p):
    # of the element in a row of the star, at its face j on patch p
    element = mesh.star.element[row]
    corners = corners_around(mesh.star, row, v)
    k = 1
    while corners[k] != mesh.elements.node[element, j]:
        k += 1
    trial, block = quadratic.trial, quadratic.block
    total = 0.0
    region, position = mesh.elements.region[element], mesh.position
    load, flux = source_around(trial, region, v), times(6.0, sixth_flux(trial, region))
    set_offsets(block, corners)
    for q in range(FACE_WEIGHTS.shape[0]):
        at = (
            FACE_POINTS[q, 0],
            0.0 if k == 1 else FACE_POINTS[q, 1],
            0.0 if k == 2 else FACE_POINTS[q, 1 if k == 1 else 2],
            0.0 if k == 3 else FACE_POINTS[q, 2],
        )
        half = 0.5 * FACE_WEIGHTS[q] * slopes_at(position, block, corners, at)
        value, field = set_functions(block, row - mesh.star.start[v], at)
        distance, outwards = signed_distance(mesh.constraints.surfaces, p, point_of(position, block, corners, at))
        deviation, normal = times(-distance, outwards), times(-half, point(block.slope, k))
        g = less_shift(trial, region, field)
        density, rate, _ = density_at(trial, region, g)
        density -= dot(flux, field) + 24.0 * load * value
        across = dot(minus(times(2.0 * rate, g), flux), normal)
        total += density * dot(deviation, normal) - across * dot(field, deviation)
    return total


@inner_kernel
def point_of(position, block, corners, at):
    x = ZERO
    for i in range(4):
        x = plus_times(x, at[i], point(position, corners[i]))
    for i in range(6):
        x = plus_times(x, 4.0 * at[EDGES[i, 0]] * at[EDGES[i, 1]], point(block.offset, i))
    return x
