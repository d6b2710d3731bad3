"""Lengths and quality of tetrahedra in a metric, by the mean shape M of corners.

Quality does not change under a linear map of all elements. The map to the metric, U with M = U'U, has the determinant
sqrt(det M), and the squared length of an edge e after the map is e'Me.
"""

import math

from kohonen_adapt.kernels.numba.compilation import inner_kernel
from kohonen_adapt.kernels.tetrahedron.geometry import corners_of, cubed_quality, sum_of_squares
from kohonen_adapt.kernels.vectors import (
    between,
    cross,
    determinant,
    dot,
    from_to,
    matrix,
    plus,
    point,
    product,
    squared_distance,
    times,
)

ROUND = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
UNBOUNDED = -math.inf  # floor of Euclidean quality


@inner_kernel
def is_round(metric):
    return metric.shape.shape[0] == 0


@inner_kernel
def mean_of_two(shape, a, b):
    return times(0.5, plus(matrix(shape, a), matrix(shape, b)))


@inner_kernel
def mean_of_four(shape, a, b, c, d):
    return times(0.25, plus(plus(plus(matrix(shape, a), matrix(shape, b)), matrix(shape, c)), matrix(shape, d)))


@inner_kernel
def set_mean_shape(metric, p, a, b):
    """Write the mean shape of a and b with determinant 1 at node p."""
    if is_round(metric):
        return
    mean = mean_of_two(metric.shape, a, b)
    scale = determinant(mean) ** (-1.0 / 3.0)
    for k in range(6):
        metric.shape[p, k] = scale * mean[k]


@inner_kernel
def squared_length(position, metric, a, b):
    if is_round(metric):
        return squared_distance(position, a, point(position, b))
    edge = between(position, a, b)
    return dot(edge, product(mean_of_two(metric.shape, a, b), edge))


@inner_kernel
def cholesky(shape):
    """Return the upper triangle of U with U'U = M, in the order of a shape."""
    xx, xy, xz, yy, yz, zz = shape
    a = math.sqrt(xx)
    b, c = xy / a, xz / a
    d = math.sqrt(yy - b * b)
    e = (yz - b * c) / d
    return a, b, c, d, e, math.sqrt(zz - c * c - e * e)


@inner_kernel
def squares_in_metric(shape, u, v, w):
    # sum of the squared lengths of the six edges, of which u, v, w begin at the same corner
    total = plus(plus(u, v), w)
    own = dot(u, product(shape, u)) + dot(v, product(shape, v)) + dot(w, product(shape, w))
    return 4.0 * own - dot(total, product(shape, total))


@inner_kernel
def both_qualities_at(position, shape, x, v, a, b, c):
    """Return the cubed quality, Euclidean and in the metric, with node v at x."""
    p, q, r = from_to(x, position, a), from_to(x, position, b), from_to(x, position, c)
    mean, volume = mean_of_four(shape, v, a, b, c), dot(p, cross(q, r))
    squares, in_metric = sum_of_squares(p, q, r), squares_in_metric(mean, p, q, r)
    signed = 432.0 * volume * abs(volume)
    return (
        signed / (squares * squares * squares),
        determinant(mean) * signed / (in_metric * in_metric * in_metric),
    )


@inner_kernel
def both_qualities(position, shape, a, b, c, d):
    return both_qualities_at(position, shape, point(position, a), a, b, c, d)


@inner_kernel
def both_of_element(position, shape, node, e):
    return both_qualities(position, shape, *corners_of(node, e))


@inner_kernel
def relieved(metric, euclidean, in_metric):
    return min(in_metric, metric.relief * metric.relief * metric.relief * euclidean)


@inner_kernel
def effective_quality(position, metric, node, e):
    """Return the cubed quality for comparison with the floor, see `Metric`."""
    if metric.relief == 1.0:
        return cubed_quality(position, *corners_of(node, e))
    euclidean, in_metric = both_of_element(position, metric.shape, node, e)
    return relieved(metric, euclidean, in_metric)


@inner_kernel
def quality_above(position, metric, node, e, floor):
    # cubed quality in the metric, UNBOUNDED if Euclidean quality is below `floor`
    if is_round(metric):
        quality = cubed_quality(position, *corners_of(node, e))
        return quality if quality >= floor else UNBOUNDED
    euclidean, in_metric = both_of_element(position, metric.shape, node, e)
    return in_metric if euclidean >= floor else UNBOUNDED


@inner_kernel
def quality_on_both_sides(position, metric, p, q, r, a, b, floor):
    # as `quality_above`, the lower of the elements (p, q, r, b) and (p, r, q, a)
    above, above_in_metric = both_qualities(position, metric.shape, p, q, r, b)
    below, below_in_metric = both_qualities(position, metric.shape, p, r, q, a)
    return min(above_in_metric, below_in_metric) if above >= floor and below >= floor else UNBOUNDED
