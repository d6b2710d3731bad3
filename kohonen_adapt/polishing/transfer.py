"""Interpolation of a solution onto the moved mesh, with its Dirichlet mask."""

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.numba.compilation import zeros
from kohonen_adapt.kernels.triangle.arrays import FREE, HELD, SLIDING
from kohonen_adapt.mesh.curved import AFTER, BEFORE, CurvedElements
from kohonen_adapt.mesh.elements.polynomials import (
    TrialFunction,
    evaluated,
    local_coefficients,
    places_on_sides,
    set_bubbles,
    set_sides,
)
from kohonen_adapt.mesh.locate import barycentric_coordinates, walk_in_parts
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.polishing.elements import kinds_of, without_modes
from kohonen_adapt.polishing.energy_tables import first_of_regions
from kohonen_adapt.polishing.functional import Functional

__all__ = ["transferred"]


def transferred(
    functional: Functional, before: MovableMesh, movable: MovableMesh, start_element: Ints
) -> TrialFunction:
    """Interpolate the solution of a functional onto the moved mesh.

    Held nodes take the value of the old node at the same position, sliding nodes that of their curve segment, and
    free nodes that of the old element around them. Node numbers may differ. `before` is the unmoved mesh of the
    solution, and `start_element` (n,) is an old element near every node, in a region that touches the node.
    """
    constraints, solution = movable.constraints, functional.solution
    kind, chain = constraints.kind, constraints.own_chain
    old = InputSolution(functional, before)
    found, weights = old.located(movable.triangulation.position, start_element)
    corners = old.triangulation.elements.node[found]
    inside = solution.fixed & (before.constraints.kind == FREE)
    values = old.values(found, weights)
    fixed = np.all(solution.fixed[corners], axis=1) & np.any(inside[corners], axis=1)
    held, sliding = kind == HELD, kind == SLIDING
    nearest = corners[held, np.argmax(weights[held], axis=1)]
    values[held], fixed[held] = solution.values[nearest], solution.fixed[nearest]
    fixed[sliding] = functional.dirichlet[chain[sliding]]
    exact = np.flatnonzero(sliding)[functional.linear[chain[sliding]]]
    start, rate = functional.on_chain[chain[exact]].T
    values[exact] = start + rate * constraints.parameter[exact]
    dual = None if functional.dual is None else transferred(functional.dual, before, movable, start_element)
    if solution.modes is None:
        return TrialFunction(values, fixed, None, dual)
    return TrialFunction(values, fixed, transferred_modes(old, movable, start_element, values, fixed), dual)


class InputSolution:
    def __init__(self, functional: Functional, before: MovableMesh) -> None:
        self.functional, self.triangulation = functional, before.triangulation
        self.kind = kinds_of(functional.ritz, before.triangulation)
        self.curved: CurvedElements | None = None
        if before.curved:
            elements = self.triangulation.elements
            offsets = before.midside_offsets()
            self.curved = CurvedElements(
                self.triangulation.position.T, elements.node.T, offsets.transpose(2, 1, 0), elements.neighbour.T
            )

    def located(self, points: Floats, start_element: Ints) -> tuple[Ints, Floats]:
        """Return the element around each point, (n,), and barycentric coordinates (n, 3).

        Coordinates are not negative.
        """
        tri = self.triangulation
        found = walk_in_parts(tri, points, start_element, nearest_on_rim)
        weights = barycentric_coordinates(tri.position, tri.elements.node, points, found)
        if self.curved is not None:
            rows = np.flatnonzero(self.curved.curved[found])
            found[rows] = self.curved.walk(found[rows], points[rows].T)
            weights[rows] = self.curved.barycentric_coordinates(found[rows], points[rows].T).T
        weights = np.maximum(weights, 0.0)
        return found, weights / weights.sum(axis=1, keepdims=True)

    def values(self, element: Ints, weights: Floats) -> Floats:
        solution = self.functional.solution
        part = solution.modes and solution.modes.rows(element)
        coefficients = local_coefficients(solution.values[self.triangulation.elements.node[element]], part)
        return evaluated(coefficients, weights, None if self.kind is None else self.kind[element])

    def at(self, points: Floats, start_element: Ints) -> Floats:
        return self.values(*self.located(points, start_element))


def transferred_modes(
    old: InputSolution, movable: MovableMesh, start_element: Ints, values: Floats, fixed: Mask
) -> Modes:
    # Points of an element are searched from an old element in the same region, points of a side from either adjacent
    # element.
    new, order = movable.triangulation, old.functional.ritz.order
    elements = new.elements
    m = len(new.elements.node)
    functional = old.functional
    degrees = order - 1
    if not degrees:
        return without_modes(m)
    start = start_elements(old.triangulation, new, start_element)
    modes = zeros(Modes, (m, 3, degrees), m, dirichlet_sides(functional, movable, fixed))
    points, centroids = places_inside(movable, order)
    e, k = np.nonzero(elements.neighbour < np.arange(m)[:, None])
    own = np.empty((m, 3, degrees))
    own[e, k] = old.at(points[e, k].reshape(-1, 2), np.repeat(start[e], degrees)).reshape(-1, degrees)
    across = elements.neighbour[e, k]
    e, k, across = e[across >= 0], k[across >= 0], across[across >= 0]
    own[across, np.argmax(elements.neighbour[across] == e[:, None], axis=1)] = own[e, k, ::-1]
    kind = kinds_of(functional.ritz, new)
    set_sides(modes, values[elements.node], own, kind)
    modes.side[modes.dirichlet & on_chains(elements.chain, functional.linear)] = 0.0
    if order == 3:
        set_bubbles(modes, values[elements.node], old.at(centroids, start), kind)
    return modes


def places_inside(movable: MovableMesh, order: int) -> FloatsPair:
    """Return the nodes of sides, (m, 3, order - 1, 2), and centroids (m, 2).

    The nodes of a side are ordered counter-clockwise.
    """
    corners = movable.triangulation.position[movable.triangulation.elements.node]
    along = np.arange(1, order) / order
    on_sides, centroids = places_on_sides(corners, order), corners.mean(axis=1)
    if movable.curved:
        offsets = movable.midside_offsets()
        on_sides += (4.0 * along * (1.0 - along))[:, None] * offsets[:, :, None]
        centroids += 4.0 / 9.0 * offsets.sum(axis=1)
    return on_sides, centroids


def dirichlet_sides(functional: Functional, movable: MovableMesh, fixed: Mask) -> Mask:
    """Return the sides with Dirichlet values, (m, 3).

    Sides on periodic or Robin boundaries are included, because sweeps must not change their coefficients.
    """
    elements, constraints = movable.triangulation.elements, movable.constraints
    dirichlet = on_chains(elements.chain, functional.dirichlet | functional.boundary.on | constraints.chains.paired)
    inside = fixed & (constraints.kind == FREE)
    ends = elements.node[:, AFTER], elements.node[:, BEFORE]
    return dirichlet | (fixed[ends[0]] & fixed[ends[1]] & (inside[ends[0]] | inside[ends[1]]))


def start_elements(old: Triangulation, new: Triangulation, start_element: Ints) -> Ints:
    """Return an old element in the same region, (m,), near one of the corners if any."""
    near = start_element[new.elements.node]
    fits = old.elements.region[near] == new.elements.region[:, None]
    chosen = near[np.arange(len(near)), np.argmax(fits, axis=1)]
    return np.where(fits.any(axis=1), chosen, first_of_regions(old.elements.region)[new.elements.region])


def nearest_on_rim(triangulation: Triangulation, points: Floats, inside: Mask) -> Ints:
    """Return the boundary elements `inside` (m,) nearest to points (n, 2)."""
    e, k = np.nonzero(inside[:, None] & (triangulation.elements.neighbour < 0))
    start, end = (triangulation.position[nodes] for nodes in triangulation.elements.ends(e, k))
    edge, to = end - start, points[:, None] - start
    weights = np.clip(np.sum(to * edge, axis=2) / np.sum(edge**2, axis=1), 0.0, 1.0)
    return e[np.argmin(np.sum((to - weights[..., None] * edge) ** 2, axis=2), axis=1)]
