"""Flip edges until every region is constrained Delaunay, as far as the quality rule lets it (Lawson)."""

import numpy as np

from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.connectivity import corner_towards, corners_around, joined
from kohonen_adapt.kernels.triangle.geometry import FLAT, allowed, element_quality, may_join, signed_quality

COCIRCULAR = 1e-10  # relative: four points this near to one circle count as on it, so that rounding decides nothing


@inner_kernel
def not_delaunay(px, py, qx, qy, rx, ry, sx, sy):
    """Whether s lies well inside the circle through p, q, r (counter-clockwise); edge pq is to be replaced by rs.

    The angles at r and s over the edge sum up to more than pi: sin(r + s) < 0, relative to the lengths of their legs.
    """
    ax, ay, bx, by = px - rx, py - ry, qx - rx, qy - ry
    cx, cy, dx, dy = qx - sx, qy - sy, px - sx, py - sy
    cos_r, sin_r = ax * bx + ay * by, ax * by - ay * bx
    cos_s, sin_s = cx * dx + cy * dy, cx * dy - cy * dx
    total = sin_r * cos_s + cos_r * sin_s
    return total < 0.0 and total < -COCIRCULAR * (abs(cos_r) + sin_r) * (abs(cos_s) + sin_s)


@inner_kernel
def should_flip(position, elements, e, k, other, floor):
    """Whether the edge opposite to corner k of e is free, not Delaunay, and allowed to flip."""
    if elements.chain[e, k] >= 0:
        return False
    p, q, r, s = corners_around(elements.node, e, k, other)
    px, py, qx, qy = position[p, 0], position[p, 1], position[q, 0], position[q, 1]
    if not not_delaunay(px, py, qx, qy, position[r, 0], position[r, 1], position[s, 0], position[s, 1]):
        return False
    return may_flip(position, elements, e, k, other, floor)


@inner_kernel
def may_flip(position, elements, e, k, other, floor):
    """Whether layers and the quality rule allow the flip of the edge opposite to corner k of e.

    Where the rule is switched off elements may lie on one another. Flips of overturned ones need not come to an end,
    and the new edge may be there already: neither is done.
    """
    node = elements.node
    p, q, r, s = corners_around(node, e, k, other)
    if not may_join(elements, e, r, s):
        return False
    px, py, qx, qy = position[p, 0], position[p, 1], position[q, 0], position[q, 1]
    rx, ry, sx, sy = position[r, 0], position[r, 1], position[s, 0], position[s, 1]
    after = min(signed_quality(rx, ry, px, py, sx, sy), signed_quality(sx, sy, qx, qy, rx, ry))
    before = min(element_quality(position, node, e), element_quality(position, node, other))
    if after <= FLAT or before <= 0.0 or (floor == UNGUARDED and joined(node, elements.neighbour, e, r, s)):
        return False
    return allowed(after, before, floor)


@inner_kernel
def flip_edge(elements, e, k):
    """Replace the edge pq between e = (r, p, q) and its neighbour (s, q, p) by rs: e = (r, p, s), other = (s, q, r)."""
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    other = np.int64(neighbour[e, k])
    j = corner_towards(neighbour, other, e)
    k1, k2, j1, j2 = (k + 1) % 3, (k + 2) % 3, (j + 1) % 3, (j + 2) % 3
    r, s = node[e, k], node[other, j]
    beyond_e, beyond_other = np.int64(neighbour[e, k1]), np.int64(neighbour[other, j1])
    chain_e, chain_other = chain[e, k1], chain[other, j1]
    node[e, k2], node[other, j2] = s, r
    neighbour[e, k], chain[e, k] = beyond_other, chain_other
    neighbour[other, j], chain[other, j] = beyond_e, chain_e
    neighbour[e, k1], chain[e, k1] = other, -1
    neighbour[other, j1], chain[other, j1] = e, -1
    if beyond_other >= 0:
        neighbour[beyond_other, corner_towards(neighbour, beyond_other, other)] = e
    if beyond_e >= 0:
        neighbour[beyond_e, corner_towards(neighbour, beyond_e, e)] = other


@inner_kernel
def push(stack, waiting, height, e):
    """Put an element on the stack unless it waits there already; returns the new height."""
    if waiting[e]:
        return height
    waiting[e] = True
    stack[height] = e
    return height + 1


@kernel
def mark_doubtful(position, elements, first, last, doubtful):
    """Mark which of the elements `first` to `last` have an edge, to one of higher number, that is not Delaunay."""
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    for e in range(first, last):
        a, b, c = node[e, 0], node[e, 1], node[e, 2]
        ax, ay, bx, by = position[a, 0], position[a, 1], position[b, 0], position[b, 1]
        cx, cy, together = position[c, 0], position[c, 1], a + b + c
        doubtful[e] = False
        for k in range(3):
            other = neighbour[e, k]
            if other > e and chain[e, k] < 0:
                s = node[other, 0] + node[other, 1] + node[other, 2] + node[e, k] - together
                if not_delaunay(bx, by, cx, cy, ax, ay, position[s, 0], position[s, 1]):
                    doubtful[e] = True
            ax, ay, bx, by, cx, cy = bx, by, cx, cy, ax, ay


@kernel
def flip_edges(position, elements, floor, doubtful, stack, waiting, limit):
    """Flip until nothing is left to flip, or about `limit` times; returns the number of flips.

    `doubtful` (m,) says which elements to start from. `stack` (m,) and `waiting` (m,) False are scratch: the elements
    whose edges are to be looked at again, because a flip changed something beside them.
    """
    flips = 0
    for first in range(elements.node.shape[0]):
        if flips >= limit:
            break
        if not doubtful[first]:
            continue
        for side in range(3):
            other = np.int64(elements.neighbour[first, side])
            if other <= first or not should_flip(position, elements, first, side, other, floor):
                continue
            flip_edge(elements, first, side)
            flips += 1
            height = push(stack, waiting, push(stack, waiting, np.int64(0), other), first)
            while height > 0 and flips < limit:
                height -= 1
                e = np.int64(stack[height])
                waiting[e] = False
                for k in range(3):
                    across = np.int64(elements.neighbour[e, k])
                    if across >= 0 and should_flip(position, elements, e, k, across, floor):
                        flip_edge(elements, e, k)
                        flips += 1
                        height = push(stack, waiting, push(stack, waiting, height, across), e)
                        break
            for i in range(height):
                waiting[stack[i]] = False
    return flips
