"""Interpolation of a solution onto moved tetrahedra, with its Dirichlet mask."""

import numpy as np
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, OFFSET, ON_PATCH, ON_RIDGE
from kohonen_adapt.mesh.elements.polynomials import FIRST, SECOND, TrialFunction
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.locate import barycentric_coordinates, nearest_labelled, walk_in_parts
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional, terms_at_nodes, zero_modes
from kohonen_adapt.polishing.space.surface_values import EDGES_OF_FACES
from kohonen_adapt.problem.boundary_terms import corner_values, reduced_regions

__all__ = ["transferred_in_space"]

NEGLIGIBLE = 1e-9  # barycentric coordinate of a corner of which the value is irrelevant


def transferred_in_space(
    functional: SolidFunctional, before: MovableSolid, movable: MovableSolid, start_element: Ints
) -> TrialFunction:
    """Interpolate the solution of a functional onto the moved mesh.

    Held nodes take the value of the old node at the same position, all others that of the old element around them.
    Nodes on patches and ridges with Dirichlet values take the linear function, or without one the mean of the
    surrounding Dirichlet values. New nodes where no node was on the patch or ridge are Dirichlet nodes, if the nodes
    around are, because their patch may have Dirichlet values. Node numbers may differ. `before` is the unmoved mesh of
    the solution, and `start_element` (n,) is an old element near every node, in a region that touches the node. Offsets
    and loads are evaluated on the moved mesh.
    """
    solution, freedom, old = functional.solution, movable.freedom, before.tetrahedralization
    position = movable.tetrahedralization.position
    surface = surface_on(functional, before, movable)
    reduced = reduced_regions(functional.ritz.surface, functional.number)
    starts = (
        start_element if not len(surface) else starts_outside(reduced, old, movable.tetrahedralization, start_element)
    )
    found, weights = located(old, position, starts)
    corners, in_reduced = old.elements.node[found], reduced[old.elements.region[found]]
    on_corners = corner_values(solution.values, solution.surface, corners.T, in_reduced).T
    values = quadratic_values(solution, on_corners, found, weights)
    inside = solution.fixed & (before.freedom.number == INSIDE)
    fixed = np.all(solution.fixed[corners], axis=1) & np.any(inside[corners], axis=1)
    held = np.flatnonzero(freedom.number == HELD)
    nearest = np.argmax(weights[held], axis=1)
    values[held], fixed[held] = on_corners[held, nearest], solution.fixed[corners[held, nearest]]
    for kind, first in ((ON_PATCH, 0), (ON_RIDGE, functional.patches)):
        rows = np.flatnonzero(freedom.number == kind)
        place = freedom.place[rows] + first
        between = np.all(solution.fixed[corners[rows]] | (weights[rows] < NEGLIGIBLE), axis=1)
        fixed[rows] = functional.dirichlet[place] | (functional.unknown[place] & between)
        rows, place = rows[functional.dirichlet[place]], place[functional.dirichlet[place]]
        weight = weights[rows] * solution.fixed[corners[rows]]
        values[rows] = averages(weight, on_corners[rows], values[rows])
        linear = ~functional.held[place] & np.any(weight > 0.0, axis=1)
        rows, place = rows[linear], place[linear]
        nearest = np.argmax(weight[linear], axis=1)
        step = position[rows] - old.position[corners[rows, nearest]]
        values[rows] = on_corners[rows, nearest] + np.sum(functional.rate[place] * step, axis=1)
    if len(surface):
        values += np.where(in_reduced, surface[:, OFFSET], 0.0)
    there = TrialFunction(values, fixed, None, surface=surface)
    return there._replace(modes=solution.modes and carried_modes(functional, before, movable, there, starts))


def surface_on(functional: SolidFunctional, before: MovableSolid, movable: MovableSolid) -> Floats:
    old, new, terms = before.tetrahedralization, movable.tetrahedralization, functional.ritz.surface
    if terms is None or (
        np.array_equal(old.position, new.position) and np.array_equal(old.elements.node, new.elements.node)
    ):
        return functional.solution.surface
    mesh = movable.mesh()
    return terms_at_nodes(terms.on_mesh(mesh), mesh)


def starts_outside(reduced: Mask, old: Tetrahedralization, new: Tetrahedralization, start_element: Ints) -> Ints:
    # In a reduced region the offset would cancel most of the value at a node of elements outside.
    start, wanted = start_element.copy(), np.full(new.nnodes, -1)
    node, region = new.elements.node[new.used], new.elements.region[new.used]
    wanted[node[~reduced[region]]] = region[~reduced[region], None]
    astray = np.flatnonzero((wanted >= 0) & reduced[old.elements.region[start]])
    start[astray] = nearest_in(old, new.position[astray], wanted[astray])
    return start


def nearest_in(old: Tetrahedralization, points: Floats, region: Ints) -> Ints:
    # elements whose centroids are nearest to points, in the region of every point
    return nearest_labelled(old, points, old.elements.region, region, nearest_centroids)


def nearest_centroids(old: Tetrahedralization, points: Floats, inside: Mask) -> Ints:
    own = np.flatnonzero(inside)
    centroids = old.position[old.elements.node[own]].mean(axis=1)
    return own[cKDTree(centroids).query(points)[1]]


def carried_modes(
    functional: SolidFunctional,
    before: MovableSolid,
    movable: MovableSolid,
    at_nodes: TrialFunction,
    start_element: Ints,
) -> Modes:
    """Return the coefficients of the edges, with the Dirichlet edges of patches.

    `at_nodes` has the values at the nodes. On patches with linear Dirichlet values the coefficients are 0.
    """
    tet, old, solution = movable.tetrahedralization, before.tetrahedralization, functional.solution
    used, n = tet.used, tet.nnodes
    node, patch = tet.elements.node[used], tet.elements.patch[used]
    reduced = reduced_regions(functional.ritz.surface, functional.number)
    side = reduced[tet.elements.region[used], None]  # an edge on a surface with offsets has two coefficients
    key = 2 * keys_of(ascending(node[:, FIRST], node[:, SECOND]), n) + side
    code, row, edge = np.unique(key, return_index=True, return_inverse=True)
    edge, ends = edge.reshape(-1, 6), np.stack(np.divmod(code // 2, n), axis=1)
    # a start in the region of the edge, if its ends have one
    start, region = start_element[ends], tet.elements.region[used][row // 6]
    middle = tet.position[ends].mean(axis=1)
    start = np.where(old.elements.region[start[:, 0]] == region, start[:, 0], start[:, 1])
    in_reduced = reduced[region]
    astray = np.flatnonzero(reduced[old.elements.region[start]] != in_reduced)
    start[astray] = nearest_in(old, middle[astray], region[astray])
    found, weights = located(old, middle, start)
    corners = old.elements.node[found].T
    nodal = (solution.surface, at_nodes.surface)
    on_corners = corner_values(solution.values, nodal[0], corners, in_reduced).T
    on_ends = corner_values(at_nodes.values, nodal[1], ends.T, in_reduced)
    mode = quadratic_values(solution, on_corners, found, weights) - on_ends.mean(axis=0)
    dirichlet = np.all(solution.modes.dirichlet[found], axis=1) if solution.modes else np.zeros(len(code), bool)

    def on(places: Mask) -> Ints:
        e, k = np.nonzero(np.append(places[: functional.patches], False)[patch])
        return edge[e[:, None], EDGES_OF_FACES[k]]

    unknown = on(functional.unknown)
    dirichlet[unknown] |= np.all(at_nodes.fixed[ends[unknown]], axis=2)
    dirichlet[on(functional.dirichlet)] = True
    mode[on(functional.dirichlet & ~functional.held)] = 0.0
    modes = zero_modes(len(tet.elements.node))
    modes.side[used, :, 0], modes.dirichlet[used] = mode[edge], dirichlet[edge]
    return modes


def quadratic_values(function: TrialFunction, on_corners: Floats, element: Ints, weights: Floats) -> Floats:
    values = np.sum(weights * on_corners, axis=1)
    if function.modes is not None:
        edges = function.modes.side[element, :, 0]
        values += 4.0 * np.sum(weights[:, FIRST] * weights[:, SECOND] * edges, axis=1)
    return values


def averages(weight: Floats, values: Floats, otherwise: Floats) -> Floats:
    """Return weighted means of rows (k, 4), `otherwise` (k,) if all weights are 0."""
    total = weight.sum(axis=1)
    return np.divide(np.sum(weight * values, axis=1), total, out=otherwise.copy(), where=total > 0.0)


def located(old: Tetrahedralization, points: Floats, start_element: Ints) -> tuple[Ints, Floats]:
    # the element at each point, (n,), and barycentric coordinates (n, 4), not negative
    found = walk_in_parts(old, points, start_element, nearest_centroids)
    weights = np.maximum(barycentric_coordinates(old.position, old.elements.node, points, found), 0.0)
    return found, weights / weights.sum(axis=1, keepdims=True)
