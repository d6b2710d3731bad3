"""Tetrahedra at points, by walks and a grid, and winners of training points.

The search of a winner follows Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", section III, by a
walk from a former winner and a check that the sphere through the winner contains no other node.
"""

import numpy as np

from kohonen_adapt.kernels.grid import cell_index, cells_between, clear_counts, enter, sum_up_counts
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import element_in_region, next_stamp
from kohonen_adapt.kernels.tetrahedron.arrays import PLANE
from kohonen_adapt.kernels.tetrahedron.metric import cholesky, mapped
from kohonen_adapt.kernels.tetrahedron.surfaces import signed_distance
from kohonen_adapt.kernels.vectors import (
    ZERO,
    between,
    cross,
    divided,
    dot,
    from_to,
    matrix,
    minus,
    plus,
    plus_times,
    point,
    squared_distance,
)

TOLERANCE = 1e-10  # relative to the element size, so that points on faces are inside
WALK = 128  # maximum number of steps; walks from grid cells in uniform meshes take three or four

STRETCH = 64  # consecutive points that may start at the previous winner


@inner_kernel
def side_of_face(position, node, e, k, x):
    """Return six times the volume of x and face k of e, negative outside."""
    a, b, c = node[e, (k + 1) & 3], node[e, (k + 2) & 3], node[e, (k + 3) & 3]
    side = dot(minus(x, point(position, a)), cross(between(position, a, b), between(position, a, c)))
    return side if k & 1 else -side  # the orientation of the next three corners alternates


@inner_kernel
def depth_in_element(position, node, e, x):
    least, total = np.inf, 0.0
    for k in range(4):
        side = side_of_face(position, node, e, k, x)
        least = min(least, side)
        total += side
    return least / total


@inner_kernel
def walk(position, elements, e, x):
    node, region = elements.node, elements.region[e]
    e = np.int64(e)
    for _ in range(WALK):
        onward, most = np.int64(-1), 0.0
        least, total = np.inf, 0.0
        for k in range(4):
            side = side_of_face(position, node, e, k, x)
            least = min(least, side)
            total += side
            across = np.int64(elements.neighbour[e, k])
            if side < most and across >= 0 and elements.region[across] == region:
                onward, most = across, side
        if least / total >= -TOLERANCE:
            return e, True
        if onward < 0:
            return e, False
        e = onward
    return e, False


@kernel
def walk_each(position, elements, points, found, inside):
    for t in range(points.shape[0]):
        found[t], inside[t] = walk(position, elements, found[t], point(points, t))


@kernel
def count_in_cells(position, node, grid):
    clear_counts(grid)
    start, shape = grid.start, grid.shape
    for e in range(node.shape[0]):
        (i0, i1), (j0, j1), (k0, k1) = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                for k in range(k0, k1 + 1):
                    start[(i * shape[1] + j) * shape[2] + k] += 1
    sum_up_counts(grid)


@kernel
def fill_cells(position, node, grid):
    """List the elements of every grid cell.

    On entry `start` holds the ends of the lists, on return their starts.
    """
    shape = grid.shape
    for e in range(node.shape[0] - 1, -1, -1):
        (i0, i1), (j0, j1), (k0, k1) = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                for k in range(k0, k1 + 1):
                    enter(grid, (i * shape[1] + j) * shape[2] + k, e)


@inner_kernel
def cells_of_element(position, node, e, grid):
    if node[e, 0] < 0:
        return (0, -1), (0, -1), (0, -1)
    return (
        cells_between(position, node, e, 0, grid),
        cells_between(position, node, e, 1, grid),
        cells_between(position, node, e, 2, grid),
    )


@inner_kernel
def best_in_cell(position, node, content, first, last, x):
    best, deepest = -1, -TOLERANCE
    for k in range(first, last):
        depth = depth_in_element(position, node, np.int64(content[k]), x)
        if depth >= deepest:
            best, deepest = content[k], depth
    return best


@kernel
def find(position, elements, points, grid, found):
    """Find the element of each point, -1 outside the mesh.

    The walk starts at an element of the grid cell. If the walk fails, all elements of the cell are tested.
    """
    node, start, content = elements.node, grid.start, grid.content
    for t in range(points.shape[0]):
        x = point(points, t)
        found[t] = -1
        if not (np.isfinite(x[0]) and np.isfinite(x[1]) and np.isfinite(x[2])):
            continue
        i, j, k = cell_index(grid, x[0], 0), cell_index(grid, x[1], 1), cell_index(grid, x[2], 2)
        c = (i * grid.shape[1] + j) * grid.shape[2] + k
        if start[c] == start[c + 1]:
            continue
        e, inside = walk(position, elements, content[start[c]], x)
        found[t] = e if inside else best_in_cell(position, node, content, start[c], start[c + 1], x)


@kernel
def barycentric(position, node, points, found, out):
    for t in range(points.shape[0]):
        e = np.int64(found[t])
        total = 0.0
        for k in range(4):
            out[t, k] = np.nan if e < 0 else side_of_face(position, node, e, k, point(points, t))
            total += out[t, k]
        for k in range(4):
            out[t, k] /= total


@inner_kernel
def descend_to(position, elements, star, v, x, region):
    best = squared_distance(position, v, x)
    while True:
        nearest = v
        for k in range(star.start[v], star.start[v + 1]):
            if elements.region[star.element[k]] != region:
                continue
            for j in range(3):
                other = np.int64(star.link[k, j])
                distance = squared_distance(position, other, x)
                if distance < best:
                    best, nearest = distance, other
        if nearest == v:
            return v
        v = nearest


@inner_kernel
def behind_surface(position, elements, surfaces, e, x):
    """Return True if x is between a curved face of e and its surface.

    The distance of x to the surface must be at most that of the centroid of the face.
    """
    for k in range(4):
        p = np.int64(elements.patch[e, k])
        if p < 0 or surfaces.shape[p] == PLANE:
            continue
        if side_of_face(position, elements.node, e, k, x) >= 0.0:
            continue
        centroid = ZERO
        for i in range(4):
            if i != k:
                centroid = plus(centroid, divided(point(position, elements.node[e, i]), 3.0))
        if abs(signed_distance(surfaces, p, x)[0]) <= abs(signed_distance(surfaces, p, centroid)[0]):
            return True
    return False


@inner_kernel
def find_element(mesh, v, x, region, scratch):
    """Return the element of a region that contains x.

    A walk starts at v, if blocked a second walk at a node nearer to x, and if blocked a flood of the region. A
    point between a face and its curved surface belongs to the element of the face.
    """
    position, elements, star = mesh.position, mesh.elements, mesh.star
    e, inside = walk(position, elements, element_in_region(elements, star, v, region), x)
    if inside:
        return e
    nearer_node = descend_to(position, elements, star, v, x, region)
    e, inside = walk(position, elements, element_in_region(elements, star, nearer_node, region), x)
    if inside or behind_surface(position, elements, mesh.constraints.surfaces, e, x):
        return e
    stamp, queue = next_stamp(scratch), scratch.queue
    queue[0], scratch.element_stamp[e] = e, stamp
    first, last = 0, 1
    best, deepest = e, -np.inf
    while first < last and deepest < -TOLERANCE:
        e = np.int64(queue[first])
        first += 1
        depth = depth_in_element(position, elements.node, e, x)
        if depth > deepest:
            best, deepest = e, depth
        for k in range(4):
            across = elements.neighbour[e, k]
            if across >= 0 and elements.region[across] == region and scratch.element_stamp[across] != stamp:
                scratch.element_stamp[across] = stamp
                queue[last] = across
                last += 1
    return best


@inner_kernel
def nearest_reached(position, elements, factor, e, x, scratch):
    """Return the nearest node visible from x in its region, and the squared distance.

    Distances are measured after the linear map `factor`. Ties are resolved by the lowest index. A node is visible if
    the ball around x with the node on its boundary connects both within the region. Each element has a reach, the
    smallest radius of a ball that connects x to the element (the largest distance to a crossed face). Elements are
    visited by increasing reach, and nodes nearer than the reach are skipped, because a slit or an edge is in between.
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
        for k in range(4):
            v = np.int64(elements.node[e, k])
            offset = mapped(factor, from_to(x, position, v))
            distance = dot(offset, offset)
            if distance >= entered and (distance < best or (distance == best and v < winner)):
                winner, best = v, distance
        for k in range(4):
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
            distance = max(entered, squared_distance_to_face(position, elements.node, factor, e, k, x))
            if known:
                reach[waiting] = min(reach[waiting], distance)
            elif distance <= best:
                scratch.element_stamp[across] = stamp
                frontier[count], reach[count] = across, distance
                count += 1
    return winner, best


@inner_kernel
def squared_distance_to_face(position, node, factor, e, k, x):
    a = mapped(factor, from_to(x, position, node[e, (k + 1) % 4]))
    b = mapped(factor, from_to(x, position, node[e, (k + 2) % 4]))
    c = mapped(factor, from_to(x, position, node[e, (k + 3) % 4]))
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


@inner_kernel
def find_winner(mesh, v, x, factor, region, scratch):
    e = find_element(mesh, v, x, region, scratch)
    winner, squared = nearest_reached(mesh.position, mesh.elements, factor, e, x, scratch)
    return winner, np.sqrt(squared)


@kernel
def find_winners(mesh, points, shape, region, start_nodes, winners, distances, scratch):
    """Find the winner of every point, and its distance.

    Distances are measured in the `shape` of the point, shape (t, 6).
    `start_nodes` holds a start node in the region of each point, best a former winner. The winner of the previous point
    is a second start, except at every STRETCH-th point, so that points can be distributed in stretches with the
    same result.
    """
    for t in range(points.shape[0]):
        x, v = point(points, t), np.int64(start_nodes[t])
        if t % STRETCH > 0 and region[t - 1] == region[t]:
            other = np.int64(winners[t - 1])
            if squared_distance(mesh.position, other, x) < squared_distance(mesh.position, v, x):
                v = other
        factor = cholesky(matrix(shape, t))
        winner, distance = find_winner(mesh, v, x, factor, region[t], scratch)
        winners[t], distances[t] = winner, distance
