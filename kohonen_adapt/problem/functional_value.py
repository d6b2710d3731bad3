"""Value of a Ritz functional on any mesh."""

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from skfem import ElementTriP1, Mesh, MeshTet, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.triangle.arrays import Points, Reference
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.curved import is_second_order, midside_offsets
from kohonen_adapt.mesh.functions import hierarchical, kinds_at_axis
from kohonen_adapt.mesh.measures import CurvedTetrahedra, inner_points
from kohonen_adapt.mesh.polynomials import (
    by_points,
    exact_reference,
    fields_at,
    gradients,
    joined_reference,
    law_reference,
    local_coefficients,
    modes_of,
)
from kohonen_adapt.problem.boundary_terms import (
    nodal_terms,
    robin_value,
    sides_of_boundary,
    surface_work,
)
from kohonen_adapt.problem.functional_in_space import coefficients_in_space, value_in_space, value_of_order_2
from kohonen_adapt.problem.ritz import Ritz, check_matches, parts_of, plane_only_term
from kohonen_adapt.problem.tables import flux_at, flux_table, source_at, value_by_region

__all__ = [
    "elements_by_rule",
    "flux_on",
    "functional_value",
    "parts_of_element",
    "reference_of",
    "source_on",
    "source_points",
    "value_on",
]


LOWER = 3  # as `degree` of `source_points`, of a second rule
AGREEMENT = 1e-4  # difference of two rules relative to the magnitude, above which elements are integrated in parts
HALVINGS = (1, 2)  # of the edges of these elements; the second where the first differs by as much, a fifth of them
ROWS = 2_000  # elements at once, to limit the memory


def reference_of(ritz: Ritz) -> Reference:
    return joined_reference(ritz.order) if any(ritz.laws) else exact_reference(ritz.order)


def elements_by_rule(kind: Ints, region: Ints, ritz: Ritz) -> Iterator[tuple[int, bool, Ints]]:
    nonlinear = np.zeros(len(region), dtype=np.bool_)
    if ritz.laws and (ritz.order > 1 or ritz.axisymmetric):  # otherwise gradients are constant, and one point suffices
        nonlinear = np.array([law is not None for law in ritz.laws])[region]
    for one_kind in np.unique(kind):
        for law in (False, True):
            rows = np.flatnonzero((kind == one_kind) & (nonlinear == law))
            if rows.size:
                yield int(one_kind), law, rows


def value_of_part(mesh: MeshTri, ritz: Ritz) -> float:
    check_matches(ritz, mesh)
    region = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
    values, node = np.asarray(ritz.values), mesh.t.T
    kind = kinds_at_axis(mesh.p[0, node]) if ritz.axisymmetric else None
    modes = None if ritz.order == 1 else modes_of(mesh, node, values, ritz.order, kind=kind)
    corners, coefficients = mesh.p.T[node], local_coefficients(values[node], modes)
    offsets = midside_offsets(mesh) if is_second_order(mesh) else None
    total = value_on(corners, coefficients, region, ritz, offsets)
    for name, terms in ritz.robin.items():
        sides = sides_of_boundary(mesh, name)
        total += robin_value(corners, coefficients, sides, terms, ritz.axisymmetric, offsets)
    return total


def value_on(corners: Floats, coefficients: Floats, region: Ints, ritz: Ritz, offsets: Floats | None = None) -> float:
    """Return the functional on triangles with corners (m, 3, 2).

    `coefficients` has shape (m, functions), `region` contains region numbers (m,), and `offsets` midside offsets
    (m, 3, 2). Elements with curved sides or around an axis are integrated by the rules of `by_points`.
    """
    offsets = np.zeros_like(corners) if offsets is None else offsets
    special = np.any(offsets != 0.0, axis=(1, 2)) | ritz.axisymmetric
    kind = np.where(special, kinds_at_axis(corners[:, :, 0]) if ritz.axisymmetric else 0, -1)
    total = 0.0
    for one_kind, nonlinear, rows in elements_by_rule(kind, region, ritz):
        args = corners[rows], coefficients[rows], region[rows], ritz
        if one_kind < 0:
            total += _straight_value(*args, law_reference(ritz.order) if nonlinear else exact_reference(ritz.order))
        else:
            total += _value_by_points(*args, offsets[rows], one_kind, by_points(ritz.order, nonlinear))
    return total


def _straight_value(corners: Floats, coefficients: Floats, region: Ints, ritz: Ritz, at: Reference) -> float:
    doubled_area, slope = gradients(corners, coefficients, at)
    density = at.weight @ _density(slope, 1.0, corners, region, ritz)
    if callable(ritz.source):
        source_term = _varying_source_term(corners, coefficients, region, ritz.source, ritz.order)
    else:
        source_term = 2.0 * value_by_region(np.asarray(ritz.source), region) * (coefficients @ at.mean)
    return 0.5 * float(np.sum(np.abs(doubled_area) * (density - source_term)))


def _varying_source_term(
    corners: Floats, coefficients: Floats, region: Ints, function: Callable[[Floats, Ints], ArrayLike], order: int
) -> Floats:
    # Mean of source times function, (m,). Elements in which a rule of lower degree disagrees are integrated in parts,
    # because passes and sweeps differ by less than the rule misses in a layer.
    def mean(rule: tuple[Floats, Floats], rows: Ints | slice) -> tuple[Floats, Floats]:
        barycentric, weight = rule
        source = source_at(barycentric @ corners[rows].transpose(2, 1, 0), region[rows], function)
        product = source * (hierarchical(barycentric, order)[0].T @ coefficients[rows].T)
        return weight @ product, weight @ np.abs(product)

    every = slice(None)
    total, magnitude = mean(source_points(order), every)
    lower, _ = mean(source_points(order, LOWER), every)
    doubtful = np.flatnonzero(np.abs(total - lower) > AGREEMENT * magnitude)
    for halvings in HALVINGS:
        before = total[doubtful]
        for first in range(0, len(doubtful), ROWS):
            rows = doubtful[first : first + ROWS]
            total[rows], _ = mean(points_in_parts(order, halvings), rows)
        doubtful = doubtful[np.abs(total[doubtful] - before) > AGREEMENT * magnitude[doubtful]]
    return total


def _value_by_points(
    corners: Floats, coefficients: Floats, region: Ints, ritz: Ritz, offsets: Floats, kind: int, points: Points
) -> float:
    doubled_area, x, value, slope = fields_at(points, kind, corners, offsets, coefficients)
    density = _density(slope, x if ritz.axisymmetric else 1.0, corners, region, ritz)
    density -= source_on(points, kind, corners, offsets, region, ritz) * value
    return 0.5 * float(np.sum(points.weight[kind] @ (np.abs(doubled_area) * density)))


def _density(slope: Floats, x: Floats | float, corners: Floats, region: Ints, ritz: Ritz) -> Floats:
    """Return the integrand without the source for gradients (2, points, m).

    Around an axis `x` contains the distances of the points from the axis.
    """
    flux_x, flux_y = flux_on(corners, region, ritz)
    stored = 0.5 * value_by_region(np.asarray(ritz.coefficient), region) * np.sum(slope**2, axis=0) / x
    distance = np.broadcast_to(x, stored.shape)
    for k, law in enumerate(ritz.laws):
        if law is not None:
            rows = region == k
            stored[:, rows] = distance[:, rows] * law.energy(np.hypot(*slope[:, :, rows]) / distance[:, rows])
    return stored - flux_x * slope[0] - flux_y * slope[1]


def flux_on(corners: Floats, region: Ints, ritz: Ritz) -> Floats:
    if callable(ritz.flux):
        return flux_at(inner_points(corners.transpose(2, 1, 0)), region, ritz.flux).mean(axis=1)
    return np.stack([value_by_region(part, region) for part in flux_table(np.asarray(ritz.flux), 2)])


@cache
def source_points(order: int, degree: int = 4) -> tuple[Floats, Floats]:
    """Return barycentric coordinates (points, 3) and weights for a source.

    The sum of the weights is 1. The rule is exact for a source that is a polynomial of degree ``order + degree``.
    """
    points, weight = get_quadrature(ElementTriP1, 2 * order + degree)
    return np.stack([1.0 - points.sum(axis=0), *points], axis=1), 2.0 * weight


@cache
def parts_of_element(dim: int, halvings: int = 1) -> Floats:
    # barycentric coordinates of the corners of equal parts, (parts, dim + 1, dim + 1)
    parts = {2: MeshTri, 3: MeshTet}[dim].init_refdom().refined(halvings)
    return np.vstack([1.0 - parts.p.sum(axis=0), parts.p]).T[parts.t.T]


@cache
def points_in_parts(order: int, halvings: int) -> tuple[Floats, Floats]:
    barycentric, weight = source_points(order)
    corners = parts_of_element(2, halvings)
    return (barycentric @ corners).reshape(-1, 3), np.tile(weight / len(corners), len(corners))


def source_on(points: Points, kind: int, corners: Floats, offsets: Floats, region: Ints, ritz: Ritz) -> Floats:
    """Return the source of curved elements at their quadrature points, (points, m).

    All elements have the same `kind`. Their points x are the sum of barycentric coordinates times `corners` and of
    quadratic side functions times midside `offsets`, both (m, 3, 2). A source that is constant by region is returned as
    one value per element, shape (m,).
    """
    if not callable(ritz.source):
        return value_by_region(np.asarray(ritz.source), region)
    x = np.einsum("qk,mkd->dqm", points.share[kind], corners)
    x += np.einsum("qk,mkd->dqm", points.side[kind, :, :, 0], offsets)
    return source_at(x, region, ritz.source)


def functional_value(mesh: Mesh, ritz: Ritz) -> float:
    if mesh.dim() == TETRAHEDRON.dim:
        if plane_only_term(ritz):
            raise ValueError(f"Ritz cannot be evaluated on tetrahedra: {plane_only_term(ritz)}.")
        check_matches(ritz, mesh)
        region = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
        corners, (_, coefficients) = mesh.p[:, mesh.t], coefficients_in_space(mesh, ritz, region)
        work = surface_work(np.asarray(ritz.values), nodal_terms(ritz.surface))
        if ritz.order == 1:
            return value_in_space(corners, coefficients, region, ritz) - work
        offset = CurvedTetrahedra(mesh).offset
        return value_of_order_2(corners, offset, coefficients, mesh.t, region, ritz) - work
    return sum(value_of_part(mesh, part) for part in parts_of(ritz))
