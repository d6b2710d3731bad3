"""Stars of nodes and neighbours of elements."""

import numpy as np

from kohonen_adapt.kernels.compilation import kernel


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


@kernel
def number_regions(neighbour, code, region, stack):
    """Number the connected sets of elements that carry the same code, in the order of their first elements, (m,)."""
    region[:] = -1
    count = 0
    for seed in range(region.shape[0]):
        if region[seed] >= 0:
            continue
        region[seed], stack[0], last = count, seed, 1
        while last > 0:
            last -= 1
            e = stack[last]
            for k in range(3):
                other = neighbour[e, k]
                if other >= 0 and region[other] < 0 and code[other] == code[e]:
                    region[other], stack[last] = count, other
                    last += 1
        count += 1
