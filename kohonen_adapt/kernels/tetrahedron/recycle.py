"""Recycling on tetrahedra, the longest edges split and the shortest collapsed.

As in `kernels/triangle/recycle.py`, in the metric e'Me (rho_a rho_b)^(1/3) for a shape M and a density rho of
nodes per volume.
"""

from kohonen_adapt.kernels.heap import insert, remove_first
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.arrays import MOST
from kohonen_adapt.kernels.tetrahedron.geometry import corner_of, gather_around, gather_edge, list_neighbours
from kohonen_adapt.kernels.tetrahedron.surgery import (
    NOWHERE,
    UNLIMITED,
    collapse,
    metric_length,
    prepare_collapse,
    prepare_split,
    split,
)
from kohonen_adapt.kernels.tetrahedron.waiting import enter_made


@inner_kernel
def enter_edge(mesh, longest, shortest, a, b):
    length = metric_length(mesh, a, b)
    insert(longest, -length, a, b)
    insert(shortest, length, a, b)


@inner_kernel
def enter_edges(mesh, longest, shortest, v, higher):
    count = gather_around(mesh, v, mesh.cavity.around)
    for i in range(list_neighbours(mesh, v, mesh.cavity.around, count)):
        other = mesh.cavity.made[i]
        if other > v or not higher:
            enter_edge(mesh, longest, shortest, v, other)


@kernel
def fill_heaps(mesh, longest, shortest, first, last):
    for v in range(first, last):
        if mesh.pool.anchor[v] >= 0:
            enter_edges(mesh, longest, shortest, v, True)


@inner_kernel
def next_edge(mesh, heap, sign):
    """Remove edges from a heap up to the first that still exists.

    Returned are its ends and key, (-1, -1, 0) if there is none. `sign` times the metric length is the key. Rows
    of nodes are used again, so an edge is valid only if its length equals the key.
    """
    while heap.size[0] > 0:
        key, a, b = remove_first(heap)
        if mesh.pool.anchor[a] < 0 or mesh.pool.anchor[b] < 0 or sign * metric_length(mesh, a, b) != key:
            continue
        if gather_edge(mesh, a, b, mesh.cavity.old) > 0:
            return a, b, key
    return NOWHERE, NOWHERE, 0.0


@inner_kernel
def next_split(mesh, longest, floor):
    while longest.size[0] > 0 and -longest.key[0] > 0.0:
        a, b, key = next_edge(mesh, longest, -1.0)
        if a >= 0 and -key > 0.0 and prepare_split(mesh, a, b, floor) > 0:
            return a, b, -key
    return NOWHERE, NOWHERE, 0.0


@inner_kernel
def holds_edge(mesh, count, a, b):
    node, old = mesh.elements.node, mesh.cavity.old
    for i in range(count):
        if corner_of(node, old[i], a) >= 0 and corner_of(node, old[i], b) >= 0:
            return True
    return False


@inner_kernel
def collapse_next(mesh, queue, shortest, most, longest, a, b, floor):
    """Collapse the shortest edge shorter than `most` that keeps edge ab.

    The node whose removal leaves the better worst element is removed. Returned is the remaining node, or -1.
    """
    while shortest.size[0] > 0 and shortest.key[0] < most:
        v, w, key = next_edge(mesh, shortest, 1.0)
        if v < 0 or not key < most:
            break
        quality, _, _ = prepare_collapse(mesh, v, w, floor, longest)
        other, count, new = prepare_collapse(mesh, w, v, floor, longest)
        if quality > other or (quality > 0.0 and holds_edge(mesh, count, a, b)):
            v, w = w, v
            other, count, new = prepare_collapse(mesh, w, v, floor, longest)
        if other > 0.0 and not holds_edge(mesh, count, a, b):
            collapse(mesh, w, count, new)
            enter_made(mesh, queue, new)
            return v
    return NOWHERE


@inner_kernel
def split_prepared(mesh, queue, longest, shortest, a, b, floor):
    count = prepare_split(mesh, a, b, floor)
    p = split(mesh, a, b, count)
    enter_made(mesh, queue, 2 * count)
    enter_edges(mesh, longest, shortest, p, False)


@kernel
def recycle(mesh, queue, longest, shortest, missing, ratio, floor, limit):
    """Split long edges and collapse short edges until all lengths are similar.

    Lengths are in the metric of the wanted density. A split puts a node into the middle of the longest edge. A collapse
    merges the nodes of the shortest edge. Each pair of both keeps the number of nodes. No pair follows if the longest
    edge is shorter than `ratio` times the shortest, or if no valid split or collapse is left.

    Parameters
    ----------
    queue
        Receives new elements, of which edges and faces are to be searched for swaps.
    longest, shortest
        Heaps of all edges, updated.
    missing
        Number of nodes to add by splits before the first pair. If negative, collapses remove nodes.
    ratio
        Largest ratio of lengths.
    floor
        Cube of the minimum quality.
    limit
        Maximum number of splits and of collapses in this call.

    Returns
    -------
    splits, collapses, finished
        `finished` is False if `limit` has ended the loop.
    """
    splits = collapses = 0
    while splits < limit and collapses < limit:
        if mesh.pool.height[1] < MOST or mesh.pool.height[0] == 0:
            return splits, collapses, True
        if splits - collapses > missing:
            if collapse_next(mesh, queue, shortest, UNLIMITED, UNLIMITED, NOWHERE, NOWHERE, floor) < 0:
                return splits, collapses, True
            collapses += 1
            continue
        a, b, length = next_split(mesh, longest, floor)
        if a < 0:
            return splits, collapses, True
        if splits - collapses == missing:
            v = collapse_next(mesh, queue, shortest, length / (ratio * ratio), length, a, b, floor)
            if v < 0:
                return splits, collapses, True
            collapses += 1
            enter_edges(mesh, longest, shortest, v, False)
        split_prepared(mesh, queue, longest, shortest, a, b, floor)
        splits += 1
    return splits, collapses, False
