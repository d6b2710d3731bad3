"""Check that a Ritz functional is stationary at the discrete solution."""

from typing import NamedTuple

import numpy as np
from skfem import Mesh, MeshTet

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.checks import listed, point_text
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD
from kohonen_adapt.mesh.cells import corner_positions
from kohonen_adapt.mesh.elements.polynomials import hierarchical_loads, unknowns_of_elements
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.polishing.unresolved_data import Doubt, UnresolvedData, doubt_about
from kohonen_adapt.problem.boundary_terms import nodal_terms
from kohonen_adapt.problem.functional_value import (
    coefficients_on,
    energy_on,
    functions_on,
    in_blocks,
    loads_on,
    offsets_on,
)
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import numbers_of

__all__ = ["check_in_space", "check_residual", "derivatives_on", "doubts_of", "sums"]

# Largest residual relative to the terms at an unknown, and relative to the largest terms anywhere. Linear solvers with
# relative tolerance 1e-5 leave 1e-6 of the largest, Newton's method less. Missing terms are as large as present terms.
OF_TERMS = 0.01
OF_LARGEST = 1e-3


class Derivatives(NamedTuple):
    """Element residuals of local basis functions phi, shape (k, m).

    A residual is ``int H . grad phi - flux . grad phi - source phi`` over the element, where H is the derivative of the
    energy density by the gradient. The sum of the residuals over the elements is the derivative of the functional by
    the coefficient of phi.
    """

    total: Floats
    size: Floats  # sum of the magnitudes of the terms


def derivatives_on(
    corners: Floats, coefficients: Floats, number: Ints, ritz: Ritz, offset: Floats | None
) -> Derivatives:
    # arguments as of `value_on`
    found = Derivatives(*np.zeros((2, *coefficients.shape)))
    for rows in in_blocks(coefficients):
        functions = functions_on(corners, number, ritz, offset, rows)
        loads = loads_on(functions, number[rows], ritz)
        energy = energy_on(functions, number[rows], ritz, np.add(*loads))
        stored = functions.against_gradients(energy.flux(coefficients[:, rows]))
        found.total[:, rows], found.size[:, rows] = stored - energy.load, np.abs(stored) + sum(map(np.abs, loads))
    return found


def check_in_space(ritz: Ritz, mesh: MeshTet) -> None:
    number, nodal, fixed = numbers_of(ritz, mesh), nodal_terms(ritz.surface), np.asarray(ritz.fixed)
    unknowns = mesh.t
    place = mesh.p.T[: mesh.nvertices]
    if ritz.order > 1:
        unknowns = unknowns_of_elements(mesh, mesh.t)
        middle = mesh.p[:, mesh.edges].mean(axis=1).T
        place = np.vstack([place, middle])
    corners, coefficients = corner_positions(mesh), coefficients_on(mesh, ritz, number)
    parts = derivatives_on(corners, coefficients, number, ritz, offsets_on(mesh, ritz))
    total, size = sums(parts, unknowns, len(fixed))
    if len(nodal):
        load = nodal[:, LOAD] if ritz.order == 1 else hierarchical_loads(mesh, nodal[:, LOAD])
        total, size = total - load, size + np.abs(load)
    check_residual(total, size, ~fixed, place, mesh, doubts_of(ritz, mesh, unknowns, len(fixed)))


def doubts_of(ritz: Ritz, mesh: Mesh, index: Ints, count: int) -> Doubt:
    # `index` (k, m) has the unknowns of every element. The doubts of elements are added for every unknown.
    found = doubt_about(corner_positions(mesh), numbers_of(ritz, mesh), ritz)
    doubt = np.tile(found.residual, len(index))
    return found._replace(residual=np.bincount(index.ravel(), doubt, count).astype(np.float64))


def sums(parts: Derivatives, index: Ints, count: int) -> FloatsPair:
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
