"""Swaps of edges and faces by quality, or by the functional.

Elements are swapped while the worst of the touched elements improves, or while the functional decreases. Without a
`trial` the judge is quality in the metric, with Euclidean quality above the floor. With a `trial` the judge
is the functional, at order 2 with `quadratic`, and no new element is worse than the floor or the worst before. numba
compiles every version. Edges on patches are swapped by the functional only if the values on the patch do not depend on
the edge, which requires a plane with free or linear values.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, corners_of, element_quality, element_volumes
from kohonen_adapt.kernels.tetrahedron.metric import UNBOUNDED, is_round, quality_above
from kohonen_adapt.kernels.tetrahedron.polish.energy import ROUNDING, element_energy, source_along
from kohonen_adapt.kernels.tetrahedron.polish.swap_order2 import remove_edge_order2, swap_face_order2
from kohonen_adapt.kernels.tetrahedron.rings import (
    RULED_OUT,
    add_shells,
    merit_of_rings,
    replace_shells,
    shells_around,
    write_face_swap,
)
from kohonen_adapt.kernels.tetrahedron.surgery import replace
from kohonen_adapt.kernels.tetrahedron.waiting import enter, enter_made, take_first

BETTER = 1.02  # smallest improvement of the cubed quality by a swap, above rounding errors
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
def quality_of_old(mesh, count, euclidean):
    if is_round(mesh.metric):
        return euclidean
    worst = 2.0
    for i in range(count):
        e = mesh.cavity.old[i]
        worst = min(worst, quality_above(mesh.position, mesh.metric, mesh.elements.node, e, UNBOUNDED))
    return worst


@inner_kernel
def bounds(mesh, trial, count, worst, below, floor):
    """Return the quality that new elements must have, and the Euclidean floor.

    Elements `cavity.old` are `count`, with the `worst` Euclidean quality. No quality suffices if no swap is wanted.
    """
    floor = max(FLAT, min(floor, worst))
    if trial is not None:
        return floor, floor
    before = quality_of_old(mesh, count, worst)
    return (np.inf if before >= below else max(FLAT, BETTER * before)), floor


@inner_kernel
def are_good(mesh, trial, count, least, floor):
    for i in range(count):
        if trial is None:
            if not quality_above(mesh.position, mesh.metric, mesh.cavity.new, i, floor) > least:
                return False
        elif not element_quality(mesh.position, mesh.cavity.new, i) >= floor:
            return False
    return True


@inner_kernel
def remove_edge(mesh, trial, quadratic, queue, open_patch, rule, e, edge):
    below, floor, charge = rule
    a, b, rings = shells_around(mesh, queue, e, edge)
    if rings[0] < 3:
        return 0, 0.0
    if trial is not None and rings[4] >= 0 and not open_patch[rings[4]]:
        return 0, 0.0
    count = rings[1] + rings[3]
    worst = add_shells(mesh, rings)
    least, floor = bounds(mesh, trial, count, worst, below, floor)
    if quadratic is not None:
        return remove_edge_order2(mesh, quadratic, a, b, rings, floor, charge)
    if least == np.inf:
        return 0, 0.0
    gain = merit_of_rings(mesh, trial, a, b, rings, least, floor)
    if gain == RULED_OUT:
        return 0, 0.0
    if trial is not None:
        before, magnitude = energy_of_old(mesh, trial, count, a, b)
        gain += before
        if not gain > ROUNDING * magnitude:
            return 0, 0.0
    return replace_shells(mesh, a, b, rings), gain


@inner_kernel
def swap_face(mesh, trial, quadratic, queue, rule, e, k):
    below, floor, charge = rule
    worst = write_face_swap(mesh, queue, e, k)
    if worst == RULED_OUT:
        return 0, 0.0
    least, floor = bounds(mesh, trial, 2, worst, below, floor)
    if least == np.inf or not are_good(mesh, trial, 3, least, floor):
        return 0, 0.0
    if quadratic is not None:
        return swap_face_order2(mesh, quadratic, charge)
    gain = 0.0
    if trial is not None:
        a, b = mesh.cavity.new[0, 0], mesh.cavity.new[0, 1]
        gain, magnitude = energy_of_old(mesh, trial, 2, a, b)
        for new in range(3):
            gain -= energy_of(mesh, trial, mesh.cavity.new, new, mesh.cavity.region[new], a, b)[0]
        if not gain > ROUNDING * magnitude:
            return 0, 0.0
    return (3 if replace(mesh, 2, 3) else 0), gain


@inner_kernel
def swap_at(mesh, trial, quadratic, queue, open_patch, rule, e):
    for edge in range(6):
        made, gain = remove_edge(mesh, trial, quadratic, queue, open_patch, rule, e, edge)
        if made > 0:
            return made, gain
    for k in range(4):
        made, gain = swap_face(mesh, trial, quadratic, queue, rule, e, k)
        if made > 0:
            return made, gain
    return 0, 0.0


@kernel
def enter_worse(mesh, queue, below):
    for e in range(mesh.elements.node.shape[0]):
        if mesh.elements.node[e, 0] < 0:
            continue
        if quality_above(mesh.position, mesh.metric, mesh.elements.node, e, UNBOUNDED) < below:
            enter(queue, e)


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


@inner_kernel
def search(mesh, trial, quadratic, queue, seen, open_patch, rule, limit):
    swaps, decrease = 0, 0.0
    for _ in range(limit):
        if queue.state[1] == 0:
            break
        e = take_first(queue)
        if mesh.elements.node[e, 0] < 0:
            continue
        if trial is not None:
            seen[e, SIX_VOLUMES] = element_volumes(mesh.position, mesh.elements.node, e)
            seen[e, ENERGY] = energy_seen(mesh, trial, e)[0]
        made, gain = swap_at(mesh, trial, quadratic, queue, open_patch, rule, e)
        if made == 0:
            continue
        swaps, decrease = swaps + 1, decrease + gain
        if trial is None or trial.source.shape[0] == 0:
            enter_made(mesh, queue, made)
    return swaps, decrease


@kernel
def swap_waiting(mesh, queue, below, floor, limit):
    """Search up to `limit` waiting elements, swap, and return the number of swaps.

    A swap is done if the worst touched element is below `below` (cubed quality) and improves, and if no Euclidean
    quality is below `floor` (cubed) and below the worst before. New elements enter the queue. The queue is empty if all
    searches are done. An edge is searched with its last waiting element.
    """
    return search(mesh, None, None, queue, None, None, (below, floor, 0.0), limit)[0]


@kernel
def swap_downhill(mesh, trial, quadratic, queue, seen, open_patch, charge, floor, limit):
    """Search up to `limit` waiting elements, and swap while the functional decreases.

    Returned are the number of swaps and the decrease. `charge` is the decrease that an added unknown requires at order
    2, `floor` the cube of a quality. `open_patch` (p,) marks the patches whose edges may be swapped. With a varying
    source new elements wait for the next call, because each swap uses the source around its own edge, and swaps could
    otherwise cycle.
    """
    return search(mesh, trial, quadratic, queue, seen, open_patch, (np.inf, floor, charge), limit)
