"""Swap edges and faces of tetrahedra until no swap lowers the functional of a function.

As `kernels/tetrahedron/swap.py`, whose rings, fans and dynamic program these are, here for the least sum of energies of
all that is made, none of it worse than the floor or the worst before. Edges on patches go where values on these are the
same whichever way the edge runs: on planes, where values are free or linear.
"""

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.energy import ROUNDING, element_energy, source_along
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, element_quality, element_volumes
from kohonen_adapt.kernels.tetrahedron.surgery import replace
from kohonen_adapt.kernels.tetrahedron.swap import (
    RULED_OUT,
    enter,
    enter_fans,
    enter_pair,
    replace_fans,
    rings_around,
    take_first,
    triangulate,
)

SIX_VOLUMES, ENERGY = 0, 1  # columns of what was seen of an element


@inner_kernel
def energy_of(mesh, trial, node, e, region, a, b):
    """Return the functional of row e of some elements, and the sum of the magnitudes that it is made of.

    The source is that around the edge ab.
    """
    load = source_along(trial, region, a, b)
    return element_energy(mesh.position, trial, region, load, node[e, 0], node[e, 1], node[e, 2], node[e, 3])


@inner_kernel
def energy_seen(mesh, trial, e):
    """Return the same of an element of the mesh by itself."""
    node = mesh.elements.node
    return energy_of(mesh, trial, node, e, mesh.elements.region[e], node[e, 0], node[e, 1])


@inner_kernel
def energy_of_old(mesh, trial, count, a, b):
    """Return the functional of the `count` elements to be taken out, and the sum of magnitudes, for the edge ab."""
    total = size = 0.0
    for i in range(count):
        e = mesh.cavity.old[i]
        energy, more = energy_of(mesh, trial, mesh.elements.node, e, mesh.elements.region[e], a, b)
        total, size = total + energy, size + more
    return total, size


@inner_kernel
def remove_edge_downhill(mesh, trial, queue, open_patch, e, edge, floor):
    """Remove an edge of element e if that lowers the functional; returns how many elements are made, and the gain."""
    a, b, rings = rings_around(mesh, queue, e, edge)
    nodes, found, other, found_other, patch = rings
    if nodes < 3 or (patch >= 0 and not open_patch[patch]):
        return 0, 0.0
    least = max(FLAT, min(floor, enter_fans(mesh, rings)))
    after = -triangulate(mesh, trial, 0, nodes, a, b, least)
    if after == np.inf:
        return 0, 0.0
    if other > 0:
        after -= triangulate(mesh, trial, 1, other, a, b, least)
    before, size = energy_of_old(mesh, trial, found + found_other, a, b)
    gain = before - after
    if not gain > ROUNDING * size:
        return 0, 0.0
    return replace_fans(mesh, a, b, rings), gain


@inner_kernel
def swap_face_downhill(mesh, trial, queue, e, k, floor):
    """Put three elements in place of two with a common face if that lowers the functional; returns 3 and the gain, or
    0 and anything.
    """
    worst = enter_pair(mesh, queue, e, k)
    if worst == RULED_OUT:
        return 0, 0.0
    least = max(FLAT, min(floor, worst))
    for new in range(3):
        if not element_quality(mesh.position, mesh.cavity.new, new) >= least:
            return 0, 0.0
    a, b = mesh.cavity.new[0, 0], mesh.cavity.new[0, 1]
    gain, size = energy_of_old(mesh, trial, 2, a, b)
    for new in range(3):
        gain -= energy_of(mesh, trial, mesh.cavity.new, new, mesh.cavity.region[new], a, b)[0]
    if not gain > ROUNDING * size:
        return 0, 0.0
    return (3 if replace(mesh, 2, 3) else 0), gain


@inner_kernel
def swap_downhill_at(mesh, trial, queue, open_patch, e, floor):
    """Do the first swap at element e that lowers the functional; returns how many elements it made, and the gain."""
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
def enter_changed(mesh, trial, queue, seen, share):
    """Enter the elements whose volume or functional has changed by more than a share since they were looked at.

    `seen` (m, 2) has both of each element.
    """
    for e in range(mesh.elements.node.shape[0]):
        if mesh.elements.node[e, 0] < 0 or queue.waiting[e]:
            continue
        volumes = element_volumes(mesh.position, mesh.elements.node, e)
        energy, size = energy_seen(mesh, trial, e)
        if abs(volumes - seen[e, SIX_VOLUMES]) > share * volumes or abs(energy - seen[e, ENERGY]) > share * size:
            enter(queue, e)


@kernel
def swap_downhill(mesh, trial, queue, seen, open_patch, floor, limit):
    """Look at edges and faces of so many elements that wait, and swap where that lowers the functional; `floor` is
    cubed. Returns the number of swaps, and what they took off. It is done when no element waits.

    `open_patch` (p,) are the patches whose edges may be swapped. Beside a source that varies, what is made waits for
    the next call. Each swap is judged by the source around its own edge, so swaps could undo each other for ever.
    """
    swaps, lowered = 0, 0.0
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
            swaps, lowered = swaps + 1, lowered + gain
    return swaps, lowered
