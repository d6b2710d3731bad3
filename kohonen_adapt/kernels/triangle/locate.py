"""Walk from element to element to the one that holds a point; where that is blocked a grid is asked."""

import numpy as np

from kohonen_adapt.kernels.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.grid import cell_index, clear_counts, enter, sum_up_counts
from kohonen_adapt.kernels.triangle.geometry import orientation

TOLERANCE = 1e-10  # of an element's size: points on an edge or on the outline count as inside
WALK = 64  # steps before the grid is asked; walks from the grid's hints take two or three


@inner_kernel
def side_of_edge(position, node, e, k, x, y):
    """Twice the signed area that (x, y) spans with the edge opposite to corner k of e; negative beyond it."""
    a, b = node[e, (k + 1) % 3], node[e, (k + 2) % 3]
    return orientation(position[a, 0], position[a, 1], position[b, 0], position[b, 1], x, y)


@inner_kernel
def depth_in_element(position, node, e, x, y):
    """Smallest barycentric coordinate of (x, y) in element e: negative outside."""
    least, doubled = np.inf, 0.0
    for k in range(3):
        side = side_of_edge(position, node, e, k, x, y)
        least = min(least, side)
        doubled += side
    return least / doubled


@inner_kernel
def walk(position, elements, e, x, y):
    """Walk from element e towards (x, y) within e's region; returns (element, whether that element holds the point)."""
    node, region, e = elements.node, elements.region[e], np.int64(e)
    for _ in range(WALK):
        if depth_in_element(position, node, e, x, y) >= -TOLERANCE:
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
    """Walk to every point from the element that `found` holds, which becomes where the walk ended."""
    for t in range(points.shape[0]):
        found[t], inside[t] = walk(position, elements, found[t], points[t, 0], points[t, 1])


@kernel
def count_in_cells(position, node, grid):
    """Count the elements whose bounding box meets each cell of a grid, summed up to where lists end."""
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
    """List the elements of every cell; `start` says where the lists end, and then where they start."""
    shape = grid.shape
    for e in range(node.shape[0] - 1, -1, -1):
        i0, i1, j0, j1 = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                enter(grid, i * shape[1] + j, e)


@inner_kernel
def cells_of_element(position, node, e, grid):
    """Range of cells that the bounding box of element e meets."""
    a, b, c = node[e, 0], node[e, 1], node[e, 2]
    x0 = min(position[a, 0], position[b, 0], position[c, 0])
    x1 = max(position[a, 0], position[b, 0], position[c, 0])
    y0 = min(position[a, 1], position[b, 1], position[c, 1])
    y1 = max(position[a, 1], position[b, 1], position[c, 1])
    return cell_index(grid, x0, 0), cell_index(grid, x1, 0), cell_index(grid, y0, 1), cell_index(grid, y1, 1)


@inner_kernel
def best_in_cell(position, node, content, first, last, x, y):
    """The element of a cell that holds (x, y) deepest, or -1 if none does."""
    best, deepest = -1, -TOLERANCE
    for k in range(first, last):
        depth = depth_in_element(position, node, np.int64(content[k]), x, y)
        if depth >= deepest:
            best, deepest = content[k], depth
    return best


@kernel
def find(position, elements, points, grid, found):
    """Find the element that holds each point, or -1: walk from any element of its cell, else look at all of them."""
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
    """Compute barycentric coordinates of every point in the element found for it; nan where there is none."""
    for t in range(points.shape[0]):
        e = np.int64(found[t])
        total = 0.0
        for k in range(3):
            out[t, k] = np.nan if e < 0 else side_of_edge(position, node, e, k, points[t, 0], points[t, 1])
            total += out[t, k]
        for k in range(3):
            out[t, k] /= total
