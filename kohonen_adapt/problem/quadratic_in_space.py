"""Value of a Ritz functional of order 2 on tetrahedra."""

from collections.abc import Iterator

import numpy as np
from skfem import ElementTetP1
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.quadratic_in_space import function_slopes, quadratic_functions
from kohonen_adapt.mesh.quadrature import LAW_DEGREE_IN_SPACE, tetrahedron_rule
from kohonen_adapt.problem.density_in_space import density_in_space
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_table, source_at, value_by_region

__all__ = [
    "LAW_POINTS",
    "LAW_WEIGHTS",
    "MEANS",
    "fields_at_corners",
    "fluxes",
    "quadratic_loads",
    "quadratic_value",
    "rules",
]

OF_SLOPES, OF_SOURCE = 2, 8  # degrees of quadrature: of a product of gradients, and of a source function
CHUNK = 1 << 12  # elements whose points are evaluated at once
LAW_POINTS, LAW_WEIGHTS = (np.ascontiguousarray(part) for part in tetrahedron_rule(LAW_DEGREE_IN_SPACE))
MEANS = np.append(np.full(4, 1.0 / 4.0), np.full(6, 1.0 / 5.0))  # means of the functions


def quadratic_value(corners: Floats, coefficients: Floats, node: Ints, region: Ints, ritz: Ritz) -> float:
    # `corners` has shape (3, 4, m), and `coefficients` has shape (10, m). The nodes (4, m) order the corners for
    # quadrature, as in the kernels.
    six, total = np.abs(TETRAHEDRON.determinant(corners)), np.zeros(corners.shape[2])
    fields, rank = fields_at_corners(corners, coefficients), node.argsort(axis=0).argsort(axis=0)
    for rows, barycentric, weight in rules(region, ritz):
        slope = np.einsum("qkm,kdm->dqm", barycentric[:, rank[:, rows]], fields[:, :, rows]).reshape(3, -1)
        density = density_in_space(slope, np.tile(region[rows], len(weight)), ritz)
        total[rows] = six[rows] * (weight @ density.reshape(len(weight), -1))
    return float(np.sum(total) - np.sum(quadratic_loads(corners, region, ritz) * coefficients))


def fields_at_corners(corners: Floats, coefficients: Floats) -> Floats:
    # Return the gradients of functions, shape (4, 3, m).
    at = [function_slopes(corners, corner) for corner in np.eye(4)]
    return np.stack([np.einsum("dkm,km->dm", slopes, coefficients) for slopes in at])


def rules(region: Ints, ritz: Ritz) -> Iterator[tuple[Ints, Floats, Floats]]:
    # Yield elements without a law, then with a law, with their points (q, 4) and weights (q,).
    nonlinear = np.array([law is not None for law in ritz.laws] or [False])
    has_law = nonlinear[region] if ritz.laws else np.zeros(len(region), dtype=np.bool_)
    for with_law, rule in ((False, rule_of(OF_SLOPES)), (True, (LAW_POINTS, LAW_WEIGHTS / 6.0))):
        rows = np.flatnonzero(has_law == with_law)
        for first in range(0, len(rows), CHUNK):
            yield rows[first : first + CHUNK], *rule


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
    for barycentric, weight in zip(*rule_of(OF_SOURCE), strict=True):
        x = np.einsum("k,dkm->dm", barycentric, corners)[:, None]
        loads += weight * quadratic_functions(barycentric)[:, None] * source_at(x, region, ritz.source)[0]
    return loads * six


def rule_of(degree: int) -> tuple[Floats, Floats]:
    at, weight = get_quadrature(ElementTetP1, degree)
    return np.vstack([1.0 - at.sum(axis=0), at]).T, weight
