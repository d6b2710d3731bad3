"""Exponents of the singular functions of a solution at a node.

Around a node a solution is a sum of functions ``r^l s(angle)``. In a sector of constant coefficient s is a combination
of cos(l angle) and sin(l angle); s and coefficient times s' are continuous between sectors. The squares of the
exponents are the eigenvalues of ``-(coefficient s')' = l^2 coefficient s`` on the circle, or between two boundaries.
Polynomials have whole numbers, and a gradient with l < 1 is infinite.
"""

from functools import cache, lru_cache

import numpy as np
from scipy.linalg import eigh

from kohonen_adapt.arrays import Floats, FloatsPair

__all__ = ["SMOOTH", "STRONG", "exponents"]

SMOOTH = 1.95  # exponent from which a solution counts as smooth
STRONG = 0.45  # exponent below which elements at a node miss more than jumps of the flux show
DEGREE = 8  # of s in pieces of sectors; exponents below `SMOOTH` are then right to 1e-9
DIGITS = 12  # of angles, so that the same corner of another mesh has the same exponents
LARGEST = np.pi / 3.0  # angle of a piece


def exponents(angle: Floats, coefficient: Floats, prescribed: tuple[bool, bool] | None) -> Floats:
    """Return the exponents below `SMOOTH` of sectors around a node, in rising order.

    Parameters
    ----------
    angle, coefficient : (n,)
        Angles and coefficients of the sectors in order.
    prescribed
        Whether values are prescribed on both ends of the sectors, None for a node inside.
    """
    first = np.flatnonzero(np.append(True, coefficient[1:] != coefficient[:-1]))
    size, value = np.round(np.add.reduceat(angle, first), DIGITS), coefficient[first] / coefficient.max()
    return of_sectors(tuple(size.tolist()), tuple(value.tolist()), prescribed)


@lru_cache(maxsize=1024)  # passes keep the angles of corners
def of_sectors(angles: tuple[float, ...], values: tuple[float, ...], prescribed: tuple[bool, bool] | None) -> Floats:
    size, value = np.array(angles), np.array(values)
    count = np.ceil(size / LARGEST).astype(int)
    size, value = np.repeat(size / count, count), np.repeat(value, count)
    slopes, products = np.zeros((2, size.size * DEGREE + 1, size.size * DEGREE + 1))
    for piece, (length, weight) in enumerate(zip(size, value, strict=True)):
        own = slice(piece * DEGREE, (piece + 1) * DEGREE + 1)
        slopes[own, own] += weight / length * matrices()[0]
        products[own, own] += weight * length * matrices()[1]
    free = np.arange(len(slopes))
    if prescribed is None:  # s closes
        for matrix in (slopes, products):
            matrix[0] += matrix[-1]
            matrix[:, 0] += matrix[:, -1]
        free = free[:-1]
    else:
        free = free[int(prescribed[0]) : len(free) - int(prescribed[1])]
    scale = 1.0 / np.sqrt(np.diag(products)[free])
    scaled = (scale[:, None] * matrix[np.ix_(free, free)] * scale for matrix in (slopes, products))
    found = np.sqrt(np.maximum(eigh(*scaled, eigvals_only=True), 0.0))
    constants = prescribed is None or not any(prescribed)
    found = found[int(constants) :]
    found = found[found < SMOOTH]
    found.setflags(write=False)
    return found


@cache
def matrices() -> FloatsPair:
    # products of the derivatives and of the values of Lagrange functions on (0, 1)
    at, weight = np.polynomial.legendre.leggauss(DEGREE + 1)
    nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
    powers = np.linalg.inv(np.polynomial.legendre.legvander(2.0 * nodes - 1.0, DEGREE))
    values = np.polynomial.legendre.legvander(at, DEGREE) @ powers
    slopes = np.polynomial.legendre.legval(at, np.polynomial.legendre.legder(powers, scl=2.0)).T
    return slopes.T @ (0.5 * weight[:, None] * slopes), values.T @ (0.5 * weight[:, None] * values)
