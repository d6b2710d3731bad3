"""Ritz functionals on elements, and their value on any mesh."""

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTet, MeshTri

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.mesh.cells import TETRAHEDRON, corner_positions
from kohonen_adapt.mesh.curved import is_second_order, midside_offsets
from kohonen_adapt.mesh.elements.element_functions import ElementFunctions
from kohonen_adapt.mesh.elements.functions import hierarchical, kinds_at_axis
from kohonen_adapt.mesh.elements.groups import Group
from kohonen_adapt.mesh.elements.polynomials import (
    edge_coefficients,
    local_coefficients,
    modes_of,
    unknowns_of_elements,
)
from kohonen_adapt.mesh.elements.rules import Rule, tabled_rule, triangle_rule
from kohonen_adapt.mesh.measures import inner_points, magnitude
from kohonen_adapt.problem.boundary_terms import (
    corner_values,
    nodal_terms,
    reduced_regions,
    robin_value,
    sides_of_boundary,
    surface_work,
)
from kohonen_adapt.problem.energy import Densities, Energy
from kohonen_adapt.problem.ritz import Ritz, check_matches, parts_of, plane_only_term
from kohonen_adapt.problem.tables import constants_at, flux_at, numbers_of, source_at

__all__ = [
    "coefficients_on",
    "densities_of",
    "energy_on",
    "functional_value",
    "functions_on",
    "has_law",
    "in_blocks",
    "integrand",
    "loads_on",
    "offsets_on",
    "parts_of_element",
    "source_loads",
    "source_rule",
    "steepest",
    "value_on",
]

Source = Callable[[Floats, Ints], ArrayLike]

LOWER = 3  # as `degree` of `source_rule`, of a second rule
AGREEMENT = 1e-4  # difference of two rules relative to the magnitude, above which elements are integrated in parts
HALVINGS = (1, 2)  # of the edges of these elements; the second where the first differs by as much, a fifth of them
IN_PARTS, BLOCK = 2_000, 1 << 15  # elements, and coefficients of elements, at once, to limit the memory
IN_SPACE = {1: 7, 2: 8}  # degree of the rule of a source, by order; the rule of degree 6 has points on faces


def functional_value(mesh: Mesh, ritz: Ritz) -> float:
    if mesh.dim() == TETRAHEDRON.dim and plane_only_term(ritz):
        raise ValueError(f"Ritz cannot be evaluated on tetrahedra: {plane_only_term(ritz)}.")
    total = 0.0
    for part in parts_of(ritz):
        check_matches(part, mesh)
        number, corners = numbers_of(part, mesh), corner_positions(mesh)
        coefficients, offset = coefficients_on(mesh, part, number), offsets_on(mesh, part)
        total += value_on(corners, coefficients, number, part, offset)
        for name, terms in part.robin.items():
            sides = sides_of_boundary(mesh, name)
            total += robin_value(corners, coefficients, sides, terms, part.axisymmetric, offset)
        total -= surface_work(np.asarray(part.values), nodal_terms(part.surface))
    return total


def offsets_on(mesh: Mesh, ritz: Ritz) -> Floats | None:
    # midside offsets as of `ElementFunctions`; tetrahedra of order 1 have straight edges
    if not is_second_order(mesh) or (mesh.dim() == TETRAHEDRON.dim and ritz.order == 1):
        return None
    return midside_offsets(mesh)


def coefficients_on(mesh: Mesh, ritz: Ritz, number: Ints) -> Floats:
    """Return the hierarchical coefficients of a solution, (k, m)."""
    values = np.asarray(ritz.values)
    if mesh.dim() == TETRAHEDRON.dim:
        unknowns = mesh.t if ritz.order == 1 else unknowns_of_elements(mesh, mesh.t)
        local = corner_values(values, nodal_terms(ritz.surface), unknowns, reduced_regions(ritz.surface, number))
        return local if ritz.order == 1 else edge_coefficients(local)
    node = mesh.t.T
    kind = kinds_at_axis(mesh.p[0, node]) if ritz.axisymmetric else None
    modes = None if ritz.order == 1 else modes_of(mesh, node, values, ritz.order, kind=kind)
    return local_coefficients(values[node], modes).T


def value_on(corners: Floats, coefficients: Floats, number: Ints, ritz: Ritz, offset: Floats | None = None) -> float:
    """Return the functional on elements without its terms on boundaries.

    `coefficients` has shape (k, m), and `number` contains region numbers (m,). `corners` and the midside offsets
    `offset` are those of `ElementFunctions`.
    """
    total = 0.0
    for rows in in_blocks(coefficients):
        functions, own = functions_on(corners, number, ritz, offset, rows), coefficients[:, rows]
        load = np.add(*loads_on(functions, number[rows], ritz, own))
        total += energy_on(functions, number[rows], ritz, load).value(own)[0]
    return total


def in_blocks(coefficients: Floats) -> Iterator[slice]:
    functions, count = coefficients.shape
    size = BLOCK // functions
    return (slice(first, first + size) for first in range(0, count, size))


def functions_on(
    corners: Floats, number: Ints, ritz: Ritz, offset: Floats | None, rows: slice = slice(None)
) -> ElementFunctions:
    offset = None if offset is None else offset[:, :, rows]
    return ElementFunctions(corners[:, :, rows], ritz.order, has_law(ritz, number[rows]), offset, ritz.axisymmetric)


def has_law(ritz: Ritz, number: Ints) -> Mask:
    if not ritz.laws:
        return np.zeros(np.shape(number), bool)
    return np.array([law is not None for law in ritz.laws])[number]


def energy_on(functions: ElementFunctions, number: Ints, ritz: Ritz, load: Floats) -> Energy:
    """Return the functional of coefficients (k, m) with a load (k, m)."""
    at = number[functions.element]
    x = functions.points[0] if ritz.axisymmetric else 1.0
    shift = constants_at(ritz.shift, at, functions.dim) if any(ritz.laws) and np.any(ritz.shift) else None
    given = None if shift is None else -np.where(has_law(ritz, at), shift, 0.0)
    return Energy(functions, densities_of(ritz, at, functions.weights, x), load, given=given)


def steepest(mesh: Mesh, ritz: Ritz) -> float:
    """Return the largest argument of the energy densities of a solution."""
    number = numbers_of(ritz, mesh)
    functions = functions_on(corner_positions(mesh), number, ritz, None)
    size = magnitude(energy_on(functions, number, ritz, np.zeros(())).vector(coefficients_on(mesh, ritz, number)))
    return float(np.max(size / functions.points[0] if ritz.axisymmetric else size, initial=0.0))


def densities_of(ritz: Ritz, number: Ints, weights: Floats | float = 1.0, x: Floats | float = 1.0) -> Densities:
    """Return the energy densities of a `Ritz` at points of regions (n,)."""
    laws = [(law, np.flatnonzero(number == k)) for k, law in enumerate(ritz.laws) if law is not None]
    return Densities(weights, constants_at(ritz.coefficient, number), laws, x)


def integrand(slope: Floats, number: Ints, ritz: Ritz) -> FloatsPair:
    """Return the integrand without the source, and its derivatives.

    Gradients `slope` and the derivatives by gradients have shape (3, n).
    """
    densities, flux = densities_of(ritz, number), constants_at(ritz.flux, number, len(slope))
    own = slope - np.where(has_law(ritz, number), constants_at(ritz.shift, number, len(slope)), 0.0)
    size = magnitude(own)
    return densities.density(size) - np.sum(flux * slope, axis=0), densities.secant(size) * own - flux


def loads_on(functions: ElementFunctions, number: Ints, ritz: Ritz, coefficients: Floats | None = None) -> FloatsPair:
    """Return the integrals of source and flux against the functions, (k, m).

    A flux that is a function has its mean over three points of an element. A source that is a function is integrated in
    parts of elements in which rules disagree about the work of `coefficients`, unless these are None.
    """
    of_flux = np.zeros(())
    if callable(ritz.flux):
        flux = flux_at(inner_points(functions.corners), number, ritz.flux).mean(axis=1)
        of_flux = functions.against_gradients(flux[:, functions.element])
    elif np.any(ritz.flux):
        of_flux = functions.against_gradients(constants_at(ritz.flux, number[functions.element], functions.dim))
    if not callable(ritz.source):
        return functions.integrals * constants_at(ritz.source, number), of_flux
    return source_loads(functions, number, ritz.source, coefficients), of_flux


def source_loads(
    functions: ElementFunctions, number: Ints, source: Source, coefficients: Floats | None = None
) -> Floats:
    """Return the integrals of a source that is a function, as in `loads_on`."""

    def of_group(group: Group) -> Floats:
        own, form = number[group.rows], group.at.form
        if form.curved or form.axis:
            return group.at.values @ (source_at(functions.points_of(group), own, source) * group.point_volumes)
        local = coefficients[:, group.rows] if coefficients is not None and form.dim == 2 else None
        corners, (volumes,) = functions.corners[:, :, group.rows], group.volumes
        return mean_loads(corners, volumes, own, source, form.order, local) * volumes

    return functions.by_element(of_group)


def mean_loads(
    corners: Floats, volumes: Floats, number: Ints, source: Source, order: int, coefficients: Floats | None
) -> Floats:
    # Elements in which a rule of lower degree disagrees are integrated in parts, because passes and sweeps differ by
    # less than the rule misses in a layer.
    dim = len(corners)

    def sampled(rule: Rule, rows: Ints | slice) -> FloatsPair:
        return hierarchical(rule[0], order)[0] * rule[1], source_at(rule[0] @ corners[:, :, rows], number[rows], source)

    functions, values = sampled(source_rule(order, dim), slice(None))
    loads = np.asarray(functions @ values)
    if coefficients is None:
        return loads
    magnitude = np.sum(np.abs(values * (functions.T @ coefficients)), axis=0)
    allowed = AGREEMENT * np.maximum(magnitude, np.mean(magnitude * volumes) / volumes)
    functions, values = sampled(source_rule(order, dim, LOWER), slice(None))
    doubtful = np.flatnonzero(np.abs(np.sum((loads - functions @ values) * coefficients, axis=0)) > allowed)
    for halvings in HALVINGS:
        before = loads[:, doubtful]
        for first in range(0, len(doubtful), IN_PARTS):
            rows = doubtful[first : first + IN_PARTS]
            functions, values = sampled(rule_in_parts(order, halvings), rows)
            loads[:, rows] = functions @ values
        change = np.sum((loads[:, doubtful] - before) * coefficients[:, doubtful], axis=0)
        doubtful = doubtful[np.abs(change) > allowed[doubtful]]
    return loads


@cache
def source_rule(order: int, dim: int, degree: int = 4) -> Rule:
    """Return barycentric coordinates (q, d + 1) and weights of a rule for a source.

    In the plane the rule is exact for a source that is a polynomial of degree ``order + degree``, in space of degree 6.
    """
    return triangle_rule(2 * order + degree) if dim == 2 else tabled_rule(3, IN_SPACE[order])


@cache
def parts_of_element(dim: int, halvings: int = 1) -> Floats:
    # barycentric coordinates of the corners of equal parts, (parts, dim + 1, dim + 1)
    parts = {2: MeshTri, 3: MeshTet}[dim].init_refdom().refined(halvings)
    return np.vstack([1.0 - parts.p.sum(axis=0), parts.p]).T[parts.t.T]


@cache
def rule_in_parts(order: int, halvings: int) -> Rule:
    barycentric, weight = source_rule(order, 2)
    corners = parts_of_element(2, halvings)
    return (barycentric @ corners).reshape(-1, 3), np.tile(weight / len(corners), len(corners))
