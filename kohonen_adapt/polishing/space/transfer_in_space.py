"""Interpolation of a solution onto moved tetrahedra, with its Dirichlet mask."""

import numpy as np
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.tetrahedron.arrays import HELD, INSIDE, ON_PATCH, ON_RIDGE
from kohonen_adapt.kernels.tetrahedron.locate import barycentric
from kohonen_adapt.mesh.adjacency import parts_of_regions
from kohonen_adapt.mesh.locate import walk_to_elements
from kohonen_adapt.mesh.polynomials import TrialFunction
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional

__all__ = ["transferred_in_space"]


def transferred_in_space(
    functional: SolidFunctional, before: MovableSolid, movable: MovableSolid, start_element: Ints
) -> TrialFunction:
    """Interpolate the solution of a functional onto the moved mesh.

    Held nodes take the value of the old node at the same position, all others that of the old element around
    them. Nodes on patches and ridges with Dirichlet values take the linear function, or without one the mean of
    the surrounding Dirichlet values. Node numbers may differ. `before` is the unmoved mesh of the solution, and
    `start_element` (n,) is an old element near every node, in a region that touches the node.
    """
    solution, freedom, old = functional.solution, movable.freedom, before.tetrahedralization
    position = movable.tetrahedralization.position
    found, weights = located(old, position, start_element)
    corners = old.elements.node[found]
    values = np.sum(weights * solution.values[corners], axis=1)
    inside = solution.fixed & (before.freedom.number == INSIDE)
    fixed = np.all(solution.fixed[corners], axis=1) & np.any(inside[corners], axis=1)
    nearest = corners[np.arange(len(corners)), np.argmax(weights, axis=1)]
    held = freedom.number == HELD
    values[held], fixed[held] = solution.values[nearest[held]], solution.fixed[nearest[held]]
    for kind, first in ((ON_PATCH, 0), (ON_RIDGE, functional.patches)):
        rows = np.flatnonzero(freedom.number == kind)
        place = freedom.place[rows] + first
        fixed[rows] = functional.dirichlet[place]
        rows, place = rows[functional.dirichlet[place]], place[functional.dirichlet[place]]
        weight = weights[rows] * solution.fixed[corners[rows]]
        values[rows] = averages(weight, solution.values[corners[rows]], values[rows])
        linear = ~functional.held[place] & np.any(weight > 0.0, axis=1)
        rows, place, start = rows[linear], place[linear], corners[rows[linear], np.argmax(weight[linear], axis=1)]
        step = position[rows] - old.position[start]
        values[rows] = solution.values[start] + np.sum(functional.rate[place] * step, axis=1)
    return TrialFunction(values, fixed, None)


def averages(weight: Floats, values: Floats, otherwise: Floats) -> Floats:
    """Return weighted means of rows (k, 4), `otherwise` (k,) if all weights are 0."""
    total = weight.sum(axis=1)
    return np.divide(np.sum(weight * values, axis=1), total, out=otherwise.copy(), where=total > 0.0)


def located(old: Tetrahedralization, points: Floats, start_element: Ints) -> tuple[Ints, Floats]:
    """Return the element at each point, (n,), and barycentric coordinates (n, 4).

    Coordinates are not negative. The element is in the connected part of `start_element`, because bodies
    may touch without common nodes.
    """
    found = walk_to_elements(old, points, start_element, across_regions=False)
    part = parts_of_regions(old.elements.neighbour, old.elements.region)[old.elements.region]
    astray = np.flatnonzero(part[found] != part[start_element])
    for number in np.unique(part[start_element[astray]]):
        rows, own = astray[part[start_element[astray]] == number], np.flatnonzero(part == number)
        centroids = old.position[old.elements.node[own]].mean(axis=1)
        found[rows] = own[cKDTree(centroids).query(points[rows])[1]]
    weights = np.empty((len(points), 4))
    barycentric(old.position, old.elements.node, points, found, weights)
    weights = np.maximum(weights, 0.0)
    return found, weights / weights.sum(axis=1, keepdims=True)
