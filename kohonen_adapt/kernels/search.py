"""Walks and searches for elements and nodes, on triangles and on tetrahedra.

numba compiles them for the number of components of the point. Loops over points take it from `origin`, which is (0, 0)
or (0, 0, 0).
"""

import numpy as np

from kohonen_adapt.kernels.grid import cell_index, cells_between, enter
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.vectors import (
    between,
    cross,
    dot,
    from_to,
    mapped,
    minus,
    plus_times,
    point,
    squared_distance,
    xy,
)

TOLERANCE = 1e-10  # relative to the element size, so that points on edges and faces are inside
FAR = 1e3  # widths of the mesh, beyond which a point is outside
WALK = 128  # maximum number of steps; walks from grid cells in uniform meshes take two to four


@kernel
def walk_each(position, elements, points, origin, found, inside):
    for t in range(points.shape[0]):
        found[t], inside[t] = walk(position, elements, found[t], from_to(origin, points, t))


@kernel
def list_in_cells(position, node, grid, counts):
    """List the elements of every grid cell, after a first call that counts them.

    The first call leaves the ends of the lists in `start`, the second their starts.
    """
    for e in range(node.shape[0] - 1, -1, -1):
        (i0, i1), (j0, j1), (k0, k1) = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                for k in range(k0, k1 + 1):
                    if counts:
                        grid.start[cell_at(grid, i, j, k)] += 1
                    else:
                        enter(grid, cell_at(grid, i, j, k), e)
    for c in range(grid.start.shape[0] - 1 if counts else 0):
        grid.start[c + 1] += grid.start[c]


@inner_kernel
def cells_of_element(position, node, e, grid):
    if node[e, 0] < 0:
        return (0, -1), (0, -1), (0, -1)
    across = cells_between(position, node, e, 2, grid) if position.shape[1] == 3 else (0, 0)
    return cells_between(position, node, e, 0, grid), cells_between(position, node, e, 1, grid), across


@inner_kernel
def cell_at(grid, i, j, k):
    c = i * grid.shape[1] + j
    return c * grid.shape[2] + k if grid.shape.shape[0] == 3 else c


@inner_kernel
def cell_of(grid, x):
    i, j = cell_index(grid, x[0], 0), cell_index(grid, x[1], 1)
    return cell_at(grid, i, j, 0 if len(x) == 2 else cell_index(grid, x[2], 2))


@kernel
def find(position, elements, points, origin, grid, found):
    """Find the element of each point, -1 outside the mesh."""
    for t in range(points.shape[0]):
        x = from_to(origin, points, t)
        found[t] = find_in_cell(position, elements, grid, cell_of(grid, x), x) if is_near(grid, x) else -1


@inner_kernel
def is_near(grid, x):
    """Return False for points so far away that products would overflow, and for nan."""
    for i in range(len(x)):
        if not abs(x[i] - grid.origin[i]) <= FAR * grid.size[i] * grid.shape[i]:
            return False
    return True


@kernel
def barycentric(position, node, points, origin, found, out):
    corners = len(origin) + 1
    for t in range(points.shape[0]):
        e = found[t]
        total = 0.0
        for k in range(corners):
            out[t, k] = np.nan if e < 0 else size_at_side(position, node, e, k, from_to(origin, points, t))
            total += out[t, k]
        for k in range(corners):
            out[t, k] /= total


@inner_kernel
def next_stamp(scratch):
    scratch.counter[0] += 1
    return scratch.counter[0]


@inner_kernel
def element_in_region(elements, star, v, region):
    for k in rows_of(star, v):
        if elements.region[star.element[k]] == region:
            return star.element[k]
    return star.element[star.start[v]]


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
    """Return the least barycentric coordinate of x, -inf in a flat element."""
    least, total = np.inf, 0.0
    for k in range(len(x) + 1):
        size = size_at_side(position, node, e, k, x)
        least = min(least, size)
        total += size
    return least / total if total != 0.0 else -np.inf


@inner_kernel
def walk(position, elements, e, x):
    node = elements.node
    region = elements.region[e]
    for _ in range(WALK):
        onward, most = -1, 0.0
        least, total = np.inf, 0.0
        for k in range(len(x) + 1):
            size = size_at_side(position, node, e, k, x)
            least = min(least, size)
            total += size
            if size < most:
                across = elements.neighbour[e, k]
                if across >= 0 and elements.region[across] == region:
                    onward, most = across, size
        if total != 0.0 and least / total >= -TOLERANCE:
            return e, True
        if onward < 0:
            return e, False
        e = onward
    return e, False


@inner_kernel
def neighbours(star, row, x):
    """Return the other nodes of the element in a row of the star."""
    if len(x) == 2:
        return star.ahead[row], star.behind[row]
    return star.link[row, 0], star.link[row, 1], star.link[row, 2]


@inner_kernel
def descend_to(position, elements, star, v, x, region):
    """Return the node from which no neighbour in the region is nearer to x."""
    best = squared_distance(position, v, x)
    while True:
        nearest = v
        for row in rows_of(star, v):
            if elements.region[star.element[row]] != region:
                continue
            for other in neighbours(star, row, x):
                distance = squared_distance(position, other, x)
                if distance < best:
                    best, nearest = distance, other
        if nearest == v:
            return v
        v = nearest


@inner_kernel
def walk_in_region(mesh, v, x, region):
    """Return an element of a region near x, and True if x is in the element.

    A walk starts at v, if blocked a second walk at a node nearer to x.
    """
    position, elements, star = mesh.position, mesh.elements, mesh.star
    e, inside = walk(position, elements, element_in_region(elements, star, v, region), x)
    if inside:
        return e, inside
    nearest = descend_to(position, elements, star, v, x, region)
    return walk(position, elements, element_in_region(elements, star, nearest, region), x)


@inner_kernel
def find_in_cell(position, elements, grid, c, x):
    """Return the element of grid cell c that contains x, -1 if none.

    The walk starts at an element of the cell. If the walk fails, all elements of the cell are tested.
    """
    start, content = grid.start, grid.content
    if start[c] == start[c + 1]:
        return -1
    e, inside = walk(position, elements, content[start[c]], x)
    if inside:
        return e
    best = -1
    deepest = -TOLERANCE
    for k in range(start[c], start[c + 1]):
        depth = depth_in_element(position, elements.node, content[k], x)
        if depth >= deepest:
            best = content[k]
            deepest = depth
    return best


@inner_kernel
def flood(position, elements, e, x, scratch):
    """Return an element around x in the region of e, or the element nearest to x."""
    stamp = next_stamp(scratch)
    queue = scratch.queue
    region = elements.region[e]
    queue[0], scratch.element_stamp[e] = e, stamp
    first, last = 0, 1
    best = e
    deepest = -np.inf
    while first < last and deepest < -TOLERANCE:
        e = queue[first]
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
    count, winner = 1, -1
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
            v = elements.node[e, k]
            offset = mapped(factor, from_to(x, position, v))
            distance = dot(offset, offset)
            if distance >= entered and (distance < best or (distance == best and v < winner)):
                winner, best = v, distance
        for k in range(len(x) + 1):
            across = elements.neighbour[e, k]
            if across < 0 or elements.region[across] != region:
                continue
            waiting = count
            known = scratch.element_stamp[across] == stamp
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
    ahead = -dot(a, along)
    length = dot(along, along)
    fraction = min(1.0, max(0.0, ahead / length)) if length > 0.0 else 0.0
    foot = plus_times(a, fraction, along)
    return dot(foot, foot)
