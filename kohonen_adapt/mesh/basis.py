"""Quadrature and basis functions of elements, also at an axis x = 0."""

from collections.abc import Sequence
from functools import cache
from itertools import permutations

import numpy as np
from scipy.special import roots_jacobi
from skfem import ElementTriP1, ElementTriP2, ElementTriP3, ElementTriP4
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import NEAR_AXIS
from kohonen_adapt.mesh.curved import AFTER, BEFORE

__all__ = [
    "BUBBLE",
    "CURVED_RULE_IN_SPACE",
    "EVEN",
    "HAT_SLOPES",
    "KINDS",
    "LAW_DEGREE",
    "LAW_DEGREE_BY_POINTS",
    "LAW_RULE_IN_SPACE",
    "ON_AXIS",
    "facet_functions",
    "facet_products",
    "factor_at",
    "falling",
    "functions_at",
    "kinds_at_axis",
    "on_axis",
    "points_near_axis",
    "slopes_at",
    "trace_columns",
    "traces_at",
]

# By order of the elements, in the equations, the functional and its descent alike. The functional of random problems on
# coarse meshes is within 1 % of its fall under refinement of that by degree 16 (`python -m benchmarks nonlinear`). Of
# 400 problems two were not with degree 12 at order 3, by 7 %. A polish by degree 6 moves nodes of order 3 to where the
# points flatter, below the exact functional.
LAW_DEGREE = {1: 0, 2: 10, 3: 14}  # straight sides, constant gradients at order 1
LAW_DEGREE_BY_POINTS = {1: 8, 2: 14, 3: 14}  # curved sides, and around an axis
# Tetrahedra of order 2: weights and barycentric coordinates, for each of their permutations, of 46 points of degree 8.
# They minimise the error of all moments, with positive weights and points inside, as 125 points of a product rule have.
# With both rules the functional of iron at its knee in half a cube changes by at most 0.3 % of the squared error of the
# field; with 64 points of degree 7 by up to 1.2 %.
ORBITS_IN_SPACE = (
    (0.024470923987127233, (0.6924163892695996, *(0.10252787024346678,) * 3)),
    (0.040333800911961905, (0.05661645581590957, *(0.3144611813946968,) * 3)),
    (0.006504237986655503, (0.8801673558896679, *(0.03994421470344403,) * 3)),
    (0.05463669526309036, (0.44720276707268436, *(0.18426574430910522,) * 3)),
    (0.03577125520340397, (*(0.06352507633703039,) * 2, *(0.4364749236629696,) * 2)),
    (0.007179646311318097, (*(0.02166305728471349,) * 2, 0.23696464707271161, 0.7197092383578614)),
    (0.01628617337070159, (*(0.20444393026103413,) * 2, 0.010232649150162648, 0.5808794903277691)),
)
# Points (4, 4) and weights (4,) of curved tetrahedra without a law, of degree 2, as of `inner_points`. Degree 5 would
# change the error of H around a ball by less than 0.1 %.
CURVED_RULE_IN_SPACE = 0.25 + 5.0**-0.5 * (np.eye(4) - 0.25), np.full(4, 0.25)
# Corners on the axis for the 7 kinds of elements: none (0), corner k (1 + k), the side opposite to corner k (4 + k).
ON_AXIS = np.vstack([np.zeros((1, 3)), np.eye(3), 1.0 - np.eye(3)]) > 0.0
DEGREE = {1: 6, 2: 8, 3: 10}  # by order, of symmetric rules with 12, 16 and 25 points, without a law
LAYERS = {12: 2, 16: 2, 25: 5, 33: 3, 42: 6}  # by number of points, layers around a single corner on the axis

EVEN, ODD, BUBBLE = 4.0, 13.5, 27.0  # factors of products of the linear functions, see `Reference`
KINDS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3, 4: ElementTriP4}  # scikit-fem elements by order
HAT_SLOPES = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])


def symmetric_rule(orbits: Sequence[tuple[float, tuple[float, ...]]]) -> tuple[Floats, Floats]:
    """Return all points, shape (n, 4), and their weights (n,), with sum 1."""
    found = [(sorted(set(permutations(point))), weight) for weight, point in orbits]
    weights = np.repeat([weight for _, weight in found], [len(points) for points, _ in found])
    return np.concatenate([points for points, _ in found]), weights / weights.sum()


LAW_RULE_IN_SPACE = symmetric_rule(ORBITS_IN_SPACE)


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


def functions_at(barycentric: Floats, order: int) -> Floats:
    product, rise = barycentric[:, AFTER] * barycentric[:, BEFORE], barycentric[:, BEFORE] - barycentric[:, AFTER]
    parts = [barycentric, EVEN * product, ODD * product * rise, BUBBLE * np.prod(barycentric, axis=1, keepdims=True)]
    return np.hstack(parts[: (1, 2, 4)[order - 1]])


def slopes_at(barycentric: Floats, order: int) -> Floats:
    left, right = barycentric[:, AFTER, None], barycentric[:, BEFORE, None]
    product = left * HAT_SLOPES[BEFORE] + right * HAT_SLOPES[AFTER]
    odd = (right - left) * product + left * right * (HAT_SLOPES[BEFORE] - HAT_SLOPES[AFTER])
    bubble = np.sum(left * right * HAT_SLOPES, axis=1, keepdims=True)
    parts = [np.broadcast_to(HAT_SLOPES, product.shape), EVEN * product, ODD * odd, BUBBLE * bubble]
    return np.hstack(parts[: (1, 2, 4)[order - 1]])


def traces_at(fraction: Floats, order: int) -> Floats:
    # `fraction` (n,) is the position along the side, from 0 at corner k + 1 to 1 at corner k + 2. Values have shape
    # (n, order + 1), in the order of `trace_columns`.
    product = fraction * (1.0 - fraction)
    functions = 1.0 - fraction, fraction, EVEN * product, ODD * product * (2.0 * fraction - 1.0)
    return np.stack(functions[: order + 1], axis=1)


def trace_columns(k: Ints, order: int) -> Ints:
    """Return the functions that do not vanish on the sides opposite to corners k.

    Indices have shape (n, order + 1). The functions of the next and the previous corner are followed by those of the
    side.
    """
    return np.stack([(k + 1) % 3, (k + 2) % 3, *(3 * d + k for d in range(1, order))], axis=1)


def facet_products(order: int) -> Floats:
    powers, functions = np.arange(order + 1), facet_functions(order)
    moments = 1.0 / (powers[:, None] + powers + 1.0)
    return functions.T @ moments @ functions


def facet_functions(order: int) -> Floats:
    # Column j contains the coefficients of function j by powers, shape (order + 1, order + 1).
    at = np.concatenate(([0.0, 1.0], np.arange(1, order) / order))
    return np.linalg.inv(at[:, None] ** np.arange(order + 1))
