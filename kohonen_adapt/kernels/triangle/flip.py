"""Edge flips to constrained Delaunay regions under the quality rule (Lawson)."""

from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.geometry import (
    FLAT,
    allowed,
    corner_towards,
    corners_around,
    has_edge,
    may_join,
    sum_of_squares,
)
from kohonen_adapt.kernels.triangle.metric import (
    effective_element_quality,
    effective_quality,
    factor_of_four,
    factor_of_three,
)
from kohonen_adapt.kernels.vectors import cross, dot, from_to, mapped, minus, xy

COCIRCULAR = 1e-10  # relative tolerance, so that rounding does not decide between four points on a circle


@inner_kernel
def not_delaunay(position, shape, p, q, r, s):
    """Return True if s lies inside the circle through p, q, r in the metric.

    The triangle (p, q, r) is counter-clockwise, and the edge rs is to replace pq. The angles at r and s opposite to pq
    sum to more than pi, so sin(r + s) < 0, relative to the lengths of the legs. Angles are measured in the mean metric
    of the four nodes.
    """
    map_ = factor_of_four(shape, p, q, r, s)
    at_r, at_s = xy(position, r), xy(position, s)
    a, b = mapped(map_, from_to(at_r, position, p)), mapped(map_, from_to(at_r, position, q))
    c, d = mapped(map_, from_to(at_s, position, q)), mapped(map_, from_to(at_s, position, p))
    cos_r, sin_r = dot(a, b), cross(a, b)
    cos_s, sin_s = dot(c, d), cross(c, d)
    total = sin_r * cos_s + cos_r * sin_s
    return total < 0.0 and total < -COCIRCULAR * (abs(cos_r) + sin_r) * (abs(cos_s) + sin_s)


@inner_kernel
def should_flip(position, elements, metric, e, k, other, floor):
    if elements.chain[e, k] >= 0:
        return False
    p, q, r, s = corners_around(elements.node, e, k, other)
    if not not_delaunay(position, metric.shape, p, q, r, s):
        return False
    # where the metric varies, flips by circles alone may go round in a ring for ever
    if varies(metric.shape, p, q, r, s) and not lowers_error(position, metric.shape, p, q, r, s):
        return False
    return may_flip(position, elements, metric, e, k, other, floor)


@inner_kernel
def varies(shape, p, q, r, s):
    for k in range(shape.shape[1]):
        if shape[p, k] != shape[q, k] or shape[p, k] != shape[r, k] or shape[p, k] != shape[s, k]:
            return True
    return False


@inner_kernel
def lowers_error(position, shape, p, q, r, s):
    before = interpolation_error(position, shape, r, p, q) + interpolation_error(position, shape, s, q, p)
    after = interpolation_error(position, shape, r, p, s) + interpolation_error(position, shape, s, q, r)
    return after < before * (1.0 - COCIRCULAR)


@inner_kernel
def interpolation_error(position, shape, a, b, c):
    # of a quadratic function whose second derivatives are the mean shape of the corners, up to a factor: area times the
    # sum of the squared edges; Delaunay flips lower this sum (Rajan, Discrete Comput. Geom. 12, 1994)
    map_ = factor_of_three(shape, a, b, c)
    x = xy(position, a)
    u, v = mapped(map_, from_to(x, position, b)), mapped(map_, from_to(x, position, c))
    return abs(cross(u, v)) * sum_of_squares(u, v, minus(v, u))


@inner_kernel
def may_flip(position, elements, metric, e, k, other, floor):
    node = elements.node
    p, q, r, s = corners_around(node, e, k, other)
    at_r, at_s = xy(position, r), xy(position, s)
    after = min(
        effective_quality(metric, r, p, s, at_r, xy(position, p), at_s),
        effective_quality(metric, s, q, r, at_s, xy(position, q), at_r),
    )
    before = min(
        effective_element_quality(position, metric, node, e), effective_element_quality(position, metric, node, other)
    )
    if not may_join(elements, e, r, s):
        return False
    # Without a floor elements may overlap: flips of inverted elements may not terminate, and rs may be an edge already.
    if after <= FLAT or before <= 0.0 or (floor == UNGUARDED and has_edge(node, elements.neighbour, e, r, s)):
        return False
    return allowed(after, before, floor)


@inner_kernel
def flip_edge(elements, e, k):
    """Replace edge pq of `e` = (r, p, q) and (s, q, p) by rs.

    The result is `e` = (r, p, s) and (s, q, r).
    """
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    other = neighbour[e, k]
    j = corner_towards(neighbour, other, e)
    k1, k2, j1, j2 = (k + 1) % 3, (k + 2) % 3, (j + 1) % 3, (j + 2) % 3
    r, s = node[e, k], node[other, j]
    across_e, across_other = neighbour[e, k1], neighbour[other, j1]
    chain_e, chain_other = chain[e, k1], chain[other, j1]
    node[e, k2], node[other, j2] = s, r
    neighbour[e, k], chain[e, k] = across_other, chain_other
    neighbour[other, j], chain[other, j] = across_e, chain_e
    neighbour[e, k1], chain[e, k1] = other, -1
    neighbour[other, j1], chain[other, j1] = e, -1
    if across_other >= 0:
        neighbour[across_other, corner_towards(neighbour, across_other, other)] = e
    if across_e >= 0:
        neighbour[across_e, corner_towards(neighbour, across_e, e)] = other


@inner_kernel
def mark_neighbours(elements, e, marked):
    for k in range(3):
        if elements.neighbour[e, k] >= 0:
            marked[elements.neighbour[e, k]] = True


@inner_kernel
def push(stack, waiting, height, e):
    if waiting[e]:
        return height
    waiting[e] = True
    stack[height] = e
    return height + 1


@kernel
def mark_non_delaunay(position, elements, shape, first, last, candidates):
    node, neighbour, chain = elements.node, elements.neighbour, elements.chain
    for e in range(first, last):
        a, b, c = node[e, 0], node[e, 1], node[e, 2]
        together = a + b + c
        candidates[e] = False
        for k in range(3):
            other = neighbour[e, k]
            if other > e and chain[e, k] < 0:
                s = node[other, 0] + node[other, 1] + node[other, 2] + node[e, k] - together
                if not_delaunay(position, shape, b, c, a, s):
                    candidates[e] = True
            a, b, c = b, c, a


@kernel
def flip_edges(position, elements, metric, floor, candidates, stack, waiting, limit):
    """Flip edges until none is left to flip, and return the number of flips.

    The number of flips exceeds `limit` only slightly. `candidates`, shape (m,), marks the elements to begin with.
    `stack` and `waiting`, shape (m,), are scratch for the elements changed by flips, with `waiting` False at entry.
    """
    flips = 0
    for first in range(elements.node.shape[0]):
        if flips >= limit:
            break
        if not candidates[first]:
            continue
        for side in range(3):
            other = elements.neighbour[first, side]
            if other <= first or not should_flip(position, elements, metric, first, side, other, floor):
                continue
            flip_edge(elements, first, side)
            flips += 1
            height = push(stack, waiting, push(stack, waiting, 0, other), first)
            while height > 0 and flips < limit:
                height -= 1
                e = stack[height]
                waiting[e] = False
                for k in range(3):
                    across = elements.neighbour[e, k]
                    if across >= 0 and should_flip(position, elements, metric, e, k, across, floor):
                        flip_edge(elements, e, k)
                        flips += 1
                        height = push(stack, waiting, push(stack, waiting, height, across), e)
                        break
            for i in range(height):
                waiting[stack[i]] = False
    return flips
