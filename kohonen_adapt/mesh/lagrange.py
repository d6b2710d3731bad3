"""Lagrange functions of any order on triangles, from hierarchical ones.

The nodes are the corners, the Gauss-Lobatto points of the sides and points inside (T. Isaac, SIAM J. Sci. Comput. 42,
2020), so that the condition of the matrices grows slowly with the order. Around an axis some of the hierarchical
functions have a factor, see `quadrature`.
"""

from functools import cache

import numpy as np
from numpy.polynomial import legendre
from scipy.special import roots_jacobi
from skfem import ElementTriP1
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats
from kohonen_adapt.mesh.basis import ON_AXIS, factor_at, falling
from kohonen_adapt.mesh.curved import AFTER, BEFORE

__all__ = ["functions_and_slopes", "lobatto", "nodes", "rule_about", "trace_functions", "triangle_rule"]

SLOPES = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # of the barycentric coordinates by the last two
HIGHEST_TABLED = 19  # degree of scikit-fem's rules
EDGES = ((0, 1), (1, 2), (0, 2))  # local corners of the sides, in the order and orientation of scikit-fem


@cache
def triangle_rule(degree: int) -> tuple[Floats, Floats]:
    """Return barycentric coordinates (n, 3) and weights (n,) with sum 1."""
    if degree > HIGHEST_TABLED:
        return rule_about(0, degree)
    points, weights = get_quadrature(ElementTriP1, degree)
    return np.stack([1.0 - points.sum(axis=0), *points], axis=1), 2.0 * weights


@cache
def rule_about(corner: int, degree: int) -> tuple[Floats, Floats]:
    """Return a rule with layers of points about a corner, as `triangle_rule`."""
    count = degree // 2 + 1
    (out, of_layer), (side, across) = roots_jacobi(count, 0, 1), legendre.leggauss(count)
    far, second = np.repeat(0.5 + 0.5 * out, count), np.tile(0.5 + 0.5 * side, count)
    barycentric = np.stack([1.0 - far, far * (1.0 - second), far * second], axis=1)
    return np.roll(barycentric, corner, axis=1), np.outer(of_layer, across).ravel() / 4.0


@cache
def lobatto(order: int) -> Floats:
    inner = np.real(legendre.legroots(legendre.legder(np.eye(order + 1)[order])))  # complex from numpy 2.5 on
    points = np.concatenate([[-1.0], inner, [1.0]])
    return 0.5 + 0.25 * (points - points[::-1])  # exactly symmetric


@cache
def nodes(order: int) -> Floats:
    """Return the barycentric coordinates of the nodes of a triangle, (functions, 3)."""
    points, rows = lobatto(order)[1:-1], [np.eye(3)]
    for start, end in EDGES:
        rows.append(np.outer(1.0 - points, np.eye(3)[start]) + np.outer(points, np.eye(3)[end]))
    inside = [_recursive((i, j, order - i - j)) for i in range(1, order - 1) for j in range(1, order - i)]
    return np.vstack([*rows, np.reshape(inside, (-1, 3))])


def _recursive(index: tuple[int, ...]) -> Floats:
    total = sum(index)
    if len(index) == 2:
        return lobatto(total)[list(index[::-1])][::-1] if total else np.zeros(2)
    sides = [np.insert(_recursive(index[:k] + index[k + 1 :]), k, 0.0) for k in range(3)]
    weights = lobatto(total)[[total - each for each in index]]
    return np.einsum("k,ki->i", weights, sides) / weights.sum()


def _legendre(degree: int, x: Floats) -> tuple[Floats, Floats]:
    value, slope = np.ones((degree + 1, x.size)), np.zeros((degree + 1, x.size))
    if degree:
        value[1], slope[1] = x, 1.0
    for k in range(1, degree):
        value[k + 1] = ((2 * k + 1) * x * value[k] - k * value[k - 1]) / (k + 1)
        slope[k + 1] = slope[k - 1] + (2 * k + 1) * value[k]
    return value, slope


def _hierarchical(barycentric: Floats, order: int) -> tuple[Floats, Floats]:
    """Return values (k, n) and slopes (k, 2, n) of the hierarchical functions.

    The order is corners, then sides opposite to corners 0, 1, 2 for every degree from 2, with Legendre polynomials
    along the side (B. Szabo and I. Babuska, Finite Element Analysis, 1991), then functions that vanish on all sides.
    """
    hats = barycentric.T
    values, slopes = [*hats], [np.repeat(slope[:, None], hats.shape[1], axis=1) for slope in SLOPES]
    left, right = hats[AFTER], hats[BEFORE]
    product, rise = left * right, right - left
    of_product = left[:, None] * SLOPES[BEFORE][:, :, None] + right[:, None] * SLOPES[AFTER][:, :, None]
    of_rise = (SLOPES[BEFORE] - SLOPES[AFTER])[:, :, None]
    along, rates = (part.reshape(-1, *rise.shape) for part in _legendre(order - 2, rise.ravel()))
    for value, rate in zip(along, rates, strict=True):
        values += [*(product * value)]
        slopes += [*(of_product * value[:, None] + (product * rate)[:, None] * of_rise)]
    bubble = hats.prod(axis=0)
    of_bubble = np.einsum("kn,kc->cn", product, SLOPES)
    (first, first_rate), (second, second_rate) = (_legendre(order, x) for x in (hats[1] - hats[0], 2.0 * hats[2] - 1.0))
    for i in range(order - 2):
        for j in range(order - 2 - i):
            values.append(bubble * first[i] * second[j])
            rate = np.outer(SLOPES[1] - SLOPES[0], first_rate[i] * second[j]) + np.outer(
                2.0 * SLOPES[2], first[i] * second_rate[j]
            )
            slopes.append(of_bubble * first[i] * second[j] + bubble * rate)
    return np.stack(values), np.stack(slopes)


@cache
def _coefficients_of_values(order: int, kind: int) -> Floats:
    # The factor is 0 on the axis, where values are taken of the functions without the factor.
    at = nodes(order)
    plain, _ = _hierarchical(at, order)
    falls, factor = falling(order)[kind][:, None], factor_at(np.array(kind), at)
    return np.linalg.inv(np.where(falls & (factor > 1e-9), plain * factor, plain).T)


def functions_and_slopes(barycentric: Floats, order: int, kind: int = 0) -> tuple[Floats, Floats]:
    """Return values (k, n) and reference gradients (k, 2, n) of Lagrange functions.

    `barycentric` has shape (n, 3), and `kind` is the kind of the element at an axis, as in `ON_AXIS`.
    """
    values, slopes = _hierarchical(barycentric, order)
    if kind:
        falls, factor = falling(order)[kind], factor_at(np.array(kind), barycentric)
        of_factor = -(ON_AXIS[kind] @ SLOPES)
        falling_slopes = factor * slopes + values[:, None] * of_factor[:, None]
        slopes = np.where(falls[:, None, None], falling_slopes, slopes)
        values = np.where(falls[:, None], factor * values, values)
    matrix = _coefficients_of_values(order, kind).T
    return matrix @ values, np.einsum("ij,jcn->icn", matrix, slopes)


@cache
def _trace_matrix(order: int) -> Floats:
    return np.asarray(np.linalg.inv(legendre.legvander(2.0 * lobatto(order) - 1.0, order)), dtype=np.float64)


def trace_functions(at: Floats, order: int) -> Floats:
    """Return the Lagrange functions (n, order + 1) of a side at positions 0 to 1.

    The functions of both ends precede the others, as in the unknowns of facets.
    """
    values = legendre.legvander(2.0 * at - 1.0, order) @ _trace_matrix(order)
    return values[:, [0, order, *range(1, order)]]
