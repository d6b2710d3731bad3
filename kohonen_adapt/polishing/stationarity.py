"""Check that a Ritz functional is stationary at the discrete solution."""

from typing import NamedTuple

import numpy as np
from skfem import Mesh, MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed, point_text
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD
from kohonen_adapt.kernels.triangle.arrays import Points
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.functions import corner_slopes, hierarchical, kinds_at_axis
from kohonen_adapt.mesh.measures import CurvedTetrahedra
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.mesh.polynomials import (
    by_points,
    exact_reference,
    function_slopes,
    hierarchical_loads,
    law_reference,
)
from kohonen_adapt.polishing.unresolved_data import Doubt, UnresolvedData, doubt_about
from kohonen_adapt.problem.boundary_terms import nodal_terms
from kohonen_adapt.problem.functional_in_space import (
    at_curved_points,
    coefficients_in_space,
    fields_at_corners,
    fluxes,
    loads_in_space,
    quadratic_loads,
    rules,
    secants,
    shifted_slope,
)
from kohonen_adapt.problem.functional_value import elements_by_rule, flux_on, source_on, source_points
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_table, source_at, value_by_region

__all__ = ["check_in_space", "check_residual", "derivatives_on", "doubts_of", "numbers_of", "sums"]

ROWS = 20_000  # elements per block, to limit the memory

# Largest residual relative to the terms at an unknown, and relative to the largest terms anywhere. Linear solvers with
# relative tolerance 1e-5 leave 1e-6 of the largest, Newton's method less. Missing terms are as large as present terms.
OF_TERMS = 0.01
OF_LARGEST = 1e-3


class Derivatives(NamedTuple):
    """Element residuals of local basis functions phi, shape (m, functions).

    A residual is ``int H . grad phi - flux . grad phi - source phi`` over the element. H is ``coefficient grad u``, or
    with a law ``H(|grad u|) grad u / |grad u|``. The sum of the residuals over the elements is the derivative of the
    functional by the coefficient of phi.
    """

    total: Floats
    size: Floats  # sum of the magnitudes of the terms


def derivatives_on(corners: Floats, coefficients: Floats, region: Ints, ritz: Ritz, offsets: Floats) -> Derivatives:
    # `corners` and the midside `offsets` have shape (m, 3, 2).
    derivatives = Derivatives(*np.zeros((2, *coefficients.shape)))
    kind = kinds_at_axis(corners[:, :, 0]) if ritz.axisymmetric else np.where(np.any(offsets, axis=(1, 2)), 0, -1)
    for one_kind, nonlinear, rows in elements_by_rule(kind, region, ritz):
        for block in np.split(rows, range(ROWS, len(rows), ROWS)):
            values_of_block = _derivatives_of_kind(
                corners[block], coefficients[block], region[block], ritz, offsets[block], one_kind, nonlinear
            )
            for array, values in zip(derivatives, values_of_block, strict=True):
                array[block] = values
    return derivatives


def _derivatives_of_kind(
    corners: Floats, coefficients: Floats, region: Ints, ritz: Ritz, offsets: Floats, kind: int, nonlinear: bool
) -> tuple[Floats, Floats]:
    points = by_points(ritz.order, nonlinear)
    at = law_reference(ritz.order) if nonlinear else exact_reference(ritz.order)
    weight, slope = (at.weight, at.slope) if kind < 0 else (points.weight[kind], points.slope[kind])
    columns, x = np.einsum("id,mic->dcm", corner_slopes(2), corners)[:, :, None], np.ones(())
    if kind >= 0:
        side = points.side[kind]
        columns = columns + np.einsum("qkd,mkc->dcqm", side[:, :, 1:], offsets)
        if ritz.axisymmetric:
            x = points.share[kind] @ corners[:, :, 0].T + side[:, :, 0] @ offsets[:, :, 0].T
    (ax, ay), (bx, by) = columns
    doubled_area = ax * by - ay * bx

    def tested(x: Floats, y: Floats) -> Floats:
        rotated = np.stack([by * x - bx * y, ax * y - ay * x])
        return 0.5 * np.einsum("q,dqm,qid->mi", weight, np.sign(doubled_area) * rotated, slope)

    along, aside = np.einsum("qid,mi->dqm", slope, coefficients)
    gradient = np.stack([by * along - ay * aside, ax * aside - bx * along]) / doubled_area
    energy_term = tested(*(secants(gradient, x, region, ritz) * gradient))
    ones = np.ones_like(along)
    flux_term = tested(*(flux_on(corners, region, ritz).reshape(2, 1, -1) * ones))
    if callable(ritz.source):
        source_term = loads(corners, offsets, region, ritz, kind, points, doubled_area)
    else:
        if kind < 0:
            mean = np.abs(doubled_area[0])[:, None] * at.mean
        else:
            mean = 0.5 * (weight[:, None] * np.abs(doubled_area)).T @ points.value[kind]
        source_term = np.reshape(value_by_region(np.asarray(ritz.source), region), (-1, 1)) * mean
    size = np.abs(energy_term) + np.abs(flux_term) + np.abs(source_term)
    return energy_term - flux_term - source_term, size


def loads(
    corners: Floats, offsets: Floats, region: Ints, ritz: Ritz, kind: int, points: Points, doubled_area: Floats
) -> Floats:
    if kind < 0 and callable(ritz.source):
        barycentric, weight = source_points(ritz.order)
        source = source_at(np.einsum("qk,mkd->dqm", barycentric, corners), region, ritz.source)
        value = hierarchical(barycentric, ritz.order)[0].T
    else:
        source, weight, value = (
            source_on(points, kind, corners, offsets, region, ritz),
            points.weight[kind],
            points.value[kind],
        )
    return 0.5 * (weight[:, None] * np.abs(doubled_area) * source).T @ value


def derivatives_in_space(corners: Floats, values: Floats, region: Ints, ritz: Ritz) -> Derivatives:
    # `corners` has shape (3, 4, m), and the nodal `values` have shape (4, m).
    hats, volume = TETRAHEDRON.hat_gradients(corners), np.abs(TETRAHEDRON.determinant(corners)) / 6.0
    gradient = np.einsum("dkm,km->dm", hats, values)
    gradient = shifted_slope(gradient, region, ritz)
    field = secants(gradient[:, None], np.ones(()), region, ritz)[0] * gradient
    table = flux_table(np.asarray(ritz.flux), 3)
    flux = np.stack([value_by_region(component, region) * np.ones_like(volume) for component in table])
    energy_term, flux_term = (volume * np.einsum("dkm,dm->km", hats, part) for part in (field, flux))
    if callable(ritz.source):
        source_term = loads_in_space(corners, region, ritz.source)
    else:
        source = value_by_region(np.asarray(ritz.source), region)
        source_term = np.broadcast_to(source * volume / 4.0, energy_term.shape)
    size = np.abs(energy_term) + np.abs(flux_term) + np.abs(source_term)
    return Derivatives((energy_term - flux_term - source_term).T, size.T)


def curved_derivatives(corners: Floats, offset: Floats, coefficients: Floats, region: Ints, ritz: Ritz) -> Derivatives:
    # as `quadratic_derivatives`, with midside offsets (3, 6, m) in the order of scikit-fem
    total, size = np.zeros((2, *coefficients.shape))
    for six, slopes, functions, source, rows in at_curved_points(corners, offset, region, ritz):
        slope = np.einsum("dkm,km->dm", slopes, coefficients[:, rows])
        own = shifted_slope(slope, region[rows], ritz)
        terms = (
            six * np.einsum("dkm,dm->km", slopes, secants(own[:, None], np.ones(()), region[rows], ritz)[0] * own),
            six * np.einsum("dkm,dm->km", slopes, fluxes(region[rows], ritz)),
            functions[:, None] * (six * source),
        )
        total[:, rows] += terms[0] - terms[1] - terms[2]
        size[:, rows] += sum(map(np.abs, terms))
    return Derivatives(total.T, size.T)


def quadratic_derivatives(corners: Floats, coefficients: Floats, region: Ints, ritz: Ritz) -> Derivatives:
    """Return the element residuals of functions of order 2 on tetrahedra, (m, 10).

    `corners` has shape (3, 4, m), and `coefficients` has shape (10, m).
    """
    six, fields = np.abs(TETRAHEDRON.determinant(corners)), fields_at_corners(corners, coefficients)
    moments, flux = np.zeros_like(fields), fluxes(region, ritz)
    for rows, barycentric, weight in rules(region, ritz):
        slope = np.einsum("qk,kdm->dqm", barycentric, fields[:, :, rows])
        own = shifted_slope(slope.reshape(3, -1), np.tile(region[rows], len(weight)), ritz).reshape(slope.shape)
        strength = secants(own, np.ones(()), region[rows], ritz) * own
        moments[:, :, rows] = six[rows] * np.einsum("q,qk,dqm->kdm", weight, barycentric, strength)
    energy_term, flux_term = np.zeros((2, *coefficients.shape))
    for corner, moment in zip(np.eye(4), moments, strict=True):
        slopes = function_slopes(corners, corner)
        energy_term += np.einsum("dkm,dm->km", slopes, moment)
        flux_term += np.einsum("dkm,dm->km", slopes, six / 24.0 * flux)
    source_term = quadratic_loads(corners, region, ritz)
    size = np.abs(energy_term) + np.abs(flux_term) + np.abs(source_term)
    return Derivatives((energy_term - flux_term - source_term).T, size.T)


def check_in_space(ritz: Ritz, mesh: MeshTet) -> None:
    number, nodal = numbers_of(ritz, mesh.t.shape[1]), nodal_terms(ritz.surface)
    unknowns, coefficients = coefficients_in_space(mesh, ritz, number)
    if ritz.order == 1:
        parts, place = derivatives_in_space(mesh.p[:, mesh.t], coefficients, number, ritz), mesh.p.T
    else:
        parts = derivatives_of_order_2(mesh, coefficients, number, ritz)
        place = np.vstack([mesh.p.T[: mesh.nvertices], mesh.p[:, mesh.edges].mean(axis=1).T])
    fixed = np.asarray(ritz.fixed)
    total, size = sums(parts, unknowns.T, len(fixed))
    if len(nodal):
        load = nodal[:, LOAD] if ritz.order == 1 else hierarchical_loads(mesh, nodal[:, LOAD])
        total, size = total - load, size + np.abs(load)
    check_residual(total, size, ~fixed, place, mesh, doubts_of(ritz, mesh, unknowns.T, len(fixed)))


def doubts_of(ritz: Ritz, mesh: Mesh, index: Ints, count: int) -> Doubt:
    # `index` (m, functions) has the unknowns of every element. The doubts of elements are added for every unknown.
    found = doubt_about(mesh.p[:, mesh.t], numbers_of(ritz, mesh.t.shape[1]), ritz)
    doubt = np.repeat(found.residual, index.shape[1])
    return found._replace(residual=np.bincount(index.ravel(), doubt, count).astype(np.float64))


def derivatives_of_order_2(mesh: MeshTet, coefficients: Floats, number: Ints, ritz: Ritz) -> Derivatives:
    corners, shape = mesh.p[:, mesh.t], CurvedTetrahedra(mesh)
    parts, rows = quadratic_derivatives(corners, coefficients, number, ritz), np.flatnonzero(shape.curved)
    own = curved_derivatives(corners[:, :, rows], shape.offset[:, :, rows], coefficients[:, rows], number[rows], ritz)
    for straight, curved in zip(parts, own, strict=True):
        straight[rows] = curved
    return parts


def numbers_of(ritz: Ritz, count: int) -> Ints:
    return np.zeros(count, dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)


def sums(parts: Derivatives, index: Ints, count: int) -> tuple[Floats, Floats]:
    total, size = (np.bincount(index.ravel(), part.ravel(), count).astype(np.float64) for part in parts)
    return total, size


def check_residual(total: Floats, size: Floats, free: Mask, place: Floats, mesh: Mesh, doubt: Doubt) -> None:
    allowed = OF_TERMS * size + OF_LARGEST * size.max(initial=0.0) + doubt.residual
    excess = np.where(free, np.abs(total) - allowed, -np.inf)
    wrong = int(np.count_nonzero(excess > 0.0))
    if not wrong:
        if doubt.oscillation:
            raise UnresolvedData(doubt)
        return
    worst = int(np.argmax(excess))
    raise ValueError(
        f"the solution is not stationary for its Ritz: at {location(mesh, place[worst])} the residual is "
        f"{100.0 * abs(total[worst]) / size[worst]:.2g} % of the terms in its sum (tolerance about "
        f"{100.0 * OF_TERMS:g} %), and too large at {wrong} of "
        f"{np.count_nonzero(free)} free unknowns. Give Ritz every term of the equation (robin, source, flux, fixed "
        "values), or solve more accurately."
    )


def location(mesh: Mesh, x: Floats) -> str:
    corners = mesh.p[:, : mesh.nvertices]
    node = int(np.argmin(np.sum((corners - x[:, None]) ** 2, axis=0)))
    at = point_text(x)
    sets = named_sets(mesh.boundaries)
    names = [name for name, facets in sets.items() if np.any(mesh.facets[:, facets] == node)]
    if names:
        return f"{at} on boundary {listed(names)}"
    near = np.flatnonzero(np.any(mesh.t == node, axis=0))
    names = [name for name, rows in named_sets(mesh.subdomains).items() if np.isin(near, rows).any()]
    return f"{at} in subdomain {listed(names)}" if names else at
