"""Value of a Ritz functional on tetrahedra."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike
from skfem import ElementTetP1, MeshTet
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.functions import hierarchical
from kohonen_adapt.mesh.measures import tangent_corners
from kohonen_adapt.mesh.polynomials import edge_coefficients, function_slopes, unknowns_of_elements
from kohonen_adapt.mesh.rules import CURVED_RULE_IN_SPACE, LAW_RULE_IN_SPACE
from kohonen_adapt.problem.boundary_terms import corner_values, nodal_terms, reduced_regions
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_table, source_at, value_by_region

__all__ = [
    "LAW_POINTS",
    "LAW_WEIGHTS",
    "MEANS",
    "OF_SOURCE",
    "at_curved_points",
    "coefficients_in_space",
    "density_in_space",
    "fields_at_corners",
    "fluxes",
    "loads_in_space",
    "quadratic_loads",
    "quadratic_value",
    "rule_of",
    "rules",
    "secants",
    "shifted_slope",
    "value_in_space",
    "value_of_order_2",
]

# Degrees of quadrature: of a product of gradients, and of a source times functions of order 1 and 2. The rule of degree
# 6 has points on faces.
OF_SLOPES, OF_SOURCE, OF_SOURCE_2 = 2, 7, 8
CHUNK = 1 << 12  # elements whose points are evaluated at once
LAW_POINTS, LAW_WEIGHTS = LAW_RULE_IN_SPACE
MEANS = np.append(np.full(4, 1.0 / 4.0), np.full(6, 1.0 / 5.0))  # means of the functions


def coefficients_in_space(mesh: MeshTet, ritz: Ritz, region: Ints) -> tuple[Ints, Floats]:
    # unknowns of elements and coefficients of the functions, (4, m), at order 2 (10, m)
    unknowns = mesh.t if ritz.order == 1 else unknowns_of_elements(mesh, mesh.t)
    nodal, reduced = nodal_terms(ritz.surface), reduced_regions(ritz.surface, region)
    local = corner_values(np.asarray(ritz.values), nodal, unknowns, reduced)
    return unknowns, local if ritz.order == 1 else edge_coefficients(local)


def value_in_space(corners: Floats, values: Floats, region: Ints, ritz: Ritz) -> float:
    slope = np.einsum("dkm,km->dm", TETRAHEDRON.hat_gradients(corners), values)
    six, density = np.abs(TETRAHEDRON.determinant(corners)), density_in_space(slope, region, ritz)
    if callable(ritz.source):
        source_term = float(np.sum(loads_in_space(corners, region, ritz.source) * values))
        return float(np.sum(six * density)) / 6.0 - source_term
    density = density - value_by_region(np.asarray(ritz.source), region) * values.mean(axis=0)
    return float(np.sum(six * density)) / 6.0


def loads_in_space(corners: Floats, region: Ints, source: Callable[[Floats, Ints], ArrayLike]) -> Floats:
    """Return the integrals of source times functions of tetrahedra, shape (4, m).

    The rule is exact for a source that is a polynomial of degree 6.
    """
    loads = np.zeros(corners.shape[1:])
    for barycentric, part in zip(*rule_of(OF_SOURCE), strict=True):
        at = source_at(np.einsum("k,dkm->dm", barycentric, corners)[:, None], region, source)[0]
        loads += part * barycentric[:, None] * at
    return loads * np.abs(TETRAHEDRON.determinant(corners))


def density_in_space(slope: Floats, region: Ints, ritz: Ritz) -> Floats:
    square = np.sum(slope**2, axis=0)
    density = 0.5 * value_by_region(np.asarray(ritz.coefficient), region) * square
    if any(ritz.laws):
        square = np.sum(shifted_slope(slope, region, ritz) ** 2, axis=0)
    for k, law in enumerate(ritz.laws):
        if law is not None:
            rows = region == k
            density[rows] = law.energy(np.sqrt(square[rows]))
    for part, along in zip(flux_table(np.asarray(ritz.flux), TETRAHEDRON.dim), slope, strict=True):
        density -= value_by_region(part, region) * along
    return density


def shifted_slope(slope: Floats, region: Ints, ritz: Ritz) -> Floats:
    nonlinear = np.array([law is not None for law in ritz.laws] or [False])
    table = flux_table(np.asarray(ritz.shift), TETRAHEDRON.dim)
    shift = np.stack([value_by_region(part, region) * np.ones(slope.shape[1]) for part in table])
    return slope - np.where(nonlinear[region] if ritz.laws else False, shift, 0.0)


def secants(gradient: Floats, x: Floats, region: Ints, ritz: Ritz) -> Floats:
    """Return the secant coefficients H(b) / b for gradients (d, points, m).

    Around an axis `x` contains the distances of the points from the axis.
    """
    secant = np.broadcast_to(value_by_region(np.asarray(ritz.coefficient), region) / x, gradient.shape[1:]).copy()
    distance = np.broadcast_to(x, secant.shape)
    for index, law in enumerate(ritz.laws):
        if law is not None:
            rows = region == index
            size = np.maximum(np.linalg.norm(gradient[:, :, rows], axis=0), np.finfo(float).tiny)
            secant[:, rows] = law.field_strength(size / distance[:, rows]) / size
    return secant


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


def value_of_order_2(
    corners: Floats, offset: Floats, coefficients: Floats, node: Ints, region: Ints, ritz: Ritz
) -> float:
    # of straight and curved elements, with midside offsets (3, 6, m) in the order of scikit-fem
    curved = offset.any(axis=(0, 1))
    if not curved.any():
        return quadratic_value(corners, coefficients, node, region, ritz)
    rows, straight = np.flatnonzero(curved), np.flatnonzero(~curved)
    own = curved_value(corners[:, :, rows], offset[:, :, rows], coefficients[:, rows], region[rows], ritz)
    parts = corners[:, :, straight], coefficients[:, straight], node[:, straight], region[straight], ritz
    return own + quadratic_value(*parts)


def curved_value(corners: Floats, offset: Floats, coefficients: Floats, region: Ints, ritz: Ritz) -> float:
    # The same for curved elements, with midside offsets (3, 6, m) in the order of scikit-fem.
    # Laws are evaluated for all points at once.
    total, found = 0.0, list[tuple[Floats, Floats, Ints]]()
    for six, slopes, functions, source, rows in at_curved_points(corners, offset, region, ritz):
        own = coefficients[:, rows]
        found.append((six, np.einsum("dkm,km->dm", slopes, own), region[rows]))
        total -= float(np.sum(six * source * (functions @ own)))
    weights, slope, regions = (np.concatenate(each, axis=-1) for each in zip(*found, strict=True))
    return total + float(np.sum(weights * density_in_space(slope, regions, ritz)))


def at_curved_points(
    corners: Floats, offset: Floats, region: Ints, ritz: Ritz
) -> Iterator[tuple[Floats, Floats, Floats, Floats, Ints]]:
    # Yield weights (k,), slopes (3, 10, k), functions (10,) and sources (k,) at a point of elements, and the elements.
    linear, of_linear = CURVED_RULE_IN_SPACE
    for rows, points, weights in rules(region, ritz, (linear, of_linear / 6.0)):
        for at, weight in zip(points, weights, strict=True):
            own = tangent_corners(corners[:, :, rows], offset[:, :, rows], at[:, None])
            if callable(ritz.source):  # the mean of tangent corners and corners gives the position
                x = 0.5 * np.einsum("k,dkm->dm", at, own + corners[:, :, rows])
                source = source_at(x[:, None], region[rows], ritz.source)[0]
            else:
                source = value_by_region(np.asarray(ritz.source), region[rows]) * np.ones(rows.size)
            six = weight * np.abs(TETRAHEDRON.determinant(own))
            yield six, function_slopes(own, at), hierarchical(at[None], 2)[0][:, 0], source, rows


def fields_at_corners(corners: Floats, coefficients: Floats) -> Floats:
    # Return the gradients of functions, shape (4, 3, m).
    at = [function_slopes(corners, corner) for corner in np.eye(4)]
    return np.stack([np.einsum("dkm,km->dm", slopes, coefficients) for slopes in at])


def rules(
    region: Ints, ritz: Ritz, linear: tuple[Floats, Floats] | None = None
) -> Iterator[tuple[Ints, Floats, Floats]]:
    # Yield elements without a law, then with a law, with their points (q, 4) and weights (q,).
    nonlinear = np.array([law is not None for law in ritz.laws] or [False])
    has_law = nonlinear[region] if ritz.laws else np.zeros(len(region), dtype=np.bool_)
    for with_law, rule in ((False, linear or rule_of(OF_SLOPES)), (True, (LAW_POINTS, LAW_WEIGHTS / 6.0))):
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
    for barycentric, weight in zip(*rule_of(OF_SOURCE_2), strict=True):
        x = np.einsum("k,dkm->dm", barycentric, corners)[:, None]
        loads += weight * hierarchical(barycentric[None], 2)[0] * source_at(x, region, ritz.source)[0]
    return loads * six


def rule_of(degree: int) -> tuple[Floats, Floats]:
    at, weight = get_quadrature(ElementTetP1, degree)
    return np.vstack([1.0 - at.sum(axis=0), at]).T, weight
