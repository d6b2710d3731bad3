"""Check that a Ritz functional is stationary at the discrete solution.

The derivative of the functional by an unknown is the residual of the discrete equation. The residual must be
small compared to the terms in its sum, or compared to the largest terms anywhere, as after an iterative
solver.
"""

import numpy as np
from skfem import Mesh, MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import listed, point_text
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.pairs import sliding_pairs
from kohonen_adapt.kernels.tetrahedron.arrays import LOAD
from kohonen_adapt.mesh.basis import trace_columns
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.names import named_sets
from kohonen_adapt.mesh.polynomials import TrialFunction, facets_of_sides, local_coefficients
from kohonen_adapt.mesh.quadratic_in_space import edges_of_elements, quadratic_coefficients
from kohonen_adapt.polishing.boundary import BoundaryTerms, sides_on
from kohonen_adapt.problem.derivatives import Derivatives, derivatives_in_space, derivatives_on, quadratic_derivatives
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.robin import facet_terms
from kohonen_adapt.problem.surface_terms import corner_values, nodal_terms, reduced_regions

__all__ = ["check_in_plane", "check_in_space"]

# Largest residual relative to the terms at an unknown, and relative to the largest terms anywhere. Linear solvers with
# relative tolerance 1e-5 leave 1e-6 of the largest, Newton's method less. Missing terms are as large as present terms.
OF_TERMS = 0.01
OF_LARGEST = 1e-3


def check_in_plane(
    ritz: Ritz, mesh: Mesh, movable: MovableMesh, solution: TrialFunction, boundary: BoundaryTerms, sign: Floats
) -> None:
    """Raise an error if the solution on triangles is not stationary.

    `sign` (c,) is `Functional.sign`.

    Raises
    ------
    ValueError
        With the largest residual and its location.
    """
    elements, values = movable.triangulation.elements, solution.values
    node, corners = elements.node, movable.triangulation.position[elements.node]
    coefficients, offsets = local_coefficients(values[node], solution.modes), movable.midside_offsets()
    parts = derivatives_on(corners, coefficients, numbers_of(ritz, len(node)), ritz, offsets)
    for name, chains in boundary.chains.items():
        e, k = sides_on(elements.chain, chains)
        ends, own = np.stack([corners[e, (k + 1) % 3], corners[e, (k + 2) % 3]], axis=1), trace_columns(k, ritz.order)
        matrix, load = facet_terms(ends, ritz.order, ritz.robin[name], ritz.axisymmetric, offsets[e, k])
        pulled = np.einsum("fij,fj->fi", matrix, coefficients[e[:, None], own])
        np.add.at(parts.total, (e[:, None], own), pulled - load)
        np.add.at(parts.size, (e[:, None], own), np.abs(pulled) + np.abs(load))
    index, place = unknowns_of(mesh, node, coefficients.shape[1])
    turn = np.ones(coefficients.shape[1]) * np.ones((len(node), 1))
    turn[:, 6:9] = np.where(node[:, AFTER] < node[:, BEFORE], 1.0, -1.0)[:, : max(0, min(3, turn.shape[1] - 6))]
    total, size, doubt = sums(parts._replace(total=turn * parts.total), index, len(place))
    free, paired = np.ones(len(place), dtype=np.bool_), movable.constraints.chains.paired
    free[: len(values)] = ~solution.fixed & (movable.constraints.periodic.partner < 0)
    if solution.modes is not None:
        e, k = np.nonzero(solution.modes.dirichlet | ((elements.chain >= 0) & np.append(paired, False)[elements.chain]))
        for first in range(3, min(coefficients.shape[1], 9), 3):
            free[index[e, first + k]] = False
    primary, partner = sliding_pairs(movable.constraints)
    times = sign[movable.constraints.own_chain[primary]]
    primary, partner, times = (array[times != 0.0] for array in (primary, partner, times))
    total[primary] += times * total[partner]
    size[primary] += size[partner]
    doubt[primary] += doubt[partner]
    free[primary] = ~solution.fixed[primary]
    check_residual(total, size, doubt, free, place, mesh)


def check_in_space(ritz: Ritz, mesh: MeshTet, values: Floats, fixed: Mask) -> None:
    corners, number = mesh.p[:, mesh.t], numbers_of(ritz, mesh.t.shape[1])
    if ritz.order == 1:
        nodal = nodal_terms(ritz.surface)
        on_corners = corner_values(values, nodal, mesh.t, reduced_regions(ritz.surface, number))
        total, size, doubt = sums(derivatives_in_space(corners, on_corners, number, ritz), mesh.t.T, len(values))
        if len(nodal):
            total, size = total - nodal[:, LOAD], size + np.abs(nodal[:, LOAD])
        check_residual(total, size, doubt, ~fixed, mesh.p.T, mesh)
        return
    parts = quadratic_derivatives(corners, quadratic_coefficients(mesh, values), number, ritz)
    index = np.hstack([mesh.t.T, mesh.nvertices + edges_of_elements(mesh, mesh.t.T)])
    place = np.vstack([mesh.p.T, mesh.p[:, mesh.edges].mean(axis=1).T])
    check_residual(*sums(parts, index, len(values)), ~fixed, place, mesh)


def numbers_of(ritz: Ritz, count: int) -> Ints:
    return np.zeros(count, dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)


def sums(parts: Derivatives, index: Ints, count: int) -> tuple[Floats, Floats, Floats]:
    total, size, doubt = (np.bincount(index.ravel(), part.ravel(), count).astype(np.float64) for part in parts)
    return total, size, doubt


def unknowns_of(mesh: Mesh, node: Ints, functions: int) -> tuple[Ints, Floats]:
    """Return the unknowns of coefficients, (m, functions), and their positions."""
    columns, places, corners = [node], [mesh.p[:, : mesh.nvertices].T], mesh.p.T[node]
    count = len(places[0])
    if functions > 3:
        facet, ends = facets_of_sides(mesh, node), mesh.p[:, mesh.facets].mean(axis=1).T
        for _ in range(3, min(functions, 9), 3):
            columns.append(count + facet)
            places.append(ends)
            count += len(ends)
    if functions == 10:
        columns.append(count + np.arange(len(node))[:, None])
        places.append(corners.mean(axis=1))
    return np.hstack(columns), np.concatenate(places)


def check_residual(total: Floats, size: Floats, doubt: Floats, free: Mask, place: Floats, mesh: Mesh) -> None:
    allowed = OF_TERMS * size + OF_LARGEST * size.max(initial=0.0) + doubt
    excess = np.where(free, np.abs(total) - allowed, -np.inf)
    wrong = int(np.count_nonzero(excess > 0.0))
    if not wrong:
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
