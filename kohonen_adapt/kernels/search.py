"""Walks and searches for elements and nodes, on triangles and on tetrahedra.

numba compiles them for the number of components of the point.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.vectors import between, cross, dot, from_to, mapped, minus, plus_times, point, xy

TOLERANCE = 1e-10  # relative to the element size, so that points on edges and faces are inside
WALK = 128  # maximum number of steps; walks from grid cells in uniform meshes take two to four


@inner_kernel
def next_stamp(scratch):
    scratch.counter[0] += 1
    return scratch.counter[0]


@inner_kernel
def element_in_region(elements, star, v, region):
    for k in range(star.start[v], star.start[v + 1]):
        if elements.region[star.element[k]] == region:
            return np.int64(star.element[k])
    return np.int64(star.element[star.start[v]])


@inner_kernel
def size_at_side(position, node, e, k, x):
    """Return the size of the element of x and side k of e, negative outside.

    The size is twice the area or six times the volume.
    """
    if len(x) == 2:
        a, b = xy(position, node[e, (k + 1) % 3]), xy(position, node[e, (k + 2) % 3])
        return cross(minus(b, a), minus(x, a))
    first, second, third = node[e, (k + 1) & 3], node[e, (k + 2) & 3], node[e, (k + 3) & 3]
    normal = cross(between(position, first, second), between(position, first, third))
    size = dot(minus(x, point(position, first)), normal)
    return size if k & 1 else -size  # the orientation of the next three corners alternates


@inner_kernel
def depth_in_element(position, node, e, x):
    """Return the least barycentric coordinate of x."""
    least, total = np.inf, 0.0
    for k in range(len(x) + 1):
        size = size_at_side(position, node, e, k, x)
        least = min(least, size)
        total += size
    return least / total


@inner_kernel
def walk(position, elements, e, x):
    node, region = elements.node, elements.region[e]
    e = np.int64(e)
    for _ in range(WALK):
        onward, most = np.int64(-1), 0.0
        least, total = np.inf, 0.0
        for k in range(len(x) + 1):
            size = size_at_side(position, node, e, k, x)
            least = min(least, size)
            total += size
            across = np.int64(elements.neighbour[e, k])
            if size < most and across >= 0 and elements.region[across] == region:
                onward, most = across, size
        if least / total >= -TOLERANCE:
            return e, True
        if onward < 0:
            return e, False
        e = onward
    return e, False


@inner_kernel
def find_in_cell(position, elements, grid, c, x):
    """Return the element of grid cell c that contains x, -1 if none.

    The walk starts at an element of the cell. If the walk fails, all elements of the cell are tested.
    """
    start, content = grid.start, grid.content
    if start[c] == start[c + 1]:
        return np.int64(-1)
    e, inside = walk(position, elements, content[start[c]], x)
    if inside:
        return e
    best, deepest = np.int64(-1), -TOLERANCE
    for k in range(start[c], start[c + 1]):
        depth = depth_in_element(position, elements.node, np.int64(content[k]), x)
        if depth >= deepest:
            best, deepest = np.int64(content[k]), depth
    return best


@inner_kernel
def flood(position, elements, e, x, scratch):
    """Return an element around x in the region of e, or the element nearest to x."""
    stamp, queue, region = next_stamp(scratch), scratch.queue, elements.region[e]
    queue[0], scratch.element_stamp[e] = e, stamp
    first, last = 0, 1
    best, deepest = e, -np.inf
    while first < last and deepest < -TOLERANCE:
        e = np.int64(queue[first])
        first += 1
        depth = depth_in_element(position, elements.node, e, x)
        if depth > deepest:
            best, deepest = e, depth
        for k in range(len(x) + 1):
            across = elements.neighbour[e, k]
            if across >= 0 and elements.region[across] == region and scratch.element_stamp[across] != stamp:
                scratch.element_stamp[across] = stamp
                queue[last] = across
                last += 1
    return best


@inner_kernel
def nearest_visible(position, elements, e, x, factor, scratch):
    """Return the nearest node visible from x in its region, and the squared distance.

    Distances are measured after the linear map `factor`. Ties are resolved by the lowest index. A node is visible if
    the ball around x with the node on its boundary connects both within the region. Each element has a reach, the
    smallest radius of a ball that connects x to the element (the largest distance to a crossed side). Elements are
    visited by increasing reach, and nodes nearer than the reach are skipped, because a slit or a corner is in between.
    """
    stamp = next_stamp(scratch)
    frontier, reach = scratch.frontier, scratch.reach
    region = elements.region[e]
    frontier[0], reach[0] = e, 0.0
    scratch.element_stamp[e] = stamp
    count, winner = 1, np.int64(-1)
    best = np.inf
    while count > 0:
        near = 0
        for i in range(1, count):
            if reach[i] < reach[near]:
                near = i
        if reach[near] > best:
            break
        e, entered = frontier[near], reach[near]
        count -= 1
        frontier[near], reach[near] = frontier[count], reach[count]
        for k in range(len(x) + 1):
            v = np.int64(elements.node[e, k])
            offset = mapped(factor, from_to(x, position, v))
            distance = dot(offset, offset)
            if distance >= entered and (distance < best or (distance == best and v < winner)):
                winner, best = v, distance
        for k in range(len(x) + 1):
            across = elements.neighbour[e, k]
            if across < 0 or elements.region[across] != region:
                continue
            waiting, known = count, scratch.element_stamp[across] == stamp
            if known:
                waiting = 0
                while waiting < count and frontier[waiting] != across:
                    waiting += 1
                if waiting == count:
                    continue
            distance = max(entered, squared_distance_to_side(position, elements.node, factor, e, k, x))
            if known:
                reach[waiting] = min(reach[waiting], distance)
            elif distance <= best:
                scratch.element_stamp[across] = stamp
                frontier[count], reach[count] = across, distance
                count += 1
    return winner, best


@inner_kernel
def squared_distance_to_side(position, node, factor, e, k, x):
    corners = len(x) + 1
    a = mapped(factor, from_to(x, position, node[e, (k + 1) % corners]))
    b = mapped(factor, from_to(x, position, node[e, (k + 2) % corners]))
    if len(x) == 2:
        return squared_distance_to_edge(a, b)
    c = mapped(factor, from_to(x, position, node[e, (k + 3) % corners]))
    normal = cross(minus(b, a), minus(c, a))
    square = dot(normal, normal)
    # the foot of the perpendicular is in the face if on the inner side of every edge
    beyond_ab, beyond_bc = dot(normal, cross(a, b)) < 0.0, dot(normal, cross(b, c)) < 0.0
    beyond_ca = dot(normal, cross(c, a)) < 0.0
    if not (beyond_ab or beyond_bc or beyond_ca) and square > 0.0:
        side = dot(a, normal)
        return side * side / square
    return min(squared_distance_to_edge(a, b), squared_distance_to_edge(b, c), squared_distance_to_edge(c, a))


@inner_kernel
def squared_distance_to_edge(a, b):
    along = minus(b, a)
    ahead, length = -dot(a, along), dot(along, along)
    fraction = min(1.0, max(0.0, ahead / length)) if length > 0.0 else 0.0
    foot = plus_times(a, fraction, along)
    return dot(foot, foot)
