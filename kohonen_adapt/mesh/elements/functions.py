"""Reference functions of edges, triangles and tetrahedra, of any order.

Points are barycentric coordinates, shape (n, d + 1), and slopes are derivatives by the last d of these. Hierarchical
functions have Legendre polynomials along edges, faces and the inside (B. Szabo and I. Babuska, Finite Element Analysis,
1991). They are the functions of the kernels up to order 3, and the polynomials from which the functions of nodal values
are made. The nodes are those of scikit-fem, or Gauss-Lobatto points of the sides with points inside (T. Isaac, SIAM J.
Sci. Comput. 42, 2020), for which the condition of the matrices grows slowly with the order.

At an axis x = 0 some functions of triangles have the factor s, which is 0 on the axis, see `falling`.
"""

from collections.abc import Sequence
from functools import cache
from itertools import combinations, permutations, product
from math import factorial

import numpy as np
from numpy.polynomial import legendre
from skfem import ElementTriP1, ElementTriP2, ElementTriP3, ElementTriP4
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.kernels.arrays import NEAR_AXIS
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.elements.rules import product_rule
from kohonen_adapt.mesh.host import FACET_EDGES

__all__ = [
    "EQUIDISTANT",
    "KINDS",
    "ON_AXIS",
    "corner_slopes",
    "facet_products",
    "factor_at",
    "falling",
    "hierarchical",
    "inner_order",
    "inverse_mass",
    "kinds_at_axis",
    "near_axis",
    "nodes",
    "on_axis",
    "parts",
    "positions",
    "rank_of",
    "reference_functions",
    "trace_columns",
    "traces_at",
]

EQUIDISTANT = 3  # highest order with the nodes of scikit-fem by default
KINDS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3, 4: ElementTriP4}  # scikit-fem elements by order
OFF_AXIS = 1e-9  # least factor of a node that is not on the axis
ODD = 13.5  # of the side functions of order 3; other lowest functions are 1 at the centroid of their part
# Corners on the axis for the 7 kinds of elements: none (0), corner k (1 + k), the side opposite to corner k (4 + k).
ON_AXIS = np.vstack([np.zeros((1, 3)), np.eye(3), 1.0 - np.eye(3)]) > 0.0
# Edges of hierarchical functions, by dimension: of triangles opposite to the corners. The odd functions rise from the
# first to the second corner.
EDGES = {1: ((0, 1),), 2: TRIANGLE.edges, 3: tuple(combinations(range(4), 2))}
NODE_EDGES = {1: ((0, 1),), 2: FACET_EDGES, 3: RefTet.edges}  # edges of nodes, as of scikit-fem


@cache
def corner_slopes(dim: int) -> Floats:
    """Return the slopes of the barycentric coordinates, (d + 1, d)."""
    return np.vstack([-np.ones(dim), np.eye(dim)])


def _legendre(degree: int, x: Floats) -> FloatsPair:
    value, slope = np.ones((degree + 1, *x.shape)), np.zeros((degree + 1, *x.shape))
    if degree > 0:
        value[1], slope[1] = x, 1.0
    for k in range(1, degree):
        value[k + 1] = ((2 * k + 1) * x * value[k] - k * value[k - 1]) / (k + 1)
        slope[k + 1] = slope[k - 1] + (2 * k + 1) * value[k]
    return value, slope


def _on_parts(corners: Ints, at: Floats, order: int) -> FloatsPair:
    """Return the functions that vanish off edges, faces or the inside.

    The parts have the `corners`, shape (m, corners). Values are (k m, n), and slopes (k m, d, n), with the lowest
    functions of all parts first.
    """
    hats, rates = at.T[corners], corner_slopes(at.shape[1] - 1)[corners]
    bubble, size = hats.prod(axis=1), corners.shape[1]
    of_bubble = sum(np.delete(hats, i, axis=1).prod(axis=1)[:, None] * rates[:, i, :, None] for i in range(size))
    along = [_legendre(order - size, hats[:, 1] - hats[:, 0])]
    along += [_legendre(order - size, 2.0 * hats[:, i] - 1.0) for i in range(2, size)]
    rises = [rates[:, 1] - rates[:, 0], *(2.0 * rates[:, i] for i in range(2, size))]
    values, slopes = [], []
    for degrees in product(range(order - size + 1), repeat=size - 1):
        if sum(degrees) > order - size:
            continue
        value, slope = bubble, of_bubble
        for (term, rate), k, rise in zip(along, degrees, rises, strict=True):
            if k:
                slope = slope * term[k][:, None] + (value * rate[k])[:, None] * rise[:, :, None]
                value = value * term[k]
        scale = ODD if degrees == (1,) else float(size**size)
        values.append(scale * value)
        slopes.append(scale * slope)
    return np.concatenate(values), np.concatenate(slopes)


def hierarchical(at: Floats, order: int) -> FloatsPair:
    """Return values (k, n) and slopes (k, d, n) of the hierarchical functions.

    The order is corners, then all edges for every degree from 2, then faces, then the inside.
    """
    dim = at.shape[1] - 1
    found = [(at.T, np.repeat(corner_slopes(dim)[:, :, None], len(at), axis=2))]
    for size in range(2, min(order, dim + 1) + 1):
        corners = EDGES[dim] if size == 2 else tuple(combinations(range(dim + 1), size))
        found.append(_on_parts(np.array(corners), at, order))
    values, slopes = zip(*found, strict=True)
    return np.concatenate(values), np.concatenate(slopes)


@cache
def inverse_mass(order: int, dim: int) -> Floats:
    """Return the inverse mass matrix of hierarchical functions, of volume 1."""
    at, weights = product_rule((order + 1,) * dim)
    values, _ = hierarchical(at, order)
    return np.asarray(np.linalg.inv(values * weights @ values.T), np.float64)


@cache
def positions(order: int, spread: bool) -> Floats:
    """Return the positions of nodes along a side, from 0 to 1.

    They are equidistant, or Gauss-Lobatto points if `spread`.
    """
    if not spread or order < 3:
        return np.linspace(0.0, 1.0, order + 1)
    inner = np.real(legendre.legroots(legendre.legder(np.eye(order + 1)[order])))  # complex from numpy 2.5 on
    points = np.concatenate([[-1.0], inner, [1.0]])
    return 0.5 + 0.25 * (points - points[::-1])  # exactly symmetric


def _interpolated(index: tuple[int, ...], spread: bool) -> Floats:
    # Coordinates of a node are a weighted mean over the facets.
    total = sum(index)
    if len(index) == 2:
        return positions(total, spread)[list(index)] if total else np.zeros(2)
    facets = [np.insert(_interpolated(index[:k] + index[k + 1 :], spread), k, 0.0) for k in range(len(index))]
    weights = positions(total, spread)[[total - each for each in index]]
    return np.einsum("k,ki->i", weights, facets) / weights.sum()


@cache
def nodes(order: int, dim: int, spread: bool) -> Floats:
    """Return the barycentric coordinates of the nodes, (k, d + 1).

    The order is that of scikit-fem, corners, edges, faces and the inside; on an edge from its first to its second
    corner.
    """
    found = [np.eye(dim + 1)]
    for size in range(2, min(order, dim + 1) + 1):
        own = np.stack([_interpolated(each, spread) for each in _inner(order, size)])
        found += [own @ np.eye(dim + 1)[list(corners)] for corners in parts(dim, size)]
    return np.vstack(found)


def parts(dim: int, size: int) -> Sequence[tuple[int, ...]]:
    """Return the corners of edges, faces or the inside, by their number."""
    return NODE_EDGES[dim] if size == 2 else tuple(combinations(range(dim + 1), size))


def _inner(order: int, size: int) -> list[tuple[int, ...]]:
    # numbers of steps from the facets, of nodes inside a part with `size` corners
    found = [each for each in product(range(1, order), repeat=size) if sum(each) == order]
    return found[::-1] if size == 2 else found


@cache
def inner_order(order: int, size: int) -> Ints:
    """Return the order of nodes inside a part whose corners are not ascending.

    Row r, of all ``size!``, belongs to the `rank_of` the corners. It has the numbers of the nodes, in the order of the
    corners as they are, among the nodes in the order of ascending corners.
    """
    inner = _inner(order, size)
    number = {each: k for k, each in enumerate(inner)}
    ranks = permutations(range(size))
    return np.array([[number[tuple(each[i] for i in np.argsort(rank))] for each in inner] for rank in ranks])


def rank_of(corners: Ints) -> Ints:
    """Return the number of the permutation that sorts corners (size, m), (m,)."""
    size = len(corners)
    rank = np.argsort(np.argsort(corners, axis=0), axis=0)  # of every corner among the corners
    later = np.array([np.sum(rank[i + 1 :] < rank[i], axis=0) for i in range(size)])
    return np.array([factorial(size - 1 - i) for i in range(size)]) @ later


@cache
def _to_nodal(order: int, dim: int, kind: int, spread: bool) -> Floats:
    # The factor is 0 on the axis, where values are taken of the functions without the factor.
    at = nodes(order, dim, spread)
    values, _ = hierarchical(at, order)
    if kind:
        factor = factor_at(np.array(kind), at)
        values = np.where(falling(order)[kind][:, None] & (factor > OFF_AXIS), values * factor, values)
    return np.asarray(np.linalg.inv(values), np.float64)


def near_axis(at: Floats, order: int, kind: Ints | int) -> FloatsPair:
    """Return the hierarchical functions of elements of kinds of `ON_AXIS`.

    `kind` is a single kind, or the kind at every point, (n,).
    """
    values, slopes = hierarchical(at, order)
    if not np.any(kind):
        return values, slopes
    falls, factor = np.atleast_2d(falling(order)[kind]).T, factor_at(np.asarray(kind), at)
    fall = -np.atleast_2d(ON_AXIS[kind] @ corner_slopes(2)).T
    falling_slopes = factor * slopes + values[:, None] * fall
    return np.where(falls, factor * values, values), np.where(falls[:, None], falling_slopes, slopes)


def reference_functions(at: Floats, order: int, kind: int = 0, spread: bool | None = None) -> FloatsPair:
    """Return values (k, n) and slopes (k, d, n) of the functions of nodal values.

    `kind` is the kind of a triangle at an axis. The nodes are spread by default above order 3.
    """
    matrix = _to_nodal(order, at.shape[1] - 1, kind, order > EQUIDISTANT if spread is None else spread)
    values, slopes = near_axis(at, order, kind)
    return matrix @ values, (matrix @ slopes.reshape(len(matrix), -1)).reshape(slopes.shape)


# at an axis


def on_axis(x: Floats) -> Mask:
    return x <= NEAR_AXIS * x.max(axis=1, keepdims=True)


def kinds_at_axis(x: Floats) -> Ints:
    on = on_axis(x)
    count = on.sum(axis=1)
    return np.where(count == 1, 1 + np.argmax(on, axis=1), np.where(count == 2, 4 + np.argmin(on, axis=1), 0))


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


# on facets


def traces_at(fraction: Floats, order: int) -> Floats:
    # `fraction` (n,) is the position along the side, from 0 at corner k + 1 to 1 at corner k + 2. Values have shape
    # (n, order + 1), in the order of `trace_columns`.
    return hierarchical(np.stack([1.0 - fraction, fraction], axis=1), order)[0].T


def trace_columns(k: Ints, order: int) -> Ints:
    """Return the functions that do not vanish on the sides opposite to corners k.

    Indices have shape (n, order + 1). The functions of the next and the previous corner are followed by those of the
    side.
    """
    return np.stack([(k + 1) % 3, (k + 2) % 3, *(3 * d + k for d in range(1, order))], axis=1)


@cache
def facet_products(order: int) -> Floats:
    """Return the integrals of products of the functions of a side of length 1."""
    at, weights = product_rule((order + 1,))
    values, _ = reference_functions(at, order, spread=False)
    return values * weights @ values.T
