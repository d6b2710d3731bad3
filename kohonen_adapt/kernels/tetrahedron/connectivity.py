"""Adjacency of tetrahedra, by faces, edges and nodes."""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel

# Row k holds the corners opposite to k, with (k, *row) in positive order.
OPPOSITE = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])

# Corners of the six edges, then the two remaining corners, in positive order.
EDGES = np.array([[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]])


@inner_kernel
def corner_of(node, e, v):
    for k in range(4):
        if node[e, k] == v:
            return k
    return -1


@inner_kernel
def corner_towards(node, other, a, b, c):
    for k in range(4):
        v = node[other, k]
        if v != a and v != b and v != c:
            return k
    return -1


@inner_kernel
def fourth_node(node, e, a, b, c):
    return np.int64(node[e, 0]) + node[e, 1] + node[e, 2] + node[e, 3] - a - b - c


@inner_kernel
def gather_around(mesh, v, around):
    """List the elements connected to v by faces, and return their count.

    Returned is -1 if `around` is too small.
    """
    node, neighbour, cavity = mesh.elements.node, mesh.elements.neighbour, mesh.cavity
    cavity.counter[0] += 1
    stamp = cavity.counter[0]
    around[0] = mesh.pool.anchor[v]
    cavity.element_stamp[around[0]] = stamp
    count, at = 1, 0
    while at < count:
        e = np.int64(around[at])
        at += 1
        for k in range(4):
            across = np.int64(neighbour[e, k])
            if across < 0 or node[e, k] == v or cavity.element_stamp[across] == stamp:
                continue
            if count == around.shape[0]:
                return -1
            cavity.element_stamp[across] = stamp
            around[count] = across
            count += 1
    return count


@inner_kernel
def gather_edge(mesh, a, b, shell):
    if mesh.pool.anchor[a] < 0 or mesh.pool.anchor[b] < 0:
        return 0
    count, found = gather_around(mesh, a, mesh.cavity.around), 0
    for i in range(count):
        e = mesh.cavity.around[i]
        if corner_of(mesh.elements.node, e, b) >= 0:
            shell[found] = e
            found += 1
    return found if count > 0 else -1


@inner_kernel
def has_constrained_face(mesh, a, b, c):
    elements, around = mesh.elements, mesh.cavity.around
    for i in range(gather_around(mesh, a, around)):
        e = np.int64(around[i])
        kb, kc = corner_of(elements.node, e, b), corner_of(elements.node, e, c)
        if kb < 0 or kc < 0:
            continue
        for k in range(4):
            if k != kb and k != kc and elements.node[e, k] != a and elements.patch[e, k] >= 0:
                return True
    return False


@kernel
def mark_non_manifold(mesh, star, non_manifold):
    for v in range(star.start.shape[0] - 1):
        non_manifold[v] = gather_around(mesh, v, mesh.cavity.around) != star.start[v + 1] - star.start[v]


@kernel
def fill_star(node, star):
    start = star.start
    nodes = start.shape[0] - 1
    for v in range(nodes + 1):
        start[v] = 0
    for e in range(node.shape[0]):
        if node[e, 0] >= 0:
            for k in range(4):
                start[node[e, k]] += 1
    for v in range(nodes):
        start[v + 1] += start[v]
    for e in range(node.shape[0] - 1, -1, -1):
        if node[e, 0] < 0:
            continue
        for k in range(4):
            v = node[e, k]
            start[v] -= 1
            row = start[v]
            star.element[row] = e
            for j in range(3):
                star.link[row, j] = node[e, OPPOSITE[k, j]]
