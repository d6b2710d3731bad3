"""Rings of nodes around an edge, and elements that replace an edge or a face.

Edge removal triangulates the ring by the dynamic program of Klincsek ("Minimal triangulations of polygonal domains",
Ann. Discrete Math. 9, 1980), here for the largest worst quality (Shewchuk, "Two discrete optimization algorithms for
the topological improvement of tetrahedral meshes", 2002), or with a `trial` for the least functional. An edge on an
outer patch has an open ring, an edge on a patch between regions two rings.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.arrays import PLANE, RING
from kohonen_adapt.kernels.tetrahedron.geometry import (
    EDGES,
    corner_of,
    cubed_quality_on,
    edge_of,
    element_quality,
    element_volumes,
    face_of,
    fourth_node,
    has_constrained_face,
    triangle_vectors,
)
from kohonen_adapt.kernels.tetrahedron.metric import is_round, quality_on_both_sides
from kohonen_adapt.kernels.tetrahedron.polish.energy import energy_on, source_along, triangle_tilts, value_at
from kohonen_adapt.kernels.tetrahedron.surfaces import edge_sagitta, exceeds_sagitta
from kohonen_adapt.kernels.tetrahedron.surgery import EQUAL, NOWHERE, replace
from kohonen_adapt.kernels.tetrahedron.waiting import is_blocked
from kohonen_adapt.kernels.vectors import between

RULED_OUT = -np.inf  # merit of a part of a ring without permitted elements


@inner_kernel
def first_of_shell(mesh, e, a, b, first, second):
    """Return the first element of an open shell around ab, and its two other nodes.

    The shell starts at a constrained face. Element e is (a, b, first, second). Returned is -1 if the shell has too
    many elements.
    """
    elements = mesh.elements
    for _ in range(RING):
        k = corner_of(elements.node, e, second)
        across = elements.neighbour[e, k]
        if elements.patch[e, k] >= 0 or across < 0:
            return e, first, second
        first, second = fourth_node(elements.node, across, a, b, first), first
        e = across
    return NOWHERE, first, second


@inner_kernel
def walk_shell(mesh, queue, side, e, a, b, first, second):
    """List the shell around ab from element e = (a, b, first, second), and its ring.

    Returned are the numbers of nodes and elements, (0, 0) if too many or if an element waits. A closed shell has as
    many nodes as elements, an open shell one more.
    """
    elements, shell, ring = mesh.elements, mesh.cavity.shell, mesh.cavity.ring
    start, count = e, 0
    while count < RING - 1 and not is_blocked(queue, e):
        shell[side, count], ring[side, count] = e, first
        count += 1
        k = corner_of(elements.node, e, first)
        across = elements.neighbour[e, k]
        if elements.patch[e, k] >= 0 or across < 0:
            ring[side, count] = second
            return count + 1, count
        if across == start:
            return count, count
        e, first = across, second
        second = fourth_node(elements.node, across, a, b, second)
    if (
        count == RING - 1
        and not is_blocked(queue, e)
        and elements.neighbour[e, corner_of(elements.node, e, first)] == start
    ):
        shell[side, count], ring[side, count] = e, first
        return RING, RING
    return 0, 0


@inner_kernel
def triangulate(mesh, trial, side, count, a, b, least, floor):
    """Find the best triangulation of a ring of `count` nodes, and return its merit.

    Each triangle of the ring has two elements, with a and with b. Without a trial the merit is the worst cubed
    quality in the metric, which must exceed `least`. With a trial the merit is minus the functional. No Euclidean
    quality may be below `floor`. Otherwise the merit is RULED_OUT.
    """
    merit, apex = mesh.cavity.merit, mesh.cavity.apex
    if count == 0:
        return 0.0
    by_quality = trial is None
    for i in range(count - 1):
        merit[side, i, i + 1] = 2.0 if by_quality else 0.0
    for length in range(2, count):
        for i in range(count - length):
            k = i + length
            best = RULED_OUT
            for j in range(i + 1, k):
                value = merit_with(mesh, trial, side, i, j, k, a, b, max(best, least), floor)
                if value > best:
                    best, apex[side, i, k] = value, j
            merit[side, i, k] = best
    return merit[side, 0, count - 1]


@inner_kernel
def merit_with(mesh, trial, side, i, j, k, a, b, least, floor):
    position, ring, merit = mesh.position, mesh.cavity.ring, mesh.cavity.merit
    p, q, r, before, after = ring[side, i], ring[side, j], ring[side, k], merit[side, i, j], merit[side, j, k]
    value = min(before, after)
    if value == RULED_OUT or (trial is None and not value > least):
        return RULED_OUT
    if trial is None and not is_round(mesh.metric):
        value = min(value, quality_on_both_sides(position, mesh.metric, p, q, r, a, b, floor))
        return value if value > least else RULED_OUT
    vectors = triangle_vectors(position, p, q, r)
    to_a, to_b = between(position, p, a), between(position, p, b)
    bound = least if trial is None else floor
    above = cubed_quality_on(vectors, to_b, 1.0)
    if not above >= bound:
        return RULED_OUT
    worst = min(above, cubed_quality_on(vectors, to_a, -1.0))
    if not worst >= bound:
        return RULED_OUT
    if trial is None:
        value = min(value, worst)
        return value if value > least else RULED_OUT
    region = mesh.elements.region[mesh.cavity.shell[side, 0]]
    load, tilts = source_along(trial, region, a, b), triangle_tilts(trial, region, vectors, p, q, r)
    at_a, at_b = value_at(trial, region, a), value_at(trial, region, b)
    above = energy_on(trial, region, load, vectors, tilts, to_b, at_b, 1.0)
    return before + after - above - energy_on(trial, region, load, vectors, tilts, to_a, at_a, -1.0)


@inner_kernel
def merit_of_rings(mesh, trial, a, b, rings, least, floor):
    nodes, _, other, _, _ = rings
    merit = triangulate(mesh, trial, 0, nodes, a, b, least, floor)
    return merit if merit == RULED_OUT else merit + triangulate(mesh, trial, 1, other, a, b, least, floor)


@inner_kernel
def write_triangulation(mesh, side, count, a, b, patch, new):
    cavity, ring = mesh.cavity, mesh.cavity.ring
    if count == 0:
        return new
    region = mesh.elements.region[cavity.shell[side, 0]]
    cavity.stack[0, 0] = 0
    cavity.stack[0, 1] = count - 1
    height = 1
    while height > 0:
        height -= 1
        i, k = cavity.stack[height, 0], cavity.stack[height, 1]
        if k - i < 2:
            continue
        j = cavity.apex[side, i, k]
        on_base = patch if i == 0 and k == count - 1 else -1
        p, q, r = ring[side, i], ring[side, j], ring[side, k]
        for corners, end, third in (((p, q, r), b, 1), ((p, r, q), a, 2)):
            for corner in range(3):
                cavity.new[new, corner] = corners[corner]
                cavity.patch[new, corner] = -1
            cavity.new[new, 3], cavity.region[new] = end, region
            cavity.patch[new, 3] = -1
            cavity.patch[new, third] = on_base
            new += 1
        cavity.stack[height, 0], cavity.stack[height, 1] = i, j
        cavity.stack[height + 1, 0], cavity.stack[height + 1, 1] = j, k
        height += 2
    return new


@inner_kernel
def second_shell(mesh, queue, a, b, nodes):
    """List the shell across the end faces of the first shell of `nodes` nodes.

    Returned are the numbers of nodes and elements, (0, 0) outside, and the patch of both end faces, -1 if the
    edge must stay.
    """
    elements, shell, ring = mesh.elements, mesh.cavity.shell, mesh.cavity.ring
    begin, end = shell[0, 0], shell[0, nodes - 2]
    k_begin, k_end = corner_of(elements.node, begin, ring[0, 1]), corner_of(elements.node, end, ring[0, nodes - 2])
    patch = elements.patch[begin, k_begin]
    if nodes < 3 or patch < 0 or patch != elements.patch[end, k_end] or would_exceed_sagitta(mesh, patch, a, b, nodes):
        return 0, 0, NOWHERE
    back, across = elements.neighbour[begin, k_begin], elements.neighbour[end, k_end]
    if across < 0:
        return 0, 0, (patch if back < 0 else NOWHERE)
    first = ring[0, nodes - 1]
    second = fourth_node(elements.node, across, a, b, first)
    count, found = walk_shell(mesh, queue, 1, across, a, b, first, second)
    if count < 3 or count == found or ring[1, count - 1] != ring[0, 0] or shell[1, found - 1] != back:
        return 0, 0, NOWHERE
    return count, found, patch


@inner_kernel
def would_exceed_sagitta(mesh, patch, a, b, nodes):
    p, q = mesh.cavity.ring[0, 0], mesh.cavity.ring[0, nodes - 1]
    return exceeds_sagitta(mesh, patch, p, q) and edge_sagitta(mesh, patch, p, q) > edge_sagitta(mesh, patch, a, b)


@inner_kernel
def shells_around(mesh, queue, e, edge):
    """List the rings and shells around an edge of e, two of each between regions.

    Returned are the ends of the edge and (nodes, elements, nodes and elements of the second ring, patch or -1).
    The number of nodes is 0 if the edge must stay or an element waits.
    """
    elements = mesh.elements
    a, b = edge_of(elements.node, e, edge)
    first, second = elements.node[e, EDGES[edge, 2]], elements.node[e, EDGES[edge, 3]]
    nodes, found = walk_shell(mesh, queue, 0, e, a, b, first, second)
    if nodes == found:
        return a, b, (nodes, found, 0, 0, NOWHERE)
    e, first, second = first_of_shell(mesh, e, a, b, first, second)
    if e < 0:
        return a, b, (0, 0, 0, 0, NOWHERE)
    nodes, found = walk_shell(mesh, queue, 0, e, a, b, first, second)
    if nodes < 3:
        return a, b, (0, 0, 0, 0, NOWHERE)
    other, found_other, patch = second_shell(mesh, queue, a, b, nodes)
    return a, b, (nodes if patch >= 0 else 0, found, other, found_other, patch)


@inner_kernel
def replace_shells(mesh, a, b, rings):
    """Replace the shells by the best triangulations, and return the new count.

    Returned is 0 if the new elements do not fill the same volume at a plane, if a slit would close, or if there
    are too few free rows.
    """
    nodes, found, other, found_other, patch = rings
    p, q = mesh.cavity.ring[0, 0], mesh.cavity.ring[0, nodes - 1]
    if patch >= 0 and (has_constrained_face(mesh, a, p, q) or has_constrained_face(mesh, b, p, q)):
        return 0
    plane = patch >= 0 and mesh.surfaces.shape[patch] == PLANE
    old = new = 0
    for side, count, removed in ((0, nodes, found), (1, other, found_other)):
        more = write_triangulation(mesh, side, count, a, b, patch, new)
        if plane and not same_volume(mesh, old, old + removed, new, more):
            return 0
        old = old + removed
        new = more
    return new if replace(mesh, old, new) else 0


@inner_kernel
def add_shells(mesh, rings):
    """List the shells in `cavity.old`, and return the worst quality."""
    cavity, worst = mesh.cavity, 2.0
    old = 0
    for side, count in ((0, rings[1]), (1, rings[3])):
        for i in range(count):
            e = cavity.shell[side, i]
            cavity.old[old], worst = e, min(worst, element_quality(mesh.position, mesh.elements.node, e))
            old += 1
    return worst


@inner_kernel
def same_volume(mesh, first, last, first_new, last_new):
    volume = change = 0.0
    for i in range(first, last):
        volume += element_volumes(mesh.position, mesh.elements.node, mesh.cavity.old[i])
    for i in range(first_new, last_new):
        change += element_volumes(mesh.position, mesh.cavity.new, i)
    return abs(change - volume) <= EQUAL * volume


@inner_kernel
def write_face_swap(mesh, queue, e, k):
    """Write the swap of face k of e to `cavity`, two elements by three.

    Returned is the worst quality of the two, or RULED_OUT if the face must stay or the neighbour waits.
    """
    elements, cavity, position = mesh.elements, mesh.cavity, mesh.position
    across = elements.neighbour[e, k]
    if across < 0 or elements.patch[e, k] >= 0 or is_blocked(queue, across):
        return RULED_OUT
    (a, b, c), top = face_of(elements.node, e, k), elements.node[e, k]
    bottom = fourth_node(elements.node, across, a, b, c)
    cavity.old[0], cavity.old[1] = e, across
    for new, (p, q) in enumerate(((a, b), (b, c), (c, a))):
        cavity.new[new, 0], cavity.new[new, 1], cavity.new[new, 2], cavity.new[new, 3] = top, bottom, p, q
        cavity.region[new] = elements.region[e]
        for j in range(4):
            cavity.patch[new, j] = -1
    return min(element_quality(position, elements.node, e), element_quality(position, elements.node, across))
