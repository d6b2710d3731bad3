"""Quadrature rules of triangles and tetrahedra.

A rule has barycentric coordinates (n, d + 1) and weights (n,) with sum 1.
"""

from collections.abc import Sequence
from functools import cache
from itertools import permutations
from math import factorial

import numpy as np
from scipy.special import roots_jacobi
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import FloatsPair
from kohonen_adapt.mesh.cells import CELLS

__all__ = [
    "CURVED_RULE_IN_SPACE",
    "LAW_DEGREE",
    "LAW_RULE_IN_SPACE",
    "SOURCE_DEGREE",
    "facet_rule",
    "points_near_axis",
    "product_rule",
    "rule_about",
    "rule_of",
    "tetrahedron_rule",
    "triangle_rule",
]

# By order of the elements, in the equations, the functional and its descent alike. The functional of random problems on
# coarse meshes is within 1 % of its fall under refinement of that by degree 16. Of
# 400 problems two were not with degree 12 at order 3, by 7 %. A polish by degree 6 moves nodes of order 3 to where the
# points flatter, below the exact functional.
LAW_DEGREE = {1: 0, 2: 10, 3: 14}  # straight sides, constant gradients at order 1
LAW_DEGREE_BY_POINTS = {1: 8, 2: 14, 3: 14}  # curved sides, and around an axis
CURVED_DEGREE = 2  # above 2 p, on curved elements without a law, where gradients are not polynomials
AXIS_DEGREE = {1: 6, 2: 8, 3: 10}  # by order, of symmetric rules with 12, 16 and 25 points, without a law
SOURCE_DEGREE = 2  # above the order, of the polynomial of a varying source in the polish
LAYERS = {12: 2, 16: 2, 25: 5, 33: 3, 42: 6}  # by number of points, layers around a single corner on the axis
# Above 2 p, of elements on arcs. Straight elements of linear material in the plane need 2 p - 2, and forces 2 p. On
# arcs, around an axis and for laws integrands are no polynomials.
ON_ARCS, ABOUT_AXIS, BY_LAW = 6, 4, 8
FACET_POINTS = 12  # points along facets of elements on arcs, above the order
AXIS_FACET_DEGREE = 10
# Above 2 p, on tetrahedra. Without a law a torque integrates products of two fields and an arm.
IN_SPACE, CURVED_IN_SPACE, LAW_IN_SPACE = -1, 1, 4
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
HIGHEST_TABLED = 19  # degree of scikit-fem's rules

Rule = FloatsPair


def symmetric_rule(orbits: Sequence[tuple[float, tuple[float, ...]]]) -> Rule:
    """Return all points, shape (n, 4), and their weights (n,), with sum 1."""
    found = [(sorted(set(permutations(point))), weight) for weight, point in orbits]
    weights = np.repeat([weight for _, weight in found], [len(points) for points, _ in found])
    return np.concatenate([points for points, _ in found]), weights / weights.sum()


LAW_RULE_IN_SPACE = symmetric_rule(ORBITS_IN_SPACE)


@cache
def product_rule(counts: tuple[int, ...]) -> Rule:
    """Return a rule in layers about corner 0, with a number of points per direction."""
    parts = [roots_jacobi(count, 0, len(counts) - 1 - i) for i, count in enumerate(counts)]
    far, barycentric = np.ones(()), []
    for at in np.meshgrid(*(0.5 + 0.5 * at for at, _ in parts), indexing="ij"):
        barycentric.append(far * (1.0 - at))
        far = far * at
    weights = np.ones(1)
    for _, weight in parts:
        weights = np.multiply.outer(weights, weight)
    return np.stack([*barycentric, far]).reshape(len(counts) + 1, -1).T, weights.ravel() / weights.sum()


@cache
def triangle_rule(degree: int) -> Rule:
    if degree > HIGHEST_TABLED:
        return rule_about(0, degree)
    return tabled_rule(2, degree)


def tabled_rule(dim: int, degree: int) -> Rule:
    """Return a rule of scikit-fem."""
    points, weights = get_quadrature(CELLS[dim].mesh.elem, degree)
    return np.stack([1.0 - points.sum(axis=0), *points], axis=1), factorial(dim) * weights


def rule_about(corner: int, degree: int) -> Rule:
    """Return a rule of triangles with layers of points about a corner."""
    return _rolled(product_rule((degree // 2 + 1,) * 2), corner)


def _rolled(rule: Rule, corner: int) -> Rule:
    return np.roll(rule[0], corner, axis=1), rule[1]


@cache
def tetrahedron_rule(degree: int) -> Rule:
    # All points are inside, where a magnetisation of one region has a unique value; scikit-fem's rules have points on
    # edges, or negative weights.
    return product_rule((degree // 2 + 1,) * 3)


@cache
def points_near_axis(order: int, law: bool = False) -> Rule:
    """Return quadrature points and weights for elements at an axis.

    The integrand is ``|grad u|^2 / x``, with a `law` ``x W(|grad u| / x)``. The rows are kinds of elements, as in
    `ON_AXIS`. Barycentric coordinates have shape (7, points, 3), weights (7, points) with sum 1. In an element with one
    corner on the axis the first integrand is a polynomial along every ray from this corner and smooth between rays, so
    that the points lie on layers around the corner.
    """
    even = triangle_rule((LAW_DEGREE_BY_POINTS if law else AXIS_DEGREE)[order])
    layers = LAYERS[even[1].size]
    about = product_rule((layers, even[1].size // layers))
    rules = [even, *(_rolled(about, corner) for corner in range(3)), *[even] * 3]
    return np.stack([points for points, _ in rules]), np.stack([weights for _, weights in rules])


def rule_of(order: int, dim: int, arcs: bool, axis: bool, kind: int, curved: bool, law: bool) -> Rule:
    """Return the points of elements with one rule.

    `arcs` is True for elements with spread nodes and arcs as sides; `kind` is the kind of an element at an axis. With
    a law tetrahedra of order 1 have the points of fields that vary inside.
    """
    if dim == 3 and order > 1:
        if order == 2 and (law or curved):
            return LAW_RULE_IN_SPACE if law else CURVED_RULE_IN_SPACE
        return tetrahedron_rule(2 * order + (LAW_IN_SPACE if law else CURVED_IN_SPACE if curved else IN_SPACE))
    if arcs:
        degree = 2 * order + (BY_LAW if law else ON_ARCS if curved else ABOUT_AXIS if axis else 0)
        return rule_about(kind - 1, degree) if kind in (1, 2, 3) else triangle_rule(degree)
    if axis:
        points, weights = points_near_axis(order, law)
        return points[kind], weights[kind]
    if order == 1:
        return CURVED_RULE_IN_SPACE if law else (np.full((1, dim + 1), 1.0 / (dim + 1)), np.ones(1))
    if law:
        return triangle_rule((LAW_DEGREE_BY_POINTS if curved else LAW_DEGREE)[order])
    return triangle_rule(2 * order + CURVED_DEGREE * curved)


@cache
def facet_rule(order: int, dim: int, arcs: bool, axis: bool) -> Rule:
    """Return a rule of the facets of elements, at barycentric coordinates (n, d)."""
    degree = AXIS_FACET_DEGREE if axis else 2 * order + CURVED_DEGREE
    return product_rule((order + FACET_POINTS if arcs and dim == 2 else degree // 2 + 1,) * (dim - 1))
