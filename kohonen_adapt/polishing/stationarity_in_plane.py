"""Check that a Ritz functional is stationary at a solution on triangles."""

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.pairs import sliding_pairs
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.functions import trace_columns
from kohonen_adapt.mesh.polynomials import TrialFunction, facets_of_sides, local_coefficients
from kohonen_adapt.polishing.boundary import BoundaryTerms, sides_on
from kohonen_adapt.polishing.stationarity import check_residual, derivatives_on, doubts_of, numbers_of, sums
from kohonen_adapt.problem.boundary_terms import facet_terms
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["check_in_plane"]


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
    total, size = sums(parts._replace(total=turn * parts.total), index, len(place))
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
    doubt = doubts_of(ritz, mesh, index, len(place))
    doubt.residual[primary] += doubt.residual[partner]
    free[primary] = ~solution.fixed[primary]
    check_residual(total, size, free, place, mesh, doubt)


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
