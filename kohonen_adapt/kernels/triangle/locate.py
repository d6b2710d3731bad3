"""Search for the elements that contain points, by walks and a grid."""

import numpy as np

from kohonen_adapt.kernels.grid import cell_index, clear_counts, enter, sum_up_counts
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.triangle.geometry import orientation

TOLERANCE = 1e-10  # relative to an element: points on an edge or on the boundary count as inside
WALK = 64  # maximum number of steps; walks from a grid cell take two or three


@inner_kernel
def side_of_edge(position, node, e, k, x, y):
    a, b = node[e, (k + 1) % 3], node[e, (k + 2) % 3]
    return orientation(position[a, 0], position[a, 1], position[b, 0], position[b, 1], x, y)


@inner_kernel
def least_barycentric(position, node, e, x, y):
    least, doubled = np.inf, 0.0
    for k in range(3):
        side = side_of_edge(position, node, e, k, x, y)
        least = min(least, side)
        doubled += side
    return least / doubled


@inner_kernel
def walk(position, elements, e, x, y):
    """Return the end of a walk to (x, y) within a region, and True on success."""
    node, region, e = elements.node, elements.region[e], np.int64(e)
    for _ in range(WALK):
        if least_barycentric(position, node, e, x, y) >= -TOLERANCE:
            return e, True
        onward, most = np.int64(-1), 0.0
        for k in range(3):
            side = side_of_edge(position, node, e, k, x, y)
            across = np.int64(elements.neighbour[e, k])
            if side < most and across >= 0 and elements.region[across] == region:
                onward, most = across, side
        if onward < 0:
            return e, False
        e = onward
    return e, False


@kernel
def walk_each(position, elements, points, found, inside):
    for t in range(points.shape[0]):
        found[t], inside[t] = walk(position, elements, found[t], points[t, 0], points[t, 1])


@kernel
def count_in_cells(position, node, grid):
    clear_counts(grid)
    start, shape = grid.start, grid.shape
    for e in range(node.shape[0]):
        i0, i1, j0, j1 = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                start[i * shape[1] + j] += 1
    sum_up_counts(grid)


@kernel
def fill_cells(position, node, grid):
    shape = grid.shape
    for e in range(node.shape[0] - 1, -1, -1):
        i0, i1, j0, j1 = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                enter(grid, i * shape[1] + j, e)


@inner_kernel
def cells_of_element(position, node, e, grid):
    a, b, c = node[e, 0], node[e, 1], node[e, 2]
    x0 = min(position[a, 0], position[b, 0], position[c, 0])
    x1 = max(position[a, 0], position[b, 0], position[c, 0])
    y0 = min(position[a, 1], position[b, 1], position[c, 1])
    y1 = max(position[a, 1], position[b, 1], position[c, 1])
    return cell_index(grid, x0, 0), cell_index(grid, x1, 0), cell_index(grid, y0, 1), cell_index(grid, y1, 1)


@inner_kernel
def best_in_cell(position, node, content, first, last, x, y):
    best, deepest = -1, -TOLERANCE
    for k in range(first, last):
        depth = least_barycentric(position, node, np.int64(content[k]), x, y)
        if depth >= deepest:
            best, deepest = content[k], depth
    return best


@kernel
def find(position, elements, points, grid, found):
    node, start, content = elements.node, grid.start, grid.content
    for t in range(points.shape[0]):
        x, y = points[t, 0], points[t, 1]
        found[t] = -1
        if not (np.isfinite(x) and np.isfinite(y)):
            continue
        c = cell_index(grid, x, 0) * grid.shape[1] + cell_index(grid, y, 1)
        if start[c] == start[c + 1]:
            continue
        e, inside = walk(position, elements, content[start[c]], x, y)
        found[t] = e if inside else best_in_cell(position, node, content, start[c], start[c + 1], x, y)


@kernel
def barycentric(position, node, points, found, out):
    for t in range(points.shape[0]):
        e = np.int64(found[t])
        total = 0.0
        for k in range(3):
            out[t, k] = np.nan if e < 0 else side_of_edge(position, node, e, k, points[t, 0], points[t, 1])
            total += out[t, k]
        for k in range(3):
            out[t, k] /= total
