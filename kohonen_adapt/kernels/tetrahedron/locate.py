"""Point location in tetrahedra by walks, with a grid as fallback."""

import numpy as np

from kohonen_adapt.kernels.grid import cell_index, clear_counts, enter, sum_up_counts
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel

TOLERANCE = 1e-10  # relative to the element size, so that points on faces are inside
WALK = 128  # maximum number of steps; walks from grid cells in uniform meshes take three or four


@inner_kernel
def side_of_face(position, node, e, k, x, y, z):
    """Return six times the volume of (x, y, z) and face k of e, negative outside."""
    a, b, c = node[e, (k + 1) & 3], node[e, (k + 2) & 3], node[e, (k + 3) & 3]
    ux, uy, uz = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1], position[b, 2] - position[a, 2]
    vx, vy, vz = position[c, 0] - position[a, 0], position[c, 1] - position[a, 1], position[c, 2] - position[a, 2]
    x, y, z = x - position[a, 0], y - position[a, 1], z - position[a, 2]
    side = x * (uy * vz - uz * vy) + y * (uz * vx - ux * vz) + z * (ux * vy - uy * vx)
    return side if k & 1 else -side  # the orientation of the next three corners alternates


@inner_kernel
def depth_in_element(position, node, e, x, y, z):
    least, total = np.inf, 0.0
    for k in range(4):
        side = side_of_face(position, node, e, k, x, y, z)
        least = min(least, side)
        total += side
    return least / total


@inner_kernel
def walk(position, elements, e, x, y, z):
    node, region, e = elements.node, elements.region[e], np.int64(e)
    for _ in range(WALK):
        onward, most, least, total = np.int64(-1), 0.0, np.inf, 0.0
        for k in range(4):
            side = side_of_face(position, node, e, k, x, y, z)
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
        found[t], inside[t] = walk(position, elements, found[t], points[t, 0], points[t, 1], points[t, 2])


@kernel
def count_in_cells(position, node, grid):
    clear_counts(grid)
    start, shape = grid.start, grid.shape
    for e in range(node.shape[0]):
        i0, i1, j0, j1, k0, k1 = cells_of_element(position, node, e, grid)
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
        i0, i1, j0, j1, k0, k1 = cells_of_element(position, node, e, grid)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                for k in range(k0, k1 + 1):
                    enter(grid, (i * shape[1] + j) * shape[2] + k, e)


@inner_kernel
def cells_between(position, node, e, axis, grid):
    low = high = position[node[e, 0], axis]
    for k in range(1, 4):
        low, high = min(low, position[node[e, k], axis]), max(high, position[node[e, k], axis])
    return cell_index(grid, low, axis), cell_index(grid, high, axis)


@inner_kernel
def cells_of_element(position, node, e, grid):
    if node[e, 0] < 0:
        return 0, -1, 0, -1, 0, -1
    i0, i1 = cells_between(position, node, e, 0, grid)
    j0, j1 = cells_between(position, node, e, 1, grid)
    k0, k1 = cells_between(position, node, e, 2, grid)
    return i0, i1, j0, j1, k0, k1


@inner_kernel
def best_in_cell(position, node, content, first, last, x, y, z):
    best, deepest = -1, -TOLERANCE
    for k in range(first, last):
        depth = depth_in_element(position, node, np.int64(content[k]), x, y, z)
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
        x, y, z = points[t, 0], points[t, 1], points[t, 2]
        found[t] = -1
        if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)):
            continue
        i, j, k = cell_index(grid, x, 0), cell_index(grid, y, 1), cell_index(grid, z, 2)
        c = (i * grid.shape[1] + j) * grid.shape[2] + k
        if start[c] == start[c + 1]:
            continue
        e, inside = walk(position, elements, content[start[c]], x, y, z)
        found[t] = e if inside else best_in_cell(position, node, content, start[c], start[c + 1], x, y, z)


@kernel
def barycentric(position, node, points, found, out):
    for t in range(points.shape[0]):
        e = np.int64(found[t])
        total = 0.0
        for k in range(4):
            x, y, z = points[t, 0], points[t, 1], points[t, 2]
            out[t, k] = np.nan if e < 0 else side_of_face(position, node, e, k, x, y, z)
            total += out[t, k]
        for k in range(4):
            out[t, k] /= total
