"""Moves of nodes under the quality rule, Euclidean or in a metric."""

from kohonen_adapt.kernels.arrays import UNGUARDED
from kohonen_adapt.kernels.numba.compilation import inner_kernel, kernel
from kohonen_adapt.kernels.tetrahedron.geometry import FLAT, star_quality
from kohonen_adapt.kernels.tetrahedron.metric import both_qualities_at, relieved


@inner_kernel
def star_tolerable(position, star, metric, v, x, y, z, floor):
    """Return True if no element of the star is below `floor` with v at (x, y, z).

    UNGUARDED disables the check.
    """
    if metric.relief == 1.0 or floor == UNGUARDED:
        return tolerable_in_space(position, star, v, x, y, z, floor)
    bound = max(floor * floor * floor, FLAT)
    return effective_around(position, star, metric, v, x, y, z, bound) > bound


@inner_kernel
def tolerable_in_space(position, star, v, x, y, z, floor):
    # As by `star_quality`, without a division.
    if floor == UNGUARDED:
        return True
    bound = max(floor * floor * floor, FLAT) / 432.0
    for k in range(star.start[v], star.start[v + 1]):
        a, b, c = star.link[k, 0], star.link[k, 1], star.link[k, 2]
        ax, ay, az = position[a, 0] - x, position[a, 1] - y, position[a, 2] - z
        bx, by, bz = position[b, 0] - x, position[b, 1] - y, position[b, 2] - z
        cx, cy, cz = position[c, 0] - x, position[c, 1] - y, position[c, 2] - z
        volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        lengths = ax * ax + ay * ay + az * az + bx * bx + by * by + bz * bz + cx * cx + cy * cy + cz * cz
        mixed = ax * bx + ay * by + az * bz + bx * cx + by * cy + bz * cz + cx * ax + cy * ay + cz * az
        squares = 3.0 * lengths - 2.0 * mixed
        if not (volume > 0.0 and volume * volume > bound * squares * squares * squares):
            return False
    return True


@inner_kernel
def effective_around(position, star, metric, v, x, y, z, least):
    # As `star_quality`, of effective quality.
    if metric.relief == 1.0:
        return star_quality(position, star, v, x, y, z, least)
    worst = 2.0
    for k in range(star.start[v], star.start[v + 1]):
        a, b, c = star.link[k, 0], star.link[k, 1], star.link[k, 2]
        euclidean, in_metric = both_qualities_at(position, metric.shape, (x, y, z), v, a, b, c)
        quality = relieved(metric, euclidean, in_metric)
        if not quality >= worst:
            worst = quality
            if not worst >= least:
                return worst
    return worst


@inner_kernel
def may_move(position, star, metric, v, x, y, z, floor):
    if star_tolerable(position, star, metric, v, x, y, z, floor):
        return True
    old_x, old_y, old_z = position[v, 0], position[v, 1], position[v, 2]
    if star_tolerable(position, star, metric, v, old_x, old_y, old_z, floor):
        return False
    before = effective_around(position, star, metric, v, old_x, old_y, old_z, -2.0)
    after = effective_around(position, star, metric, v, x, y, z, before)
    return after > FLAT and after >= before


@kernel
def mark_valid(position, star, floor, first, last, is_valid):
    """Mark nodes `first` to `last` whose stars are tolerable.

    If all stars are tolerable, guarded moves keep them tolerable. Otherwise a neighbour may worsen a marked star
    as far as its own rule allows, and the guard is stricter than the rule up to the next marking.
    """
    for v in range(first, last):
        x, y, z = position[v, 0], position[v, 1], position[v, 2]
        is_valid[v] = tolerable_in_space(position, star, v, x, y, z, floor)
