"""Integrate functions of elements with curved sides, and around an axis, at points of their own."""

from functools import cache

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.kernels.arrays import Points
from kohonen_adapt.mesh.near_axis import ON_AXIS, points_near_axis
from kohonen_adapt.mesh.polynomials import (
    HAT_SLOPES,
    functions_at,
    functions_near_axis,
    slopes_at,
    slopes_near_axis,
)

__all__ = ["by_points", "fields_at"]

SIDES = slice(3, None)  # of the functions of order 2


@cache
def by_points(order: int) -> Points:
    """The points, and the functions of that order there, of elements of every kind."""
    (share, weight), kinds = points_near_axis(order), range(len(ON_AXIS))
    value = [functions_near_axis(np.full(len(share[kind]), kind), share[kind], order) for kind in kinds]
    slope = [slopes_near_axis(kind, share[kind], order) for kind in kinds]
    even = [functions_at(share[kind], 2)[:, SIDES, None] for kind in kinds]
    sides = [np.concatenate([even[kind], slopes_at(share[kind], 2)[:, SIDES]], axis=2) for kind in kinds]
    return Points(weight, share, np.stack(value), np.stack(slope), np.stack(sides))


def fields_at(
    points: Points, kind: int, corners: Floats, bend: Floats, coefficients: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Elements of one kind at their points: doubled area, x and values (points, m), gradients (2, points, m).

    For corners (m, 3, 2), bends of their sides (m, 3, 2) and coefficients (m, functions).
    """
    side = points.side[kind]
    way = np.einsum("id,mic->mcd", HAT_SLOPES, corners) + np.einsum("qkd,mkc->qmcd", side[:, :, 1:], bend)
    x = points.share[kind] @ corners[:, :, 0].T + side[:, :, 0] @ bend[:, :, 0].T
    along, aside = np.einsum("qid,mi->dqm", points.slope[kind], coefficients)
    (ax, bx), (ay, by) = np.moveaxis(way, (2, 3), (0, 1))
    doubled = ax * by - bx * ay
    slope = np.stack([by * along - ay * aside, ax * aside - bx * along]) / doubled
    return doubled, x, points.value[kind] @ coefficients.T, slope
