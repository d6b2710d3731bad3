"""Recycling of nodes, splits of the longest and collapses of the shortest edges.

The method is the removal of dead units in vector quantisation (growing neural gas with utility; Fritzke 1995,
1997), applied to a mesh. Lengths are those of the metric of the ends, in which the density is one node per unit
area.
"""

import numpy as np

from kohonen_adapt.kernels.heap import insert, remove_first
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.flip import flip_edge, may_flip, push, should_flip
from kohonen_adapt.kernels.triangle.geometry import allowed, corner_of, corners_around, ends_of
from kohonen_adapt.kernels.triangle.metric import effective_element_quality
from kohonen_adapt.kernels.triangle.surgery import (
    NOWHERE,
    collapse,
    collapsed_quality,
    find_edge,
    gather_around,
    is_pinned,
    may_split,
    metric_length,
    midpoint,
    quality_beside,
    split,
)

EQUAL = 1e-9  # relative tolerance of equal qualities, so that rounding does not decide


@inner_kernel
def push_edge(mesh, longest, shortest, a, b):
    length = metric_length(mesh, a, b)
    insert(longest, -length, a, b)
    insert(shortest, length, a, b)


@inner_kernel
def next_edge(mesh, heap, sign):
    while heap.size[0] > 0:
        key, a, b = remove_first(heap)
        if mesh.pool.anchor[a] < 0 or mesh.pool.anchor[b] < 0:
            continue
        if sign * metric_length(mesh, a, b) != key:
            continue
        e, k = find_edge(mesh, a, b)
        if e >= 0:
            return e, k, key
    return NOWHERE, NOWHERE, 0.0


@inner_kernel
def flip_at(mesh, e, k):
    elements, pool = mesh.elements, mesh.pool
    other = elements.neighbour[e, k]
    p, q, _, _ = corners_around(elements.node, e, k, other)
    flip_edge(elements, e, k)
    pool.anchor[p], pool.anchor[q] = e, other


@inner_kernel
def restore_delaunay(mesh, longest, shortest, floor, height):
    elements, scratch = mesh.elements, mesh.scratch
    node = elements.node
    while height > 0:
        height -= 1
        e = scratch.stack[height]
        scratch.waiting[e] = False
        if node[e, 0] < 0:
            continue
        for k in range(3):
            other = elements.neighbour[e, k]
            if other < 0 or not should_flip(mesh.position, elements, mesh.metric, e, k, other, floor):
                continue
            _, _, r, s = corners_around(node, e, k, other)
            flip_at(mesh, e, k)
            push_edge(mesh, longest, shortest, r, s)
            height = push(scratch.stack, scratch.waiting, push(scratch.stack, scratch.waiting, height, other), e)
            break


@inner_kernel
def push_around(mesh, longest, shortest, v, height):
    elements, scratch = mesh.elements, mesh.scratch
    node = elements.node
    for i in range(gather_around(mesh, v, scratch.around)):
        e = scratch.around[i]
        k = corner_of(node, e, v)
        push_edge(mesh, longest, shortest, v, node[e, (k + 1) % 3])
        if elements.neighbour[e, (k + 1) % 3] < 0:
            push_edge(mesh, longest, shortest, v, node[e, (k + 2) % 3])
        height = push(scratch.stack, scratch.waiting, height, e)
    return height


@kernel
def fill_heaps(mesh, longest, shortest):
    elements = mesh.elements
    longest.size[0] = shortest.size[0] = 0
    for e in range(elements.node.shape[0]):
        if elements.node[e, 0] < 0:
            continue
        for k in range(3):
            if elements.neighbour[e, k] < e:  # the outer boundary is -1
                a, b = ends_of(elements.node, e, k)
                push_edge(mesh, longest, shortest, a, b)


@inner_kernel
def worst_around(mesh, v):
    worst, around = 2.0, mesh.scratch.around
    for i in range(gather_around(mesh, v, around)):
        quality = effective_element_quality(mesh.position, mesh.metric, mesh.elements.node, around[i])
        worst = min(worst, quality)
    return worst


@inner_kernel
def split_and_flip(mesh, e, k, floor, x, parameter):
    """Split an edge, with flips if the halves violate the quality rule.

    The edges opposite to the new node are flipped. Return the new node, or -1 with the mesh unchanged if the halves
    still violate the rule. Along a boundary all elements at the end of a long edge can be too thin to be halved
    without flips.
    """
    position, elements, scratch = mesh.position, mesh.elements, mesh.scratch
    before = quality_beside(mesh, e, k)
    end = elements.node[e, (k + 1) % 3]
    flips = 0
    p = split(mesh, e, k, x, parameter)
    for i in range(gather_around(mesh, p, scratch.around)):
        half = scratch.around[i]
        j = corner_of(elements.node, half, p)
        across = elements.neighbour[half, j]
        if across < 0 or elements.chain[half, j] >= 0:
            continue
        fine = allowed(effective_element_quality(position, mesh.metric, elements.node, half), before, floor)
        if not fine and may_flip(position, elements, mesh.metric, half, j, across, floor):
            flip_at(mesh, half, j)
            scratch.around_other[flips] = half
            flips += 1
    if allowed(worst_around(mesh, p), before, floor):
        return p
    while flips > 0:
        flips -= 1
        half = scratch.around_other[flips]
        flip_at(mesh, half, (corner_of(elements.node, half, p) + 1) % 3)
    collapse(mesh, p, end)
    return NOWHERE


@inner_kernel
def split_longest(mesh, longest, least, floor, flips):
    elements, constraints = mesh.elements, mesh.constraints
    while longest.size[0] > 0 and -longest.key[0] > least:
        e, k, key = next_edge(mesh, longest, -1.0)
        if e < 0 or not -key > least:
            break
        a, b = ends_of(elements.node, e, k)
        c = elements.chain[e, k]
        x, parameter = midpoint(mesh, c, a, b)
        if c >= 0 and constraints.chains.paired[c]:
            continue  # nodes of periodic pairs are neither created nor removed
        if may_split(mesh, e, k, floor, x):
            return split(mesh, e, k, x, parameter), a, -key
        if flips and not is_pinned(mesh, e, k):
            p = split_and_flip(mesh, e, k, floor, x, parameter)
            if p >= 0:
                return p, a, -key
    return NOWHERE, NOWHERE, 0.0


@inner_kernel
def collapse_shortest(mesh, shortest, most, longest, spared, floor):
    while shortest.size[0] > 0 and shortest.key[0] < most:
        e, k, key = next_edge(mesh, shortest, 1.0)
        if e < 0 or not key < most:
            break
        v, w = ends_of(mesh.elements.node, e, k)
        if v == spared or w == spared:
            continue
        forth = collapsed_quality(mesh, v, w, longest, floor)
        back = collapsed_quality(mesh, w, v, longest, floor)
        if max(forth, back) < 0.0:
            continue
        if back > forth * (1.0 + EQUAL):
            v, w = w, v
        collapse(mesh, v, w)
        return w
    return NOWHERE


@kernel
def recycle(mesh, longest, shortest, missing, ratio, floor, limit):
    """Exchange splits of the longest for collapses of the shortest edges.

    Pairs are exchanged while the longest edge is longer than `ratio` times the shortest. The first `missing` splits
    have no collapse, and a negative `missing` is the number of collapses without a split. A split precedes its
    collapse, which requires a free node, and is reverted if no collapse is allowed.

    Returns
    -------
    splits, collapses, finished
        Numbers of operations, and True if finished before about `limit` splits.
    """
    splits = collapses = 0
    full = longest.key.shape[0]
    while collapses < -missing:
        if longest.size[0] == full or shortest.size[0] == full:
            fill_heaps(mesh, longest, shortest)
        merged = collapse_shortest(mesh, shortest, np.inf, np.inf, NOWHERE, floor)
        if merged < 0:
            break
        collapses += 1
        restore_delaunay(mesh, longest, shortest, floor, push_around(mesh, longest, shortest, merged, 0))
    while splits < limit:
        if longest.size[0] == full or shortest.size[0] == full:
            fill_heaps(mesh, longest, shortest)
        grows = splits < missing
        least = 0.0 if grows or shortest.size[0] == 0 else ratio * ratio * shortest.key[0]
        p, end, length = split_longest(mesh, longest, least, floor, grows)
        if p < 0:
            return splits, collapses, True
        merged = NOWHERE
        if not grows:
            most = length / (ratio * ratio)
            merged = collapse_shortest(mesh, shortest, most, length, p, floor)
            if merged < 0:
                collapse(mesh, p, end)
                return splits, collapses, True
            collapses += 1
        splits += 1
        height = push_around(mesh, longest, shortest, p, 0)
        if merged >= 0:
            height = push_around(mesh, longest, shortest, merged, height)
        restore_delaunay(mesh, longest, shortest, floor, height)
    return splits, collapses, False
