"""Linear maps after which triangles of the wanted shape are equilateral.

The map of a shape S is the upper triangular A with A'A = S, as (a, b, c) for [[a, b], [0, c]]. The map of a round shape
is the identity and changes no bit.
"""

import numpy as np

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.triangle.geometry import signed_quality
from kohonen_adapt.kernels.vectors import divided, mapped, midpoint, minus, plus, point, put, times, xy


@inner_kernel
def factor(shape):
    xx, xy, yy = shape
    a = np.sqrt(xx)
    b = xy / a
    return a, b, np.sqrt(yy - b * b)


@inner_kernel
def factor_at(shape, v):
    return factor(point(shape, v))


@inner_kernel
def factor_of_three(shape, i, j, k):
    return factor(divided(plus(plus(point(shape, i), point(shape, j)), point(shape, k)), 3.0))


@inner_kernel
def factor_of_four(shape, i, j, k, m):
    total = plus(plus(point(shape, i), point(shape, j)), point(shape, k))
    return factor(times(0.25, plus(total, point(shape, m))))


@inner_kernel
def mapped_back(map_, x):
    a, b, c = map_
    y = x[1] / c
    return (x[0] - b * y) / a, y


@inner_kernel
def squared_length(shape, i, j, edge):
    """Return the squared length of a vector in the mean shape of two nodes."""
    (xx, xy, yy), (x, y) = midpoint(shape, i, j), edge
    return xx * x * x + 2.0 * xy * x * y + yy * y * y


@inner_kernel
def set_mean_shape(shape, p, i, j):
    mean = midpoint(shape, i, j)
    xx, xy, yy = mean
    put(shape, p, times(1.0 / np.sqrt(xx * yy - xy * xy), mean))


@inner_kernel
def effective_quality(metric, i, j, k, a, b, c):
    """Return the quality of a triangle that the quality rule compares.

    With a relief this is the quality in the mean metric of nodes `i`, `j` and `k`, or the Euclidean quality times the
    relief if that is lower.
    """
    euclidean = signed_quality(a, b, c)
    if metric.relief == 1.0 or not euclidean > 0.0:
        return euclidean
    map_ = factor_of_three(metric.shape, i, j, k)
    in_metric = signed_quality((0.0, 0.0), mapped(map_, minus(b, a)), mapped(map_, minus(c, a)))
    return min(metric.relief * euclidean, in_metric)


@inner_kernel
def effective_element_quality(position, metric, node, e):
    a, b, c = node[e, 0], node[e, 1], node[e, 2]
    return effective_quality(metric, a, b, c, xy(position, a), xy(position, b), xy(position, c))
