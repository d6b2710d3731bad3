"""Linear maps after which triangles of the wanted shape are equilateral.

The map of a shape S is the upper triangular A with A'A = S, as (a, b, c) for [[a, b], [0, c]]. The map of a round shape
is the identity and changes no bit.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.geometry import signed_quality


@inner_kernel
def factor(xx, xy, yy):
    a = np.sqrt(xx)
    b = xy / a
    return a, b, np.sqrt(yy - b * b)


@inner_kernel
def factor_at(shape, v):
    return factor(shape[v, 0], shape[v, 1], shape[v, 2])


@inner_kernel
def factor_of_three(shape, i, j, k):
    return factor(
        (shape[i, 0] + shape[j, 0] + shape[k, 0]) / 3.0,
        (shape[i, 1] + shape[j, 1] + shape[k, 1]) / 3.0,
        (shape[i, 2] + shape[j, 2] + shape[k, 2]) / 3.0,
    )


@inner_kernel
def factor_of_four(shape, i, j, k, m):
    return factor(
        0.25 * (shape[i, 0] + shape[j, 0] + shape[k, 0] + shape[m, 0]),
        0.25 * (shape[i, 1] + shape[j, 1] + shape[k, 1] + shape[m, 1]),
        0.25 * (shape[i, 2] + shape[j, 2] + shape[k, 2] + shape[m, 2]),
    )


@inner_kernel
def mapped(map_, dx, dy):
    a, b, c = map_
    return a * dx + b * dy, c * dy


@inner_kernel
def mapped_back(map_, dx, dy):
    a, b, c = map_
    y = dy / c
    return (dx - b * y) / a, y


@inner_kernel
def squared_length(shape, i, j, dx, dy):
    """Return the squared length of a vector in the mean shape of two nodes."""
    xx, xy, yy = (
        0.5 * (shape[i, 0] + shape[j, 0]),
        0.5 * (shape[i, 1] + shape[j, 1]),
        0.5 * (shape[i, 2] + shape[j, 2]),
    )
    return xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy


@inner_kernel
def set_mean_shape(shape, p, i, j):
    xx, xy, yy = (
        0.5 * (shape[i, 0] + shape[j, 0]),
        0.5 * (shape[i, 1] + shape[j, 1]),
        0.5 * (shape[i, 2] + shape[j, 2]),
    )
    scale = 1.0 / np.sqrt(xx * yy - xy * xy)
    shape[p, 0], shape[p, 1], shape[p, 2] = scale * xx, scale * xy, scale * yy


@inner_kernel
def effective_quality(metric, i, j, k, ax, ay, bx, by, cx, cy):
    """Return the quality of a triangle that the quality rule compares.

    With a relief this is the quality in the mean metric of nodes `i`, `j` and `k`, or the Euclidean quality times the
    relief if that is lower.
    """
    euclidean = signed_quality(ax, ay, bx, by, cx, cy)
    if metric.relief == 1.0 or not euclidean > 0.0:
        return euclidean
    map_ = factor_of_three(metric.shape, i, j, k)
    ux, uy = mapped(map_, bx - ax, by - ay)
    vx, vy = mapped(map_, cx - ax, cy - ay)
    return min(metric.relief * euclidean, signed_quality(0.0, 0.0, ux, uy, vx, vy))


@inner_kernel
def effective_element_quality(position, metric, node, e):
    a, b, c = node[e, 0], node[e, 1], node[e, 2]
    return effective_quality(
        metric, a, b, c,
        position[a, 0], position[a, 1], position[b, 0], position[b, 1], position[c, 0], position[c, 1],
    )  # fmt: skip
