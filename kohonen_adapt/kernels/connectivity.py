"""Stars of nodes and neighbours of elements."""

import numpy as np

from .compilation import kernel


@kernel
def fill_star(node, star):
    """List the elements around every node, in the order of their numbers."""
    start, n = star.start, star.start.shape[0] - 1
    start[:] = 0
    for e in range(node.shape[0]):
        for k in range(3):
            start[node[e, k] + 1] += 1
    for v in range(n):
        start[v + 1] += start[v]
    cursor = start[:n].copy()
    for e in range(node.shape[0]):
        a, b, c = node[e, 0], node[e, 1], node[e, 2]
        for v, ahead, behind in ((a, b, c), (b, c, a), (c, a, b)):
            k = cursor[v]
            star.element[k], star.ahead[k], star.behind[k] = e, ahead, behind
            cursor[v] = k + 1


@kernel
def link_neighbours(node, star, neighbour):
    """Find the element across every edge; returns an element with an edge that two elements run along the same way.

    On a valid mesh both run along it in opposite senses, and the return value is -1.
    """
    for e in range(node.shape[0]):
        for k in range(3):
            a, b = node[e, (k + 1) % 3], node[e, (k + 2) % 3]
            twin = -1
            for j in range(star.start[b], star.start[b + 1]):
                if star.ahead[j] == a:
                    if twin >= 0:
                        return e
                    twin = star.element[j]
            neighbour[e, k] = twin
            for j in range(star.start[a], star.start[a + 1]):
                if star.ahead[j] == b and star.element[j] != e:
                    return e
    return np.int32(-1)
