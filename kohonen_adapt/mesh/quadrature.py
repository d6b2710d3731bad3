"""Quadrature of elements with a B-H law, and of elements at an axis x = 0.

The functions at the axis are those of `Reference`. Some of them have an additional factor s, so that they decay towards
the axis as the solution does (`falling`). `Ritz` describes the weight 1 / x.
"""

from functools import cache

import numpy as np
from scipy.special import roots_jacobi
from skfem import ElementTriP1
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import NEAR_AXIS

__all__ = [
    "CURVED_RULE_IN_SPACE",
    "LAW_DEGREE",
    "LAW_DEGREE_BY_POINTS",
    "LAW_DEGREE_IN_SPACE",
    "ON_AXIS",
    "factor_at",
    "falling",
    "kinds_at_axis",
    "on_axis",
    "points_near_axis",
]

# By order of the elements, in the equations, the functional and its descent alike. The functional of random problems on
# coarse meshes is within 1 % of its fall under refinement of that by degree 16 (`python -m benchmarks nonlinear`). Of
# 400 problems two were not with degree 12 at order 3, by 7 %. A polish by degree 6 moves nodes of order 3 to where the
# points flatter, below the exact functional.
LAW_DEGREE = {1: 0, 2: 10, 3: 14}  # straight sides, constant gradients at order 1
LAW_DEGREE_BY_POINTS = {1: 8, 2: 14, 3: 14}  # curved sides, and around an axis
# Tetrahedra of order 2. Points of degree 7 change the functional by 4 to 5 % of its fall under refinement, points of
# degree 9 by less than 0.1 % (iron at its knee in half a cube).
LAW_DEGREE_IN_SPACE = 9
# Points (4, 4) and weights (4,) of curved tetrahedra without a law, of degree 2, as of `inner_points`. Degree 5 would
# change the error of H around a ball by less than 0.1 %.
CURVED_RULE_IN_SPACE = 0.25 + 5.0**-0.5 * (np.eye(4) - 0.25), np.full(4, 0.25)
# Corners on the axis for the 7 kinds of elements: none (0), corner k (1 + k), the side opposite to corner k (4 + k).
ON_AXIS = np.vstack([np.zeros((1, 3)), np.eye(3), 1.0 - np.eye(3)]) > 0.0
DEGREE = {1: 6, 2: 8, 3: 10}  # by order, of symmetric rules with 12, 16 and 25 points, without a law
LAYERS = {12: 2, 16: 2, 25: 5, 33: 3, 42: 6}  # by number of points, layers around a single corner on the axis


def kinds_at_axis(x: Floats) -> Ints:
    on = on_axis(x)
    count = on.sum(axis=1)
    return np.where(count == 1, 1 + np.argmax(on, axis=1), np.where(count == 2, 4 + np.argmin(on, axis=1), 0))


def on_axis(x: Floats) -> Mask:
    return x <= NEAR_AXIS * x.max(axis=1, keepdims=True)


def factor_at(kind: Ints, barycentric: Floats) -> Floats:
    """Return the factor s at barycentric coordinates (n, 3).

    The factor is one minus the sum of the barycentric coordinates of corners on the axis.
    """
    return 1.0 - np.sum(ON_AXIS[kind] * barycentric, axis=-1)


@cache
def falling(order: int) -> Mask:
    """Return a mask of the functions with the factor s, (7, functions).

    The rows are kinds of elements, as in `ON_AXIS`. If a side is on the axis, all functions have the factor, because
    they must decay like x^2 and not only like x. If one corner is on the axis, only the functions that do not vanish on
    the sides at this corner have the factor, to be continuous with the adjacent element. The remaining functions decay
    like x^2 without the factor, and with the factor functions of order 2 would not contain a uniform field.
    """
    inner = (order - 1) * (order - 2) // 2
    rows = np.hstack([np.ones((3, 3)), *[1.0 - np.eye(3)] * (order - 1), np.zeros((3, inner))])
    return np.vstack([np.zeros_like(rows[:1]), rows, np.ones_like(rows)]) > 0.0


@cache
def points_near_axis(order: int, law: bool = False) -> tuple[Floats, Floats]:
    """Return quadrature points and weights for elements at an axis.

    The integrand is ``|grad u|^2 / x``, with a `law` ``x W(|grad u| / x)``. The rows are kinds of elements, as in
    `ON_AXIS`. Barycentric coordinates have shape (7, points, 3), weights (7, points) with sum 1. In an element with one
    corner on the axis the first integrand is a polynomial along every ray from this corner and smooth between rays, so
    that the points lie on layers around the corner.
    """
    points, weight = get_quadrature(ElementTriP1, (LAW_DEGREE_BY_POINTS if law else DEGREE)[order])
    barycentric, layers = np.stack([1.0 - points.sum(axis=0), *points], axis=1), LAYERS[weight.size]
    (out, of_layer), (side, across) = (
        roots_jacobi(layers, 0, 1),
        np.polynomial.legendre.leggauss(len(barycentric) // layers),
    )
    far, second = np.repeat(0.5 + 0.5 * out, side.size), np.tile(0.5 + 0.5 * side, layers)
    ray = np.stack([1.0 - far, far * (1.0 - second), far * second], axis=1)
    barycentrics = [barycentric, *(np.roll(ray, k, axis=1) for k in range(3)), *[barycentric] * 3]
    weights = [2.0 * weight, *[np.outer(of_layer, across).ravel() / 4.0] * 3, *[2.0 * weight] * 3]
    return np.stack(barycentrics), np.stack(weights)
