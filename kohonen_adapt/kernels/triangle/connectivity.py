"""Corners, edges, neighbours and stars of triangles."""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel


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
    ahead, one, behind, other = np.int64(-1), np.int64(-1), np.int64(-1), np.int64(-1)
    for row in range(star.start[v], star.start[v + 1]):
        if star.ahead[row] == w:
            ahead, one = np.int64(row), np.int64(star.behind[row])
        elif star.behind[row] == w:
            behind, other = np.int64(row), np.int64(star.ahead[row])
    return ahead, one, behind, other


@inner_kernel
def row_beside(rows, third):
    if third == rows[1]:
        return rows[0]
    return rows[2] if third == rows[3] else -1


@inner_kernel
def corners_around(node, e, k, other):
    p, q, r = np.int64(node[e, (k + 1) % 3]), np.int64(node[e, (k + 2) % 3]), np.int64(node[e, k])
    return p, q, r, node[other, 0] + node[other, 1] + node[other, 2] - p - q


@inner_kernel
def has_edge(node, neighbour, e, v, other):
    for direction in (1, 2):
        at = e
        while at >= 0:
            k = corner_of(node, at, v)
            if node[at, (k + 1) % 3] == other or node[at, (k + 2) % 3] == other:
                return True
            at = np.int64(neighbour[at, (k + direction) % 3])
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
