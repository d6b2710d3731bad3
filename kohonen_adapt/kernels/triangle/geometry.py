"""Corners, neighbours, stars and quality of triangles."""

import math

from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.vectors import cross, dot, from_to, minus, plus_dot, times, xy

SQRT12 = 2.0 * math.sqrt(3.0)
FLAT = 1e-12  # minimum quality above rounding, required of every move and flip whatever the floor


@inner_kernel
def corner_of(node, e, v):
    if node[e, 0] == v:
        return 0
    return 1 if node[e, 1] == v else 2


@inner_kernel
def corner_towards(neighbour, e, other):
    for k in range(3):
        if neighbour[e, k] == other:
            return k
    return -1


@inner_kernel
def rows_with(star, v, w):
    """Return two rows of the star of `v` and the third nodes of their elements.

    The elements contain the edge from `v` to `w`. The result is (row, node, row, node), first the row with `w` ahead,
    then the row with `w` behind, with -1 for a missing row.
    """
    ahead, one, behind, other = -1, -1, -1, -1
    for row in rows_of(star, v):
        if star.ahead[row] == w:
            ahead = row
            one = star.behind[row]
        elif star.behind[row] == w:
            behind = row
            other = star.ahead[row]
    return ahead, one, behind, other


@inner_kernel
def row_beside(rows, third):
    if third == rows[1]:
        return rows[0]
    return rows[2] if third == rows[3] else -1


@inner_kernel
def ends_of(node, e, k):
    return node[e, (k + 1) % 3], node[e, (k + 2) % 3]


@inner_kernel
def corners_around(node, e, k, other):
    p, q = ends_of(node, e, k)
    return p, q, node[e, k], node[other, 0] + node[other, 1] + node[other, 2] - p - q


@inner_kernel
def has_edge(node, neighbour, e, v, other):
    for direction in (1, 2):
        at = e
        while at >= 0:
            k = corner_of(node, at, v)
            if node[at, (k + 1) % 3] == other or node[at, (k + 2) % 3] == other:
                return True
            at = neighbour[at, (k + direction) % 3]
            if at == e:
                break
    return False


@kernel
def find_starts(node, start):
    for v in range(start.shape[0]):
        start[v] = 0
    for e in range(node.shape[0]):
        for k in range(3):
            start[node[e, k] + 1] += 1
    for v in range(start.shape[0] - 1):
        start[v + 1] += start[v]


@kernel
def fill_star(node, star, first, last, cursor):
    for v in range(first, last):
        cursor[v] = star.start[v]
    for e in range(node.shape[0]):
        a, b, c = node[e, 0], node[e, 1], node[e, 2]
        for v, ahead, behind in ((a, b, c), (b, c, a), (c, a, b)):
            if first <= v < last:
                k = cursor[v]
                star.element[k], star.ahead[k], star.behind[k] = e, ahead, behind
                cursor[v] = k + 1


@kernel
def spread_starts(elements, start, queue):
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


@inner_kernel
def may_join(elements, e, v, w):
    return not elements.layered[elements.region[e]] or abs(elements.level[v] - elements.level[w]) <= 1


@inner_kernel
def orientation(a, b, c):
    return cross(minus(b, a), minus(c, a))


@inner_kernel
def twice_area(position, a, b, c):
    return orientation(xy(position, a), xy(position, b), xy(position, c))


@inner_kernel
def sum_of_squares(u, v, w):
    return plus_dot(plus_dot(dot(u, u), v, v), w, w)


@inner_kernel
def signed_quality(a, b, c):
    """Return the quality 2 sqrt(3) D / (sum of squared sides), D the doubled area.

    The sign is the orientation, and an equilateral triangle has quality 1. The quality of three equal points is nan,
    which fails every comparison.
    """
    u, v, w = minus(b, a), minus(c, a), minus(c, b)
    return SQRT12 * cross(u, v) / sum_of_squares(u, v, w)


@inner_kernel
def element_quality(position, node, e):
    return signed_quality(xy(position, node[e, 0]), xy(position, node[e, 1]), xy(position, node[e, 2]))


@inner_kernel
def allowed(after, before, floor):
    """Return True if the quality rule allows a change.

    The worst quality after the change must reach `floor` or the worst quality before.
    """
    return floor == UNGUARDED or (after > FLAT and after >= min(floor, before))


@inner_kernel
def quality_bound(floor):
    return 2.0 * max(floor, FLAT) / SQRT12


@inner_kernel
def exceeds_quality(bound, u, v):
    """Return True if the triangle of edges u, v exceeds a minimum quality.

    `bound` is `quality_bound(floor)`. The test is equivalent to a comparison of `signed_quality` and three times
    faster, without a division.
    """
    return cross(u, v) > bound * plus_dot(plus_dot(dot(u, u), v, v), times(-1.0, u), v)


@inner_kernel
def star_tolerable(position, star, v, x, floor):
    bound = quality_bound(floor)
    for k in rows_of(star, v):
        if not exceeds_quality(bound, from_to(x, position, star.ahead[k]), from_to(x, position, star.behind[k])):
            return floor == UNGUARDED
    return True


@kernel
def mark_valid(position, star, floor, first, last, is_valid):
    """Mark the nodes `first` to `last` whose stars satisfy the floor.

    Guarded moves of a marked node need no comparison with the quality before. A neighbour whose own star violates the
    floor may worsen a marked star. The guard is then stricter than the quality rule until the next call.
    """
    for v in range(first, last):
        is_valid[v] = star_tolerable(position, star, v, xy(position, v), floor)
