"""Winners of training points on tetrahedra.

The search follows Lowther and Mai, "On Automatic Mesh Generation using Kohonen Maps", section III, by a
walk from a former winner and a check that the sphere through the winner contains no other node.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.search import flood, nearest_visible, size_at_side, walk_in_region
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


@inner_kernel
def behind_surface(position, elements, surfaces, e, x):
    """Return True if x is between a curved face of e and its surface.

    The distance of x to the surface must be at most that of the centroid of the face.
    """
    for k in range(4):
        p = elements.patch[e, k]
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

    A point between a face and its curved surface belongs to the element of the face.
    """
    e, inside = walk_in_region(mesh, v, x, region)
    if inside or behind_surface(mesh.position, mesh.elements, mesh.constraints.surfaces, e, x):
        return e
    return flood(mesh.position, mesh.elements, e, x, scratch)


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
        x = point(points, t)
        v = start_nodes[t]
        if t % STRETCH > 0 and region[t - 1] == region[t]:
            other = winners[t - 1]
            if squared_distance(mesh.position, other, x) < squared_distance(mesh.position, v, x):
                v = other
        factor = cholesky(matrix(shape, t))
        winner, distance = find_winner(mesh, v, x, factor, region[t], scratch)
        winners[t], distances[t] = winner, distance
