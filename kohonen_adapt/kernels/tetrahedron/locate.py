"""Tetrahedra at points, by walks and a grid, and winners of training points.

The search of a winner follows Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", section III, by a
walk from a former winner and a check that the sphere through the winner contains no other node.
"""

import numpy as np

from kohonen_adapt.kernels.grid import cell_index, cells_between, clear_counts, enter, sum_up_counts
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import (
    element_in_region,
    find_in_cell,
    flood,
    nearest_visible,
    size_at_side,
    walk,
)
from kohonen_adapt.kernels.tetrahedron.arrays import PLANE
from kohonen_adapt.kernels.tetrahedron.metric import cholesky
from kohonen_adapt.kernels.tetrahedron.surfaces import signed_distance
from kohonen_adapt.kernels.vectors import (
    ZERO,
    divided,
    matrix,
    plus,
    point,
    squared_distance,
)

STRETCH = 64  # consecutive points that may start at the previous winner


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


@kernel
def find(position, elements, points, grid, found):
    """Find the element of each point, -1 outside the mesh."""
    for t in range(points.shape[0]):
        x = point(points, t)
        found[t] = -1
        if np.isfinite(x[0]) and np.isfinite(x[1]) and np.isfinite(x[2]):
            i, j, k = cell_index(grid, x[0], 0), cell_index(grid, x[1], 1), cell_index(grid, x[2], 2)
            found[t] = find_in_cell(position, elements, grid, (i * grid.shape[1] + j) * grid.shape[2] + k, x)


@kernel
def barycentric(position, node, points, found, out):
    for t in range(points.shape[0]):
        e = np.int64(found[t])
        total = 0.0
        for k in range(4):
            out[t, k] = np.nan if e < 0 else size_at_side(position, node, e, k, point(points, t))
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
        if size_at_side(position, elements.node, e, k, x) >= 0.0:
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
    return flood(position, elements, e, x, scratch)


@inner_kernel
def find_winner(mesh, v, x, factor, region, scratch):
    e = find_element(mesh, v, x, region, scratch)
    winner, squared = nearest_visible(mesh.position, mesh.elements, e, x, factor, scratch)
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
