"""Swaps of edges and faces while the functional decreases.

Rings, shells and dynamic program are those of `kernels/tetrahedron/swap.py`, here for the least energy of the
new elements, none of them worse than the floor or the worst before. Edges on patches are swapped only if the
values on the patch do not depend on the edge, which requires a plane with free or linear values.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, corners_of, element_quality, element_volumes
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING, element_energy, source_along
from kohonen_adapt.kernels.tetrahedron.surgery import replace
from kohonen_adapt.kernels.tetrahedron.swap import (
    RULED_OUT,
    add_shells,
    enter,
    replace_shells,
    shells_around,
    take_first,
    triangulate,
    write_face_swap,
)

SIX_VOLUMES, ENERGY = 0, 1  # columns of `seen`


@inner_kernel
def energy_of(mesh, trial, node, e, region, a, b):
    load = source_along(trial, region, a, b)
    return element_energy(mesh.position, trial, region, load, *corners_of(node, e))


@inner_kernel
def energy_seen(mesh, trial, e):
    node = mesh.elements.node
    return energy_of(mesh, trial, node, e, mesh.elements.region[e], node[e, 0], node[e, 1])


@inner_kernel
def energy_of_old(mesh, trial, count, a, b):
    total = magnitude = 0.0
    for i in range(count):
        e = mesh.cavity.old[i]
        energy, more = energy_of(mesh, trial, mesh.elements.node, e, mesh.elements.region[e], a, b)
        total, magnitude = total + energy, magnitude + more
    return total, magnitude


@inner_kernel
def remove_edge_downhill(mesh, trial, queue, open_patch, e, edge, floor):
    a, b, rings = shells_around(mesh, queue, e, edge)
    nodes, found, other, found_other, patch = rings
    if nodes < 3 or (patch >= 0 and not open_patch[patch]):
        return 0, 0.0
    least = max(FLAT, min(floor, add_shells(mesh, rings)))
    after = -triangulate(mesh, trial, 0, nodes, a, b, RULED_OUT, least)
    if after == np.inf:
        return 0, 0.0
    if other > 0:
        after -= triangulate(mesh, trial, 1, other, a, b, RULED_OUT, least)
    before, magnitude = energy_of_old(mesh, trial, found + found_other, a, b)
    gain = before - after
    if not gain > ROUNDING * magnitude:
        return 0, 0.0
    return replace_shells(mesh, a, b, rings), gain


@inner_kernel
def swap_face_downhill(mesh, trial, queue, e, k, floor):
    worst = write_face_swap(mesh, queue, e, k)
    if worst == RULED_OUT:
        return 0, 0.0
    least = max(FLAT, min(floor, worst))
    for new in range(3):
        if not element_quality(mesh.position, mesh.cavity.new, new) >= least:
            return 0, 0.0
    a, b = mesh.cavity.new[0, 0], mesh.cavity.new[0, 1]
    gain, magnitude = energy_of_old(mesh, trial, 2, a, b)
    for new in range(3):
        gain -= energy_of(mesh, trial, mesh.cavity.new, new, mesh.cavity.region[new], a, b)[0]
    if not gain > ROUNDING * magnitude:
        return 0, 0.0
    return (3 if replace(mesh, 2, 3) else 0), gain


@inner_kernel
def swap_downhill_at(mesh, trial, queue, open_patch, e, floor):
    for edge in range(6):
        made, gain = remove_edge_downhill(mesh, trial, queue, open_patch, e, edge, floor)
        if made > 0:
            return made, gain
    for k in range(4):
        made, gain = swap_face_downhill(mesh, trial, queue, e, k, floor)
        if made > 0:
            return made, gain
    return 0, 0.0


@kernel
def enter_changed(mesh, trial, queue, seen, fraction):
    """Add elements whose volume or functional has changed by a fraction.

    `seen` (m, 2) holds both values of the last search. `fraction` is the fraction.
    """
    for e in range(mesh.elements.node.shape[0]):
        if mesh.elements.node[e, 0] < 0 or queue.waiting[e]:
            continue
        volumes = element_volumes(mesh.position, mesh.elements.node, e)
        energy, magnitude = energy_seen(mesh, trial, e)
        if (
            abs(volumes - seen[e, SIX_VOLUMES]) > fraction * volumes
            or abs(energy - seen[e, ENERGY]) > fraction * magnitude
        ):
            enter(queue, e)


@kernel
def swap_downhill(mesh, trial, queue, seen, open_patch, floor, limit):
    """Search up to `limit` waiting elements, and swap while the functional decreases.

    Returned are the number of swaps and the decrease. `floor` is the cube of a quality. `open_patch` (p,) marks
    the patches whose edges may be swapped. With a varying source new elements wait for the next call, because
    each swap uses the source around its own edge, and swaps could otherwise cycle.
    """
    swaps, decrease = 0, 0.0
    for _ in range(limit):
        if queue.state[1] == 0:
            break
        e = take_first(queue)
        if mesh.elements.node[e, 0] < 0:
            continue
        seen[e, SIX_VOLUMES] = element_volumes(mesh.position, mesh.elements.node, e)
        seen[e, ENERGY] = energy_seen(mesh, trial, e)[0]
        made, gain = swap_downhill_at(mesh, trial, queue, open_patch, e, floor)
        for i in range(made if trial.source.shape[0] == 0 else 0):
            enter(queue, np.int64(mesh.cavity.made[i]))
        if made > 0:
            swaps, decrease = swaps + 1, decrease + gain
    return swaps, decrease
