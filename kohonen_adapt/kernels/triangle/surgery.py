"""Edge splits and collapses allowed by boundaries, layers and the quality rule."""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.arrays import FREE, OTHER, OWN, SLIDING
from kohonen_adapt.kernels.triangle.chains import midpoint_on_chain
from kohonen_adapt.kernels.triangle.geometry import allowed, corner_of, corner_towards, ends_of, may_join
from kohonen_adapt.kernels.triangle.metric import (
    effective_element_quality,
    effective_quality,
    set_mean_shape,
    squared_length,
)
from kohonen_adapt.kernels.vectors import from_to, plus, put, squared_distance, times, xy

NOWHERE = -1
SPLITTER = 2.0**29 + 1.0  # Dekker's constant, leaves 24 of 53 bits


@inner_kernel
def metric_length(mesh, a, b):
    """Return the squared length of an edge in the mean metric of the ends.

    The length is rounded to 24 bits, so that rounding errors do not decide between edges of equal length.
    """
    density = mesh.origins.density
    edge = from_to(xy(mesh.position, b), mesh.position, a)
    length = squared_length(mesh.metric.shape, a, b, edge) * np.sqrt(density[a] * density[b])
    spread = length * SPLITTER
    return spread - (spread - length)


@inner_kernel
def gather_around(mesh, v, around):
    node, neighbour = mesh.elements.node, mesh.elements.neighbour
    count = 0
    first = mesh.pool.anchor[v]
    e = first
    while e >= 0:
        around[count] = e
        count += 1
        e = neighbour[e, (corner_of(node, e, v) + 1) % 3]
        if e == first:
            return count
    e = neighbour[first, (corner_of(node, first, v) + 2) % 3]
    while e >= 0:
        around[count] = e
        count += 1
        e = neighbour[e, (corner_of(node, e, v) + 2) % 3]
    return count


@inner_kernel
def find_edge(mesh, a, b):
    node, around = mesh.elements.node, mesh.scratch.around
    for i in range(gather_around(mesh, a, around)):
        e = around[i]
        k = corner_of(node, e, a)
        if node[e, (k + 1) % 3] == b:
            return e, (k + 2) % 3
        if node[e, (k + 2) % 3] == b:
            return e, (k + 1) % 3
    return NOWHERE, NOWHERE


@inner_kernel
def half_qualities(mesh, e, k, x):
    position, node, metric = mesh.position, mesh.elements.node, mesh.metric
    (a, b), c = ends_of(node, e, k), node[e, k]
    at_c = xy(position, c)
    return min(
        effective_quality(metric, a, b, c, xy(position, a), x, at_c),
        effective_quality(metric, a, b, c, x, xy(position, b), at_c),
    )


@inner_kernel
def midpoint(mesh, c, a, b):
    position = mesh.position
    if c < 0:
        return times(0.5, plus(xy(position, a), xy(position, b))), 0.0
    return midpoint_on_chain(position, mesh.constraints, c, a, b)


@inner_kernel
def is_pinned(mesh, e, k):
    node, pinned = mesh.elements.node, mesh.origins.pinned
    return pinned[node[e, (k + 1) % 3]] and pinned[node[e, (k + 2) % 3]]


@inner_kernel
def quality_beside(mesh, e, k):
    position, node = mesh.position, mesh.elements.node
    other = mesh.elements.neighbour[e, k]
    quality = effective_element_quality(position, mesh.metric, node, e)
    return min(quality, effective_element_quality(position, mesh.metric, node, other)) if other >= 0 else quality


@inner_kernel
def may_split(mesh, e, k, floor, x):
    if is_pinned(mesh, e, k):
        return False
    neighbour = mesh.elements.neighbour
    other = neighbour[e, k]
    after = half_qualities(mesh, e, k, x)
    if other >= 0:
        after = min(after, half_qualities(mesh, other, corner_towards(neighbour, other, e), x))
    return allowed(after, quality_beside(mesh, e, k), floor)


@inner_kernel
def halve_element(mesh, e, k, p):
    elements, pool = mesh.elements, mesh.pool
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    pool.height[1] -= 1
    new = pool.free_elements[pool.height[1]]
    k1, k2 = (k + 1) % 3, (k + 2) % 3
    across = neighbour[e, k1]
    node[new, 0] = node[e, k]
    node[new, 1] = p
    node[new, 2] = node[e, k2]
    neighbour[new, 1], chain[new, 1] = across, chain[e, k1]
    neighbour[new, 2], chain[new, 2] = e, -1
    chain[new, 0], elements.region[new] = chain[e, k], elements.region[e]
    if across >= 0:
        neighbour[across, corner_towards(neighbour, across, e)] = new
    node[e, k2], neighbour[e, k1] = p, new
    chain[e, k1] = -1
    pool.anchor[node[e, k]], pool.anchor[node[e, k1]], pool.anchor[node[new, 2]] = e, e, new
    return new


@inner_kernel
def start_node(elements, constraints, e, k):
    c = elements.chain[e, k]
    for v in ends_of(elements.node, e, k):
        if constraints.inner[v] or (c >= 0 and constraints.kind[v] == SLIDING and constraints.chain[v, OWN] == c):
            return v
    return elements.node[e, k]


@inner_kernel
def split(mesh, e, k, x, parameter):
    elements, constraints, pool, origins = mesh.elements, mesh.constraints, mesh.pool, mesh.origins
    node, neighbour = elements.node, elements.neighbour
    a, b = ends_of(node, e, k)
    other = neighbour[e, k]
    c = elements.chain[e, k]
    j = corner_towards(neighbour, other, e) if other >= 0 else 0
    pool.height[0] -= 1
    p = pool.free_nodes[pool.height[0]]
    put(mesh.position, p, x)
    constraints.kind[p] = FREE if c < 0 else SLIDING
    constraints.chain[p, OWN] = c
    constraints.chain[p, OTHER] = -1
    constraints.parameter[p] = parameter
    # the level of a free end, because the level of an outermost layer would restrict the edges of an interior node
    elements.level[p] = elements.level[b if constraints.kind[b] == FREE else a]
    constraints.inner[p] = other >= 0 and elements.region[other] == elements.region[e]
    origins.density[p] = 0.5 * (origins.density[a] + origins.density[b])
    set_mean_shape(mesh.metric.shape, p, a, b)
    origins.old[p], origins.start_element[p] = -1, origins.start_element[start_node(elements, constraints, e, k)]
    origins.pinned[p] = origins.non_manifold[p] = False
    origins.longest[p] = min(origins.longest[a], origins.longest[b])
    origins.is_new[p] = True
    new = halve_element(mesh, e, k, p)
    pool.anchor[p] = e
    neighbour[new, 0] = other
    if other >= 0:
        new_other = halve_element(mesh, other, j, p)
        neighbour[e, k], neighbour[new_other, 0] = new_other, e
        neighbour[other, j] = new
    return p


@inner_kernel
def collapsed_quality(mesh, v, w, longest, floor):
    """Return the worst quality around `v` merged into `w`, or -1 if not allowed.

    An interior node may merge into any neighbour, a boundary node only along its own segment. The common neighbours of
    `v` and `w` must be the nodes opposite to their edge (link condition), or the mesh would be non-manifold. No new
    edge may be as long as `longest`, the split edge, or the exchange might not terminate.
    """
    position, elements, constraints = mesh.position, mesh.elements, mesh.constraints
    node, chain, origins, scratch = elements.node, elements.chain, mesh.origins, mesh.scratch
    if constraints.kind[v] != FREE and constraints.kind[v] != SLIDING:
        return -1.0
    if origins.non_manifold[w] or origins.is_new[v] or constraints.periodic.partner[v] >= 0:
        return -1.0
    count = gather_around(mesh, v, scratch.around)
    scratch.counter[0] += 2
    mark = scratch.counter[0]
    shared, before, after = 0, 2.0, 2.0
    for i in range(count):
        e = scratch.around[i]
        k = corner_of(node, e, v)
        a, b = ends_of(node, e, k)
        scratch.stamp[a], scratch.stamp[b] = mark, mark
        before = min(before, effective_element_quality(position, mesh.metric, node, e))
        if a == w or b == w:
            shared += 1
            to_w = (k + 2) % 3 if a == w else (k + 1) % 3
            to_x = (k + 1) % 3 if a == w else (k + 2) % 3
            across = elements.neighbour[e, k]
            if constraints.kind[v] == SLIDING and chain[e, to_w] != constraints.chain[v, OWN]:
                return -1.0
            if chain[e, to_x] >= 0 or (across < 0 and elements.neighbour[e, to_x] < 0):
                return -1.0
            continue
        if not (may_join(elements, e, w, a) and may_join(elements, e, w, b)):
            return -1.0
        if not joins_within_reach(mesh, v, w, a, chain[e, (k + 2) % 3]):
            return -1.0
        if not joins_within_reach(mesh, v, w, b, chain[e, (k + 1) % 3]):
            return -1.0
        q = effective_quality(mesh.metric, w, a, b, xy(position, w), xy(position, a), xy(position, b))
        if not q >= after:
            after = q
        if max(metric_length(mesh, w, a), metric_length(mesh, w, b)) >= longest:
            return -1.0
    if after > 1.5 or not allowed(after, before, floor):
        return -1.0
    return after if count_marked(mesh, w, mark) == shared else -1.0


@inner_kernel
def count_marked(mesh, w, mark):
    node, scratch = mesh.elements.node, mesh.scratch
    count = 0
    for i in range(gather_around(mesh, w, scratch.around_other)):
        e = scratch.around_other[i]
        k = corner_of(node, e, w)
        for other in ends_of(node, e, k):
            if scratch.stamp[other] == mark:
                scratch.stamp[other] = mark + 1  # so that no neighbour counts twice
                count += 1
    return count


@inner_kernel
def joins_within_reach(mesh, v, w, other, c):
    if c < 0:
        return True
    longest = min(mesh.constraints.chains.merged[c], mesh.origins.longest[v])
    return squared_distance(mesh.position, other, xy(mesh.position, w)) <= longest * longest


@inner_kernel
def collapse(mesh, v, w):
    """Merge node `v` into its neighbour `w`.

    Return the number of remaining elements around `v`, which are listed in `scratch.around`.
    """
    elements, pool, scratch = mesh.elements, mesh.pool, mesh.scratch
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    count = gather_around(mesh, v, scratch.around)
    left = 0
    for i in range(count):
        e = scratch.around[i]
        k = corner_of(node, e, v)
        if node[e, (k + 1) % 3] != w and node[e, (k + 2) % 3] != w:
            node[e, k] = w
            pool.anchor[w] = e
            scratch.around[left] = e
            left += 1
            continue
        kw = corner_of(node, e, w)
        kx = 3 - k - kw
        outside, inside = neighbour[e, k], neighbour[e, kw]
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
