"""Recycling of neurons: the longest edges are split, the shortest collapsed, in pairs, at a constant number of nodes.

The dead-unit cure of vector quantisation (growing neural gas with utility; Fritzke 1995, 1997) on a mesh. Lengths are
those of the metric that the density sets: the length of an edge times the root of the density along it.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.chains import (
    FREE,
    MERGED,
    PAIRED,
    SLIDING,
    gone_along,
    parameter_of,
    point_at,
    way_along,
)
from kohonen_adapt.kernels.triangle.flip import corner_towards, flip_edge, push, should_flip
from kohonen_adapt.kernels.triangle.geometry import allowed, element_quality, may_join, signed_quality

NOWHERE = -1
SPLITTER = 2.0**29 + 1.0  # Dekker's: leaves 24 of 53 bits
EQUAL = 1e-9  # relative: qualities this near to one another count as the same, likewise


class Pool(NamedTuple):
    """Which rows of the arrays of nodes and elements are in use; rows of free elements have node -1."""

    anchor: np.ndarray  # (n,) int32: one of the elements around each node, -1 for a free row
    free_nodes: np.ndarray  # (n,) int32: a stack
    free_elements: np.ndarray  # (m,) int32: a stack
    height: np.ndarray  # (2,) int64: of the two stacks


class Heap(NamedTuple):
    """Edges by key, the smallest first; edges that are gone or changed stay in it and are skipped when they come up."""

    key: np.ndarray  # (k,)
    ends: np.ndarray  # (k, 2) int32
    size: np.ndarray  # (1,) int64


class Origins(NamedTuple):
    """What is known of each node beside its position and constraint."""

    density: np.ndarray  # (n,) wanted nodes per area
    old: np.ndarray  # (n,) int32: number before recycling, -1 for a new node
    hint: np.ndarray  # (n,) int32: an element of the mesh before recycling near the node
    pinned: np.ndarray  # (n,) bool: an edge between two of them is not split
    young: np.ndarray  # (n,) bool: made in this round; not collapsed in it, so that a round comes to an end
    pinched: np.ndarray  # (n,) bool: nodes where the mesh touches itself; nothing is collapsed into them


class Room(NamedTuple):
    """Scratch of the surgery."""

    around: np.ndarray  # (m,) int32: the elements around a node
    around_other: np.ndarray  # (m,) int32
    stamp: np.ndarray  # (n,) int64
    counter: np.ndarray  # (1,) int64
    stack: np.ndarray  # (m,) int32: elements whose edges may have to be flipped
    waiting: np.ndarray  # (m,) bool


@kernel
def insert(heap, key, a, b):
    """Put an edge into a heap, unless that is full: it is then to be filled anew, from the mesh."""
    i = heap.size[0]
    if i == heap.key.shape[0]:
        return
    heap.size[0] = i + 1
    while i > 0:
        parent = (i - 1) >> 1
        if heap.key[parent] <= key:
            break
        heap.key[i] = heap.key[parent]
        heap.ends[i, 0], heap.ends[i, 1] = heap.ends[parent, 0], heap.ends[parent, 1]
        i = parent
    heap.key[i], heap.ends[i, 0], heap.ends[i, 1] = key, a, b


@kernel
def remove_first(heap):
    """Take the edge with the smallest key out of a heap that is not empty; returns key and ends."""
    first, a, b = heap.key[0], np.int64(heap.ends[0, 0]), np.int64(heap.ends[0, 1])
    last = heap.size[0] - 1
    heap.size[0] = last
    key, end, other = heap.key[last], heap.ends[last, 0], heap.ends[last, 1]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= last:
            break
        if child + 1 < last and heap.key[child + 1] < heap.key[child]:
            child += 1
        if heap.key[child] >= key:
            break
        heap.key[i] = heap.key[child]
        heap.ends[i, 0], heap.ends[i, 1] = heap.ends[child, 0], heap.ends[child, 1]
        i = child
    heap.key[i], heap.ends[i, 0], heap.ends[i, 1] = key, end, other
    return first, a, b


@inner_kernel
def metric_length(position, density, a, b):
    """Square of the length of an edge in the metric, the same whichever end comes first.

    Rounded to 24 bits, so that lengths which only rounding tells apart are the same, and it does not choose the edge.
    """
    dx, dy = position[a, 0] - position[b, 0], position[a, 1] - position[b, 1]
    length = (dx * dx + dy * dy) * np.sqrt(density[a] * density[b])
    spread = length * SPLITTER
    return spread - (spread - length)


@inner_kernel
def enter(position, origins, longest, shortest, a, b):
    """Put an edge into both heaps."""
    length = metric_length(position, origins.density, a, b)
    insert(longest, -length, a, b)
    insert(shortest, length, a, b)


@inner_kernel
def corner_of(node, e, v):
    """Local number of node v in element e."""
    if node[e, 0] == v:
        return 0
    return 1 if node[e, 1] == v else 2


@inner_kernel
def gather_around(elements, pool, v, around):
    """List the elements around v counter-clockwise, at an outline those on both ways from the anchor."""
    node, neighbour = elements.node, elements.neighbour
    count, first = 0, np.int64(pool.anchor[v])
    e = first
    while e >= 0:
        around[count] = e
        count += 1
        e = np.int64(neighbour[e, (corner_of(node, e, v) + 1) % 3])
        if e == first:
            return count
    e = np.int64(neighbour[first, (corner_of(node, first, v) + 2) % 3])
    while e >= 0:
        around[count] = e
        count += 1
        e = np.int64(neighbour[e, (corner_of(node, e, v) + 2) % 3])
    return count


@inner_kernel
def find_edge(elements, pool, a, b, around):
    """An element with the edge ab and the local number of the corner opposite to it, or (-1, -1)."""
    node = elements.node
    for i in range(gather_around(elements, pool, a, around)):
        e = np.int64(around[i])
        k = corner_of(node, e, a)
        if node[e, (k + 1) % 3] == b:
            return e, (k + 2) % 3
        if node[e, (k + 2) % 3] == b:
            return e, (k + 1) % 3
    return NOWHERE, NOWHERE


@inner_kernel
def next_edge(position, elements, pool, origins, heap, sign, around):
    """Take edges out of a heap until one is still there as it was; returns element, corner, key; (-1, -1, 0) if none.

    `sign` turns a metric length into the heap's key.
    """
    while heap.size[0] > 0:
        key, a, b = remove_first(heap)
        if pool.anchor[a] < 0 or pool.anchor[b] < 0:
            continue
        if sign * metric_length(position, origins.density, a, b) != key:
            continue
        e, k = find_edge(elements, pool, a, b, around)
        if e >= 0:
            return e, k, key
    return NOWHERE, NOWHERE, 0.0


@inner_kernel
def half_qualities(position, node, e, k, x, y):
    """Worse quality of the two halves of element e, its edge opposite to corner k split at (x, y)."""
    a, b, c = node[e, (k + 1) % 3], node[e, (k + 2) % 3], node[e, k]
    ax, ay, bx, by, cx, cy = (
        position[a, 0],
        position[a, 1],
        position[b, 0],
        position[b, 1],
        position[c, 0],
        position[c, 1],
    )
    return min(signed_quality(ax, ay, x, y, cx, cy), signed_quality(x, y, bx, by, cx, cy))


@inner_kernel
def midpoint(position, constraints, c, a, b):
    """The middle of an edge; on a chain the middle in its parameter, which comes third."""
    ax, ay, bx, by = position[a, 0], position[a, 1], position[b, 0], position[b, 1]
    if c < 0:
        return 0.5 * (ax + bx), 0.5 * (ay + by), 0.0
    chains = constraints.chains
    start = parameter_of(position, constraints, c, a)
    end = parameter_of(position, constraints, c, b)
    parameter = gone_along(chains, c, start, 0.5 * way_along(chains, c, start, end))
    x, y = point_at(chains, c, parameter)
    return x, y, parameter


@inner_kernel
def may_split(position, elements, pinned, e, k, floor, x, y):
    """Whether the edge opposite to corner k of e may be split there under the quality rule."""
    node, other = elements.node, np.int64(elements.neighbour[e, k])
    if pinned[node[e, (k + 1) % 3]] and pinned[node[e, (k + 2) % 3]]:
        return False
    after, before = half_qualities(position, node, e, k, x, y), element_quality(position, node, e)
    if other >= 0:
        j = corner_towards(elements.neighbour, other, e)
        after = min(after, half_qualities(position, node, other, j, x, y))
        before = min(before, element_quality(position, node, other))
    return allowed(after, before, floor)


@inner_kernel
def halve(elements, pool, e, k, p):
    """Give the half of e at the end of its edge opposite to corner k to a new element; p is the new node there."""
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    pool.height[1] -= 1
    new = pool.free_elements[pool.height[1]]
    k1, k2 = (k + 1) % 3, (k + 2) % 3
    across = neighbour[e, k1]
    node[new, 0], node[new, 1], node[new, 2] = node[e, k], p, node[e, k2]
    neighbour[new, 1], chain[new, 1] = across, chain[e, k1]
    neighbour[new, 2], chain[new, 2] = e, -1
    chain[new, 0], elements.region[new] = chain[e, k], elements.region[e]
    if across >= 0:
        neighbour[across, corner_towards(neighbour, across, e)] = new
    node[e, k2], neighbour[e, k1], chain[e, k1] = p, new, -1
    pool.anchor[node[e, k]], pool.anchor[node[e, k1]], pool.anchor[node[new, 2]] = e, e, new
    return new


@inner_kernel
def guide(elements, constraints, e, k):
    """Of the nodes of e one to find the middle of its edge opposite to corner k from, on the same bank of any slit."""
    c = elements.chain[e, k]
    for v in (elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]):
        if constraints.inner[v] or (c >= 0 and constraints.kind[v] == SLIDING and constraints.chain[v, 0] == c):
            return v
    return elements.node[e, k]


@inner_kernel
def split(position, elements, constraints, pool, origins, e, k, x, y, parameter):
    """Split the edge opposite to corner k of e at (x, y); returns the new node."""
    node, neighbour = elements.node, elements.neighbour
    a, b, other = node[e, (k + 1) % 3], node[e, (k + 2) % 3], np.int64(neighbour[e, k])
    c = elements.chain[e, k]
    j = corner_towards(neighbour, other, e) if other >= 0 else 0
    pool.height[0] -= 1
    p = np.int64(pool.free_nodes[pool.height[0]])
    position[p, 0], position[p, 1] = x, y
    constraints.kind[p] = FREE if c < 0 else SLIDING
    constraints.chain[p, 0], constraints.chain[p, 1], constraints.parameter[p] = c, -1, parameter
    # either end's will do; the sides' are the outermost, and a node inside with one of those could join less
    elements.level[p] = elements.level[b if constraints.kind[b] == FREE else a]
    constraints.inner[p] = other >= 0 and elements.region[other] == elements.region[e]
    origins.density[p] = 0.5 * (origins.density[a] + origins.density[b])
    origins.old[p], origins.hint[p] = -1, origins.hint[guide(elements, constraints, e, k)]
    origins.pinned[p] = origins.pinched[p] = False
    origins.young[p] = True
    new = halve(elements, pool, e, k, p)
    pool.anchor[p] = e
    neighbour[new, 0] = other
    if other >= 0:
        new_other = halve(elements, pool, other, j, p)
        neighbour[e, k], neighbour[new_other, 0] = new_other, e
        neighbour[other, j] = new
    return p


@inner_kernel
def collapsed_quality(position, elements, constraints, pool, origins, v, w, longest, floor, room):
    """Worst quality around v were it merged into its neighbour w, or -1 where that is not allowed.

    An interior node may go into any neighbour, one on an outline along its own chain only. The only nodes that v and w
    have both for neighbours must be those opposite to their edge (link condition), or the mesh would be pinched. No
    edge may become as long as the one that is split for it, or the two could go on for ever.
    """
    node, chain = elements.node, elements.chain
    if constraints.kind[v] != FREE and constraints.kind[v] != SLIDING:
        return -1.0
    if origins.pinched[w] or origins.young[v] or constraints.twins.partner[v] >= 0:
        return -1.0
    count = gather_around(elements, pool, v, room.around)
    room.counter[0] += 2
    mark = room.counter[0]
    shared, before, after = 0, 2.0, 2.0
    for i in range(count):
        e = np.int64(room.around[i])
        k = corner_of(node, e, v)
        a, b = node[e, (k + 1) % 3], node[e, (k + 2) % 3]
        room.stamp[a], room.stamp[b] = mark, mark
        before = min(before, element_quality(position, node, e))
        if a == w or b == w:
            shared += 1
            to_w = (k + 2) % 3 if a == w else (k + 1) % 3
            to_x, across = (k + 1) % 3 if a == w else (k + 2) % 3, elements.neighbour[e, k]
            if constraints.kind[v] == SLIDING and chain[e, to_w] != constraints.chain[v, 0]:
                return -1.0
            if chain[e, to_x] >= 0 or (across < 0 and elements.neighbour[e, to_x] < 0):
                return -1.0
            continue
        if not (may_join(elements, e, w, a) and may_join(elements, e, w, b)):
            return -1.0
        if not joins_within_reach(position, constraints, w, a, chain[e, (k + 2) % 3]):
            return -1.0
        if not joins_within_reach(position, constraints, w, b, chain[e, (k + 1) % 3]):
            return -1.0
        q = signed_quality(
            position[w, 0], position[w, 1], position[a, 0], position[a, 1], position[b, 0], position[b, 1]
        )
        if not q >= after:
            after = q
        if (
            max(metric_length(position, origins.density, w, a), metric_length(position, origins.density, w, b))
            >= longest
        ):
            return -1.0
    if after > 1.5 or not allowed(after, before, floor):
        return -1.0
    common = 0
    for i in range(gather_around(elements, pool, w, room.around_other)):
        e = np.int64(room.around_other[i])
        k = corner_of(node, e, w)
        for other in (node[e, (k + 1) % 3], node[e, (k + 2) % 3]):
            if room.stamp[other] == mark:
                room.stamp[other] = mark + 1
                common += 1
    return after if common == shared else -1.0


@inner_kernel
def joins_within_reach(position, constraints, w, other, c):
    """Whether the facet between two nodes that an edge of chain c is to become is no longer than it may be."""
    if c < 0:
        return True
    dx, dy = position[w, 0] - position[other, 0], position[w, 1] - position[other, 1]
    return dx * dx + dy * dy <= constraints.chains.place[c, MERGED] ** 2


@inner_kernel
def collapse(elements, pool, v, w, room):
    """Merge node v into its neighbour w; returns the number of elements around v that are left, in room.around."""
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    count, left = gather_around(elements, pool, v, room.around), 0
    for i in range(count):
        e = np.int64(room.around[i])
        k = corner_of(node, e, v)
        if node[e, (k + 1) % 3] != w and node[e, (k + 2) % 3] != w:
            node[e, k] = w
            pool.anchor[w] = e
            room.around[left] = e
            left += 1
            continue
        kw = corner_of(node, e, w)
        kx = 3 - k - kw
        outside, inside = np.int64(neighbour[e, k]), np.int64(neighbour[e, kw])
        if outside >= 0:
            neighbour[outside, corner_towards(neighbour, outside, e)] = inside
        if inside >= 0:
            j = corner_towards(neighbour, inside, e)
            neighbour[inside, j], chain[inside, j] = outside, chain[e, k]
        pool.anchor[node[e, kx]] = inside if inside >= 0 else outside
        node[e, 0] = node[e, 1] = node[e, 2] = -1
        pool.free_elements[pool.height[1]] = e
        pool.height[1] += 1
    pool.anchor[v] = -1
    pool.free_nodes[pool.height[0]] = v
    pool.height[0] += 1
    return left


@inner_kernel
def settle(position, elements, pool, origins, longest, shortest, floor, height, room):
    """Flip around the elements on the stack until nothing is left to flip, and enter the new edges."""
    node = elements.node
    while height > 0:
        height -= 1
        e = np.int64(room.stack[height])
        room.waiting[e] = False
        if node[e, 0] < 0:
            continue
        for k in range(3):
            other = np.int64(elements.neighbour[e, k])
            if other < 0 or not should_flip(position, elements, e, k, other, floor):
                continue
            p, q, r = np.int64(node[e, (k + 1) % 3]), np.int64(node[e, (k + 2) % 3]), np.int64(node[e, k])
            s = node[other, 0] + node[other, 1] + node[other, 2] - p - q
            flip_edge(elements, e, k)
            pool.anchor[p], pool.anchor[q] = e, other
            enter(position, origins, longest, shortest, r, s)
            height = push(room.stack, room.waiting, push(room.stack, room.waiting, height, other), e)
            break


@inner_kernel
def enter_around(position, elements, pool, origins, longest, shortest, v, height, room):
    """Enter the edges of v and put the elements around it on the stack; returns its new height."""
    node = elements.node
    for i in range(gather_around(elements, pool, v, room.around)):
        e = np.int64(room.around[i])
        k = corner_of(node, e, v)
        enter(position, origins, longest, shortest, v, np.int64(node[e, (k + 1) % 3]))
        if elements.neighbour[e, (k + 1) % 3] < 0:
            enter(position, origins, longest, shortest, v, np.int64(node[e, (k + 2) % 3]))
        height = push(room.stack, room.waiting, height, e)
    return height


@kernel
def fill_heaps(position, elements, origins, longest, shortest):
    """Enter every edge once."""
    longest.size[0] = shortest.size[0] = 0
    for e in range(elements.node.shape[0]):
        if elements.node[e, 0] < 0:
            continue
        for k in range(3):
            if elements.neighbour[e, k] < e:  # the outer boundary is -1
                a, b = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
                enter(position, origins, longest, shortest, a, b)


@inner_kernel
def split_longest(position, elements, constraints, pool, origins, longest, shortest, least, floor, room):
    """Split the longest edge that may be, if longer than `least`; returns the new node, an end, and the length."""
    while longest.size[0] > 0 and -longest.key[0] > least:
        e, k, key = next_edge(position, elements, pool, origins, longest, -1.0, room.around)
        if e < 0 or not -key > least:
            break
        a, b = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
        c = np.int64(elements.chain[e, k])
        x, y, parameter = midpoint(position, constraints, c, a, b)
        if c >= 0 and constraints.chains.flags[c, PAIRED]:
            continue  # the nodes of a periodic pair are neither made nor taken away
        if may_split(position, elements, origins.pinned, e, k, floor, x, y):
            return split(position, elements, constraints, pool, origins, e, k, x, y, parameter), a, -key
    return NOWHERE, NOWHERE, 0.0


@inner_kernel
def collapse_shortest(position, elements, constraints, pool, origins, shortest, most, longest, spared, floor, room):
    """Collapse the shortest edge that may be, if shorter than `most` and not at `spared`; returns the node left."""
    while shortest.size[0] > 0 and shortest.key[0] < most:
        e, k, key = next_edge(position, elements, pool, origins, shortest, 1.0, room.around)
        if e < 0 or not key < most:
            break
        v, w = np.int64(elements.node[e, (k + 1) % 3]), np.int64(elements.node[e, (k + 2) % 3])
        if v == spared or w == spared:
            continue
        forth = collapsed_quality(position, elements, constraints, pool, origins, v, w, longest, floor, room)
        back = collapsed_quality(position, elements, constraints, pool, origins, w, v, longest, floor, room)
        if max(forth, back) < 0.0:
            continue
        if back > forth * (1.0 + EQUAL):
            v, w = w, v
        collapse(elements, pool, v, w, room)
        return w
    return NOWHERE


@kernel
def recycle(position, elements, constraints, pool, origins, longest, shortest, missing, ratio, floor, limit, room):
    """Split the longest edges, collapsing the shortest for it, while the one is more than `ratio` times the other.

    The first `missing` splits are without a collapse: the mesh grows. Returns splits, collapses and whether the end was
    reached before about `limit` splits. There is one free node too many, so that the split can come first: where no
    collapse follows it is taken back, and the number of nodes is right at any time.
    """
    splits = collapses = 0
    full = longest.key.shape[0]
    while splits < limit:
        if longest.size[0] == full or shortest.size[0] == full:
            fill_heaps(position, elements, origins, longest, shortest)
        grows = splits < missing
        least = 0.0 if grows or shortest.size[0] == 0 else ratio * ratio * shortest.key[0]
        p, end, length = split_longest(
            position, elements, constraints, pool, origins, longest, shortest, least, floor, room
        )
        if p < 0:
            return splits, collapses, True
        merged = NOWHERE
        if not grows:
            most = length / (ratio * ratio)
            merged = collapse_shortest(
                position, elements, constraints, pool, origins, shortest, most, length, p, floor, room
            )
            if merged < 0:
                collapse(elements, pool, p, end, room)
                return splits, collapses, True
            collapses += 1
        splits += 1
        height = enter_around(position, elements, pool, origins, longest, shortest, p, np.int64(0), room)
        if merged >= 0:
            height = enter_around(position, elements, pool, origins, longest, shortest, merged, height, room)
        settle(position, elements, pool, origins, longest, shortest, floor, height, room)
    return splits, collapses, False


@kernel
def spread_starts(elements, start, queue):
    """For elements without a start (-1) that of the nearest element of their region, over edges."""
    first, last = 0, 0
    for e in range(start.shape[0]):
        if start[e] >= 0:
            queue[last] = e
            last += 1
    while first < last:
        e = queue[first]
        first += 1
        for k in range(3):
            across = elements.neighbour[e, k]
            if across >= 0 and start[across] < 0 and elements.region[across] == elements.region[e]:
                start[across] = start[e]
                queue[last] = across
                last += 1
