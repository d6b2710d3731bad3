"""Moves of nodes under the quality rule, Euclidean or in a metric."""

from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.triangle import geometry
from kohonen_adapt.kernels.triangle.geometry import FLAT
from kohonen_adapt.kernels.triangle.metric import effective_quality
from kohonen_adapt.kernels.vectors import put, xy

tolerable_in_plane = geometry.star_tolerable


@inner_kernel
def star_tolerable(position, star, metric, v, x, floor):
    if metric.relief == 1.0 or floor == UNGUARDED:
        return tolerable_in_plane(position, star, v, x, floor)
    return worst_around(position, star, metric, v, x) > max(floor, FLAT)


@inner_kernel
def worst_around(position, star, metric, v, x):
    # of effective quality
    worst = 2.0
    for k in rows_of(star, v):
        a, b = star.ahead[k], star.behind[k]
        quality = effective_quality(metric, v, a, b, x, xy(position, a), xy(position, b))
        if not quality >= worst:
            worst = quality
    return worst


@inner_kernel
def may_move(position, star, metric, v, x, floor):
    if star_tolerable(position, star, metric, v, x, floor):
        return True
    before = xy(position, v)
    if star_tolerable(position, star, metric, v, before, floor):
        return False
    after = worst_around(position, star, metric, v, x)
    return after > FLAT and after >= worst_around(position, star, metric, v, before)


@kernel
def move_to_targets(position, star, metric, nodes, target, tolerance, floor):
    for i in range(nodes.shape[0]):
        v = nodes[i]
        x = xy(target, i)
        far = abs(x[0] - position[v, 0]) + abs(x[1] - position[v, 1]) > tolerance
        if far and may_move(position, star, metric, v, x, floor):
            put(position, v, x)
