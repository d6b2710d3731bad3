"""Moves of nodes under the quality rule, Euclidean or in a metric."""

from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.stars import rows_of
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, others, star_quality, sum_of_squares
from kohonen_adapt.kernels.tetrahedron.metric import both_qualities_at, relieved
from kohonen_adapt.kernels.vectors import cross, dot, from_to, point


@inner_kernel
def star_tolerable(position, star, metric, v, x, floor):
    """Return True if no element of the star is below `floor` with v at x.

    UNGUARDED disables the check.
    """
    if metric.relief == 1.0 or floor == UNGUARDED:
        return tolerable_in_space(position, star, v, x, floor)
    bound = max(floor * floor * floor, FLAT)
    return effective_around(position, star, metric, v, x, bound) > bound


@inner_kernel
def tolerable_in_space(position, star, v, x, floor):
    # As by `star_quality`, without a division.
    if floor == UNGUARDED:
        return True
    bound = max(floor * floor * floor, FLAT) / 432.0
    for k in rows_of(star, v):
        a, b, c = others(star, k)
        p, q, r = from_to(x, position, a), from_to(x, position, b), from_to(x, position, c)
        volume, squares = dot(p, cross(q, r)), sum_of_squares(p, q, r)
        if not (volume > 0.0 and volume * volume > bound * squares * squares * squares):
            return False
    return True


@inner_kernel
def effective_around(position, star, metric, v, x, least):
    # As `star_quality`, of effective quality.
    if metric.relief == 1.0:
        return star_quality(position, star, v, x, least)
    worst = 2.0
    for k in rows_of(star, v):
        euclidean, in_metric = both_qualities_at(position, metric.shape, x, v, *others(star, k))
        quality = relieved(metric, euclidean, in_metric)
        if not quality >= worst:
            worst = quality
            if not worst >= least:
                return worst
    return worst


@inner_kernel
def may_move(position, star, metric, v, x, floor):
    if star_tolerable(position, star, metric, v, x, floor):
        return True
    old = point(position, v)
    if star_tolerable(position, star, metric, v, old, floor):
        return False
    before = effective_around(position, star, metric, v, old, -2.0)
    after = effective_around(position, star, metric, v, x, before)
    return after > FLAT and after >= before


@kernel
def mark_valid(position, star, floor, first, last, is_valid):
    """Mark nodes `first` to `last` whose stars are tolerable.

    If all stars are tolerable, guarded moves keep them tolerable. Otherwise a neighbour may worsen a marked star
    as far as its own rule allows, and the guard is stricter than the rule up to the next marking.
    """
    for v in range(first, last):
        is_valid[v] = tolerable_in_space(position, star, v, point(position, v), floor)
