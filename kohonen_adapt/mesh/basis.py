"""Basis functions on triangles, their sides, and facets."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.curved import AFTER, BEFORE

__all__ = [
    "BUBBLE",
    "EVEN",
    "HAT_SLOPES",
    "facet_functions",
    "facet_products",
    "functions_at",
    "slopes_at",
    "trace_columns",
    "traces_at",
]

EVEN, ODD, BUBBLE = 4.0, 13.5, 27.0  # factors of products of the linear functions, see `Reference`
HAT_SLOPES = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])


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
