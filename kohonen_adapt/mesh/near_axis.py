"""Tell elements at an axis x = 0 by their corners there, how functions fall off to it, and where 1 / x is taken.

The functions are those of `Reference`; what they are multiplied by is in `Ritz`.
"""

from functools import cache

import numpy as np
from scipy.special import roots_jacobi
from skfem import ElementTriP1
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import NEAR_AXIS

__all__ = ["ON_AXIS", "factor_at", "falling", "kinds_at_axis", "on_axis", "points_near_axis"]

# The corners on the axis of every kind of element: none; one, which; two, those of the side opposite to which.
ON_AXIS = np.vstack([np.zeros((1, 3)), np.eye(3), 1.0 - np.eye(3)]) > 0.0
DEGREE = {1: 6, 2: 8, 3: 10}  # of rules that are alike for all corners, of 12, 16 and 25 points
LAYERS = {1: 2, 2: 2, 3: 5}  # of points around the only corner on the axis


def kinds_at_axis(x: Floats) -> Ints:
    """The place in `ON_AXIS` of elements whose corners have these distances from the axis, (m, 3): (m,)."""
    on = on_axis(x)
    count = on.sum(axis=1)
    return np.where(count == 1, 1 + np.argmax(on, axis=1), np.where(count == 2, 4 + np.argmin(on, axis=1), 0))


def on_axis(x: Floats) -> Mask:
    """Which corners of elements, or ends of facets, are on the axis, by their distances from it, (m, k)."""
    return x <= NEAR_AXIS * x.max(axis=1, keepdims=True)


def factor_at(kind: Ints, share: Floats) -> Floats:
    """``s = 1 - sum of the shares of the corners on the axis`` at barycentric coordinates (n, 3) of such elements."""
    return 1.0 - np.sum(ON_AXIS[kind] * share, axis=-1)


@cache
def falling(order: int) -> Mask:
    """Which functions of `Reference` have the factor s in elements of every kind, (7, functions).

    Where a side is on the axis all, for they are to fall like x^2 and not only like x. Where one corner is, those that
    are not 0 on the sides that end there, as they have it in the element beyond; the others fall like x^2 as they are,
    and with the factor no function of order 2 would have a uniform field.
    """
    one = [np.ones((3, 3)), *[1.0 - np.eye(3)] * (order - 1), np.zeros((3, 1))]
    rows = np.hstack(one)[:, : (3, 6, 10)[order - 1]]
    return np.vstack([np.zeros_like(rows[:1]), rows, np.ones_like(rows)]) > 0.0


@cache
def points_near_axis(order: int) -> tuple[Floats, Floats]:
    """Barycentric coordinates (7, points, 3) and weights (7, points), 1 in sum, for ``|grad u|^2 / x`` by kind.

    Where a side is on the axis that is a polynomial, where one corner is a polynomial along every ray from there, and
    between rays it is smooth: so the points lie on some layers around that corner.
    """
    points, weight = get_quadrature(ElementTriP1, DEGREE[order])
    share, layers = np.stack([1.0 - points.sum(axis=0), *points], axis=1), LAYERS[order]
    (out, of_layer), (side, across) = roots_jacobi(layers, 0, 1), np.polynomial.legendre.leggauss(len(share) // layers)
    far, second = np.repeat(0.5 + 0.5 * out, side.size), np.tile(0.5 + 0.5 * side, layers)
    ray = np.stack([1.0 - far, far * (1.0 - second), far * second], axis=1)
    shares = [share, *(np.roll(ray, k, axis=1) for k in range(3)), *[share] * 3]
    weights = [2.0 * weight, *[np.outer(of_layer, across).ravel() / 4.0] * 3, *[2.0 * weight] * 3]
    return np.stack(shares), np.stack(weights)
