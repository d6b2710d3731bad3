"""Value of a Ritz functional of order 2 on tetrahedra."""

from collections.abc import Iterator

import numpy as np
from skfem import ElementTetP1
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.quadratic_in_space import function_slopes, quadratic_functions
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_table, source_at, value_by_region

__all__ = ["MEANS", "fluxes", "points_of_slopes", "quadratic_loads", "quadratic_value"]

OF_SLOPES, OF_SOURCE = 2, 8  # degrees of quadrature: of a product of gradients, and of a source function
MEANS = np.append(np.full(4, 1.0 / 4.0), np.full(6, 1.0 / 5.0))  # means of the functions


def quadratic_value(corners: Floats, coefficients: Floats, region: Ints, ritz: Ritz) -> float:
    """Return the functional on tetrahedra.

    `corners` has shape (3, 4, m), and `coefficients` has shape (10, m).
    """
    half, flux = 0.5 * value_by_region(np.asarray(ritz.coefficient), region), fluxes(region, ritz)
    six, total = np.abs(TETRAHEDRON.determinant(corners)), np.zeros(corners.shape[2])
    for barycentric, weight in points_of_slopes():
        slope = np.einsum("dkm,km->dm", function_slopes(corners, barycentric), coefficients)
        total += weight * six * np.sum((half * slope - flux) * slope, axis=0)
    return float(np.sum(total) - np.sum(quadratic_loads(corners, region, ritz) * coefficients))


def fluxes(region: Ints, ritz: Ritz) -> Floats:
    table = flux_table(np.asarray(ritz.flux), TETRAHEDRON.dim)
    return np.stack([value_by_region(component, region) * np.ones(len(region)) for component in table])


def quadratic_loads(corners: Floats, region: Ints, ritz: Ritz) -> Floats:
    """Return the integrals of source times functions, shape (10, m).

    A source that is a polynomial of degree 6 is integrated exactly.
    """
    six = np.abs(TETRAHEDRON.determinant(corners))
    if not callable(ritz.source):
        return MEANS[:, None] * (value_by_region(np.asarray(ritz.source), region) * six / 6.0)
    loads = np.zeros((len(MEANS), len(six)))
    for barycentric, weight in points(OF_SOURCE):
        x = np.einsum("k,dkm->dm", barycentric, corners)[:, None]
        loads += weight * quadratic_functions(barycentric)[:, None] * source_at(x, region, ritz.source)[0]
    return loads * six


def points_of_slopes() -> Iterator[tuple[Floats, float]]:
    return points(OF_SLOPES)


def points(degree: int) -> Iterator[tuple[Floats, float]]:
    at, weight = get_quadrature(ElementTetP1, degree)
    yield from zip(np.vstack([1.0 - at.sum(axis=0), at]).T, weight.tolist(), strict=True)
