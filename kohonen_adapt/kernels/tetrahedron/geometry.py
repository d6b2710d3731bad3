"""Adjacency, volumes and quality of tetrahedra, and moves under the quality rule."""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import next_stamp
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.vectors import between, cross, dot, from_to, plus, point, put, times

# Row k holds the corners opposite to k, with (k, *row) in positive order.
OPPOSITE = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])

# Corners of the six edges, then the two remaining corners, in positive order.
EDGES = np.array([[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]])

FLAT = 1e-18  # largest cubed quality of a flat element
ACROSS, UNUSED = -1, -2  # parts of elements with mixed nodes, and of unused rows


@inner_kernel
def corners_of(node, e):
    return node[e, 0], node[e, 1], node[e, 2], node[e, 3]


@inner_kernel
def face_of(node, e, k):
    """Return the nodes opposite to corner k."""
    return node[e, OPPOSITE[k, 0]], node[e, OPPOSITE[k, 1]], node[e, OPPOSITE[k, 2]]


@inner_kernel
def corners_of_edge(edge):
    return EDGES[edge, 0], EDGES[edge, 1]


@inner_kernel
def edge_of(node, e, edge):
    return node[e, EDGES[edge, 0]], node[e, EDGES[edge, 1]]


@inner_kernel
def others(star, row):
    """Return the remaining nodes of an element around a node."""
    return star.link[row, 0], star.link[row, 1], star.link[row, 2]


@inner_kernel
def corners_around(star, row, v):
    return v, np.int64(star.link[row, 0]), np.int64(star.link[row, 1]), np.int64(star.link[row, 2])  # of one type


@inner_kernel
def corner_of(node, e, v):
    for k in range(4):
        if node[e, k] == v:
            return k
    return -1


@inner_kernel
def fourth_node(node, e, a, b, c):
    return node[e, 0] + node[e, 1] + node[e, 2] + node[e, 3] - a - b - c


@inner_kernel
def gather_around(mesh, v, around):
    """List the elements connected to v by faces, and return their count.

    Returned is -1 if `around` is too small.
    """
    node, neighbour, cavity = mesh.elements.node, mesh.elements.neighbour, mesh.cavity
    stamp = next_stamp(cavity)
    around[0] = mesh.pool.anchor[v]
    cavity.element_stamp[around[0]] = stamp
    count, at = 1, 0
    while at < count:
        e = around[at]
        at += 1
        for k in range(4):
            across = neighbour[e, k]
            if across < 0 or node[e, k] == v or cavity.element_stamp[across] == stamp:
                continue
            if count == around.shape[0]:
                return -1
            cavity.element_stamp[across] = stamp
            around[count] = across
            count += 1
    return count


@inner_kernel
def list_shell(mesh, around, count, w, shell):
    """List the elements with node w among `count` elements, and return their count."""
    found = 0
    for i in range(count):
        if corner_of(mesh.elements.node, around[i], w) >= 0:
            shell[found] = around[i]
            found += 1
    return found


@inner_kernel
def gather_edge(mesh, a, b, shell):
    if mesh.pool.anchor[a] < 0 or mesh.pool.anchor[b] < 0:
        return 0
    count = gather_around(mesh, a, mesh.cavity.around)
    found = list_shell(mesh, mesh.cavity.around, count, b, shell)
    return found if count > 0 else -1


@inner_kernel
def list_neighbours(mesh, v, around, count):
    """List the neighbours of v in `cavity.made`, and return their count.

    The elements around v must be in `around`.
    """
    node, cavity = mesh.elements.node, mesh.cavity
    found = 0
    stamp = next_stamp(cavity)
    cavity.node_stamp[v] = stamp
    for i in range(count):
        for k in range(4):
            w = node[around[i], k]
            if cavity.node_stamp[w] != stamp:
                cavity.node_stamp[w] = stamp
                cavity.made[found] = w
                found += 1
    return found


@inner_kernel
def has_constrained_face(mesh, a, b, c):
    elements, around = mesh.elements, mesh.cavity.around
    for i in range(gather_around(mesh, a, around)):
        e = around[i]
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


@inner_kernel
def six_volumes(position, a, b, c, d):
    return dot(between(position, a, b), cross(between(position, a, c), between(position, a, d)))


@inner_kernel
def cubed_quality(position, a, b, c, d):
    return cubed_quality_at(position, point(position, a), b, c, d)


@inner_kernel
def cubed_quality_at(position, x, b, c, d):
    u, v, w = from_to(x, position, b), from_to(x, position, c), from_to(x, position, d)
    squares = 3.0 * (dot(u, u) + dot(v, v) + dot(w, w)) - 2.0 * (dot(u, v) + dot(u, w) + dot(v, w))  # six edges
    return cubed_of(dot(u, cross(v, w)), squares)


@inner_kernel
def cubed_of(six_volumes, squares):
    """Return the cubed quality by six times the volume and the squared edges."""
    return 432.0 * six_volumes * abs(six_volumes) / (squares * squares * squares)


@inner_kernel
def triangle_vectors(position, p, q, r):
    """Return u, v, u x v and 3 (|u|^2 + |v|^2) - 2 u . v of a triangle.

    The vectors u and v lead from p to q and r. All tetrahedra on the triangle share these terms.
    """
    u, v = between(position, p, q), between(position, p, r)
    return u, v, cross(u, v), 3.0 * (dot(u, u) + dot(v, v)) - 2.0 * dot(u, v)


@inner_kernel
def cubed_quality_on(vectors, w, side):
    """Return the cubed quality of the tetrahedron of a triangle and a node.

    `vectors` is the result of `triangle_vectors`, and w the vector from the first node of the triangle to the node.
    `side` is 1 if u x v points to the node, otherwise -1. Returned is 0 for flat and inverted elements.
    """
    u, v, across, squares = vectors
    volume = side * dot(w, across)
    if not volume > 0.0:
        return 0.0
    squares += 3.0 * dot(w, w) - 2.0 * dot(w, plus(u, v))
    return 432.0 * volume * volume / (squares * squares * squares)


@inner_kernel
def sum_of_squares(u, v, w):
    total = plus(plus(u, v), w)
    return 4.0 * (dot(u, u) + dot(v, v) + dot(w, w)) - dot(total, total)


@inner_kernel
def element_quality(position, node, e):
    return cubed_quality(position, *corners_of(node, e))


@inner_kernel
def element_volumes(position, node, e):
    return six_volumes(position, *corners_of(node, e))


@inner_kernel
def allowed(after, before, floor):
    return after > FLAT and after >= min(floor, before)


@inner_kernel
def star_quality(position, star, v, x, least):
    """Return the worst cubed quality around v at x.

    The search ends at the first quality below `least`.
    """
    worst = 2.0
    for j in rows_of(star, v):
        quality = cubed_quality_at(position, x, *others(star, j))
        if not quality >= worst:
            worst = quality
            if not worst >= least:
                return worst
    return worst


@inner_kernel
def rounded(length):
    """Return a length rounded to 24 bits by Dekker's split.

    Lengths that differ by rounding errors are equal afterwards.
    """
    spread = length * (2.0**29 + 1.0)
    return np.float64(spread - (spread - length))


@inner_kernel
def set_slopes(position, slope, a, b, c, d):
    u, v, w = between(position, a, b), between(position, a, c), between(position, a, d)
    across = cross(v, w)
    six = dot(u, across)
    inverse = 1.0 / six
    put(slope, 1, times(inverse, across))
    put(slope, 2, times(inverse, cross(w, u)))
    put(slope, 3, times(inverse, cross(u, v)))
    for k in range(3):
        slope[0, k] = -(slope[1, k] + slope[2, k] + slope[3, k])
    return six


@kernel
def find_parts(node, part, of_element):
    for e in range(node.shape[0]):
        own = UNUSED if node[e, 0] < 0 else part[node[e, 0]]
        for k in range(1, 4):
            if own >= 0 and part[node[e, k]] != own:
                own = ACROSS
        of_element[e] = own
