"""Swaps of edges and faces at order 2 while the functional decreases.

The coefficients of new edges couple all elements of a ring, so there is no dynamic program as at order 1: all
triangulations of rings of up to five nodes are tried. A swap that adds an unknown must lower the functional by `charge`
more, because the number of unknowns would increase otherwise.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, element_quality, element_volumes
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
from kohonen_adapt.kernels.tetrahedron.polish.swap_by_energy import ENERGY, SIX_VOLUMES, energy_seen
from kohonen_adapt.kernels.tetrahedron.surgery import NOWHERE, replace
from kohonen_adapt.kernels.tetrahedron.swap import (
    RULED_OUT,
    add_shells,
    enter,
    replace_shells,
    shells_around,
    take_first,
    write_face_swap,
    write_triangulation,
)

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
TRIANGLES = np.zeros((LONGEST + 1, COUNTS[-1], LONGEST - 2, 3), dtype=np.int64)  # by nodes and triangulation
for nodes in range(3, LONGEST + 1):
    for row, triangles in enumerate(triangulations(0, nodes - 1)):
        TRIANGLES[nodes, row, : nodes - 2] = triangles


@inner_kernel
def set_triangulation(mesh, side, nodes, row):
    for i in range(nodes - 2):
        first, middle, last = TRIANGLES[nodes, row, i, 0], TRIANGLES[nodes, row, i, 1], TRIANGLES[nodes, row, i, 2]
        mesh.cavity.apex[side, first, last] = middle


@inner_kernel
def write_rings(mesh, a, b, rings, first, second):
    nodes, _, other, _, patch = rings
    set_triangulation(mesh, 0, nodes, first)
    new = write_triangulation(mesh, 0, nodes, a, b, patch, 0)
    if other > 0:
        set_triangulation(mesh, 1, other, second)
        new = write_triangulation(mesh, 1, other, a, b, patch, new)
    return new


@inner_kernel
def are_good(mesh, new, least):
    for i in range(new):
        if not element_quality(mesh.position, mesh.cavity.new, i) >= least:
            return False
    return True


@inner_kernel
def energy_of_rings(mesh, quadratic, known, new, a, b, rings):
    nodes, _, _, _, patch = rings
    given = patch >= 0 and quadratic.dirichlet[patch]
    ring = mesh.cavity.ring
    base = (np.int64(ring[0, 0]), np.int64(ring[0, nodes - 1])) if given else NO_EDGE
    edges, unknowns = gather_new(mesh, quadratic, new, known, quadratic.trial.value[a], base)
    return least_energy(mesh, quadratic, new, unknowns, a, b)[1], edges


@inner_kernel
def remove_edge(mesh, quadratic, queue, open_patch, e, edge, floor, charge):
    a, b, rings = shells_around(mesh, queue, e, edge)
    nodes, found, other, found_other, patch = rings
    if nodes < 3 or nodes > LONGEST or other > LONGEST or (patch >= 0 and not open_patch[patch]):
        return 0, 0.0
    least = max(FLAT, min(floor, add_shells(mesh, rings)))
    known, best = 0, np.inf
    at_first, at_second = NOWHERE, NOWHERE
    now = 0.0
    for first in range(COUNTS[nodes]):
        for second in range(COUNTS[other]):
            new = write_rings(mesh, a, b, rings, first, second)
            if not are_good(mesh, new, least):
                continue
            if known == 0:
                magnitude, now, before = energy_of_old(mesh, quadratic, mesh.cavity.old, found + found_other, a, b)
                known, best = list_edges(mesh, quadratic, found + found_other), before - ROUNDING * magnitude
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
def swap_face(mesh, quadratic, queue, e, k, floor, charge):
    worst = write_face_swap(mesh, queue, e, k)
    if worst == RULED_OUT or not are_good(mesh, 3, max(FLAT, min(floor, worst))):
        return 0, 0.0
    a, b = np.int64(mesh.cavity.new[0, 0]), np.int64(mesh.cavity.new[0, 1])
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


@inner_kernel
def swap_at(mesh, quadratic, queue, open_patch, e, floor, charge):
    for edge in range(6):
        made, gain = remove_edge(mesh, quadratic, queue, open_patch, e, edge, floor, charge)
        if made > 0:
            return made, gain
    for k in range(4):
        made, gain = swap_face(mesh, quadratic, queue, e, k, floor, charge)
        if made > 0:
            return made, gain
    return 0, 0.0


@kernel
def swap_downhill_order2(mesh, quadratic, queue, seen, open_patch, charge, floor, limit):
    """Search up to `limit` waiting elements, and swap while the functional decreases.

    Returned are the number of swaps and the decrease. Arguments are as in `swap_downhill`. `charge` is the decrease
    that an added unknown requires.
    """
    swaps, decrease = 0, 0.0
    for _ in range(limit):
        if queue.state[1] == 0:
            break
        e = take_first(queue)
        if mesh.elements.node[e, 0] < 0:
            continue
        seen[e, SIX_VOLUMES] = element_volumes(mesh.position, mesh.elements.node, e)
        seen[e, ENERGY] = energy_seen(mesh, quadratic.trial, e)[0]
        made, gain = swap_at(mesh, quadratic, queue, open_patch, e, floor, charge)
        for i in range(made if quadratic.trial.source.shape[0] == 0 else 0):
            enter(queue, np.int64(mesh.cavity.made[i]))
        if made > 0:
            swaps, decrease = swaps + 1, decrease + gain
    return swaps, decrease
