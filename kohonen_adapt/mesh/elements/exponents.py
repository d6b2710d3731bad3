"""Exponents of the singular functions of a solution at a node.

Around a node a solution is a sum of functions ``r^l s(angle)``. In a sector of constant coefficient s is a combination
of cos(l angle) and sin(l angle); s and coefficient times s' are continuous between sectors. The squares of the
exponents are the eigenvalues of ``-(coefficient s')' = l^2 coefficient s`` on the circle, or between two boundaries.
Polynomials have whole numbers, and a gradient with l < 1 is infinite.
"""

from functools import cache, lru_cache

import numpy as np
from scipy.linalg import eigh

from kohonen_adapt.arrays import Floats, FloatsPair, ranks
from kohonen_adapt.mesh.elements.assembly import assembled
from kohonen_adapt.mesh.elements.functions import reference_functions
from kohonen_adapt.mesh.elements.rules import product_rule

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
    count = np.ceil(np.array(angles) / LARGEST).astype(int)
    length, weight = np.repeat(angles / count, count), np.repeat(values, count)
    piece, ends = np.arange(length.size), length.size + (prescribed is not None)  # without ends s closes
    unknowns = np.vstack([piece, (piece + 1) % ends, ends + piece + np.arange(DEGREE - 1)[:, None] * piece.size])
    held = np.array([0, piece.size])[list(prescribed or (False, False))]
    free = np.setdiff1d(unknowns, held)
    index, upper = ranks(free, unknowns.max() + 1), np.triu_indices(DEGREE + 1)
    parts = zip(matrices(), (weight / length, weight * length), strict=True)
    both = [assembled(unknowns, np.outer(each[upper], size), index, free.size).toarray() for each, size in parts]
    scale = 1.0 / np.sqrt(np.diag(both[1]))
    found = np.sqrt(np.maximum(eigh(*(scale[:, None] * each * scale for each in both), eigvals_only=True), 0.0))
    found = found[int(not held.size) :]  # without the constants
    found = found[found < SMOOTH]
    found.setflags(write=False)
    return found


@cache
def matrices() -> FloatsPair:
    # products of the derivatives and of the values of functions on a piece of length 1
    at, weight = product_rule((DEGREE + 1,))
    values, slopes = reference_functions(at, DEGREE)
    return slopes[:, 0] * weight @ slopes[:, 0].T, values * weight @ values.T
