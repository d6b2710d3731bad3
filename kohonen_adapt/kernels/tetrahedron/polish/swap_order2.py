"""Swaps of edges and faces at order 2 while the functional decreases.

The coefficients of new edges couple all elements of a ring, so there is no dynamic program as at order 1: all
triangulations of rings of up to five nodes are tried. A swap that adds an unknown must lower the functional by `charge`
more, because the number of unknowns would increase otherwise.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.geometry import element_quality
from kohonen_adapt.kernels.tetrahedron.polish.cavity_order2 import (
    are_new,
    energy_of_old,
    gather_new,
    least_energy,
    list_edges,
    solve_unknowns,
    store_new,
)
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING
from kohonen_adapt.kernels.tetrahedron.rings import replace_shells, write_triangulation
from kohonen_adapt.kernels.tetrahedron.surgery import NOWHERE, replace

LONGEST = 5  # nodes of a ring
NO_EDGE = (NOWHERE, NOWHERE)


def triangulations(first, last):
    if last - first < 2:
        return [[]]
    return [
        [(first, j, last), *before, *after]
        for j in range(first + 1, last)
        for before in triangulations(first, j)
        for after in triangulations(j, last)
    ]


COUNTS = np.array([len(triangulations(0, n - 1)) if n > 2 else 1 for n in range(LONGEST + 1)])
TRIANGLES = np.zeros((LONGEST + 1, COUNTS[-1], LONGEST - 2, 3), np.int64)  # by nodes and triangulation
for nodes in range(3, LONGEST + 1):
    for row, triangles in enumerate(triangulations(0, nodes - 1)):
        TRIANGLES[nodes, row, : nodes - 2] = triangles


@inner_kernel
def write_rings(mesh, a, b, rings, first, second):
    nodes, _, other, _, patch = rings
    new = 0
    for side, count, row in ((0, nodes, first), (1, other, second)):
        for i in range(count - 2):
            start, middle, last = TRIANGLES[count, row, i, 0], TRIANGLES[count, row, i, 1], TRIANGLES[count, row, i, 2]
            mesh.cavity.apex[side, start, last] = middle
        new = write_triangulation(mesh, side, count, a, b, patch, new)
    return new


@inner_kernel
def are_above(mesh, count, floor):
    for i in range(count):
        if not element_quality(mesh.position, mesh.cavity.new, i) >= floor:
            return False
    return True


@inner_kernel
def energy_of_rings(mesh, quadratic, known, new, a, b, rings):
    nodes, _, _, _, patch = rings
    given = patch >= 0 and quadratic.dirichlet[patch]
    ring = mesh.cavity.ring
    base = (ring[0, 0], ring[0, nodes - 1]) if given else NO_EDGE
    edges, unknowns = gather_new(mesh, quadratic, new, known, quadratic.trial.value[a], base)
    return least_energy(mesh, quadratic, new, unknowns, a, b)[1], edges


@inner_kernel
def remove_edge_order2(mesh, quadratic, a, b, rings, floor, charge):
    nodes, found, other, found_other, _ = rings
    if nodes > LONGEST or other > LONGEST:
        return 0, 0.0
    known, best = 0, np.inf
    at_first, at_second = NOWHERE, NOWHERE
    now = 0.0
    for first in range(COUNTS[nodes]):
        for second in range(COUNTS[other]):
            new = write_rings(mesh, a, b, rings, first, second)
            if not are_above(mesh, new, floor):
                continue
            if known == 0:
                magnitude, now, before = energy_of_old(mesh, quadratic, mesh.cavity.old, found + found_other, a, b)
                known = list_edges(mesh, quadratic, found + found_other)
                best = before - ROUNDING * magnitude
            total, edges = energy_of_rings(mesh, quadratic, known, new, a, b, rings)
            total += charge * (edges - known - 1)
            if total < best:
                best, at_first, at_second = total, first, second
    if at_first < 0:
        return 0, 0.0
    new = write_rings(mesh, a, b, rings, at_first, at_second)
    total, edges = energy_of_rings(mesh, quadratic, known, new, a, b, rings)
    solve_unknowns(quadratic.block)
    if not are_new(mesh, quadratic.block, known, edges):
        return 0, 0.0
    made = replace_shells(mesh, a, b, rings)
    store_new(mesh, quadratic, made)
    return made, now - total


@inner_kernel
def swap_face_order2(mesh, quadratic, charge):
    a, b = mesh.cavity.new[0, 0], mesh.cavity.new[0, 1]
    magnitude, now, _ = energy_of_old(mesh, quadratic, mesh.cavity.old, 2, a, b)
    known = list_edges(mesh, quadratic, 2)
    edges, unknowns = gather_new(mesh, quadratic, 3, known, quadratic.trial.value[a], NO_EDGE)
    gain = now - least_energy(mesh, quadratic, 3, unknowns, a, b)[1]
    if not gain - charge > ROUNDING * magnitude or not are_new(mesh, quadratic.block, known, edges):
        return 0, 0.0
    solve_unknowns(quadratic.block)
    if not replace(mesh, 2, 3):
        return 0, 0.0
    store_new(mesh, quadratic, 3)
    return 3, gain
