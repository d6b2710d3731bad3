"""Check that a Ritz functional is stationary at a solution on triangles."""

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.pairs import sliding_pairs
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.elements.polynomials import TrialFunction, local_coefficients
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.polishing.boundary import BoundaryTerms
from kohonen_adapt.polishing.stationarity import check_residual, derivatives_on, doubts_of, sums
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import numbers_of

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
    node = elements.node
    corners = movable.triangulation.position.T[:, elements.node.T]
    coefficients, offset = local_coefficients(values[node], solution.modes).T, movable.midside_offsets().T
    parts = derivatives_on(corners, coefficients, numbers_of(ritz, mesh), ritz, offset)
    for places, matrix, load in boundary.terms(elements.chain, corners, offset):
        pulled = np.einsum("fij,fj->fi", matrix, coefficients[places])
        np.add.at(parts.total, places, pulled - load)
        np.add.at(parts.size, places, np.abs(pulled) + np.abs(load))
    index, place = unknowns_of(mesh, node, len(coefficients))
    turn = np.ones(coefficients.shape)
    turn[6:9] = np.where(node[:, AFTER] < node[:, BEFORE], 1.0, -1.0).T[: max(0, min(3, len(turn) - 6))]
    total, size = sums(parts._replace(total=turn * parts.total), index, len(place))
    free = np.ones(len(place), bool)
    paired = movable.constraints.chains.paired
    free[: len(values)] = ~solution.fixed & (movable.constraints.periodic.partner < 0)
    if solution.modes is not None:
        e, k = np.nonzero(solution.modes.dirichlet | ((elements.chain >= 0) & np.append(paired, False)[elements.chain]))
        for first in range(3, min(len(coefficients), 9), 3):
            free[index[first + k, e]] = False
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
    """Return the unknowns of coefficients, (k, m), and their positions."""
    columns, places = [node], [mesh.p[:, : mesh.nvertices].T]
    corners = mesh.p.T[node]
    count = len(places[0])
    if functions > 3:
        facet = facets_opposite(mesh, node)
        ends = mesh.p[:, mesh.facets].mean(axis=1).T
        for _ in range(3, min(functions, 9), 3):
            columns.append(count + facet)
            places.append(ends)
            count += len(ends)
    if functions == 10:
        columns.append(count + np.arange(len(node))[:, None])
        places.append(corners.mean(axis=1))
    return np.hstack(columns).T, np.concatenate(places)
