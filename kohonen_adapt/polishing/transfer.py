"""Interpolate a solution onto the moved mesh, with what of it is given."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import FREE, HELD, SLIDING, Modes
from kohonen_adapt.kernels.triangle.locate import barycentric
from kohonen_adapt.mesh.locate import holding
from kohonen_adapt.mesh.polynomials import (
    AFTER,
    BEFORE,
    TrialFunction,
    evaluated,
    local_coefficients,
    places_on_sides,
    set_bubbles,
    set_sides,
)
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.polishing.boundary import on_chains
from kohonen_adapt.polishing.functional import Functional, first_of_regions

__all__ = ["carried"]


def carried(functional: Functional, before: MovableMesh, movable: MovableMesh, hint: Ints) -> TrialFunction:
    """Interpolate the solution of a functional onto what became of its mesh.

    Nodes are known by where they are, not by their numbers: held ones by the old node in their place, sliding ones by
    their chain, free ones by the old element that holds them. `before` is the mesh of the solution, which does not
    move; `hint` (n,) is an element of it near every node, of a region that the node touches.
    """
    constraints, solution = movable.constraints, functional.solution
    kind, chain = constraints.kind, constraints.own_chain
    found, share = located(before.triangulation, movable.triangulation.position, hint)
    corners = before.triangulation.elements.node[found]
    inside = solution.fixed & (before.constraints.kind == FREE)
    values = values_at(solution, before.triangulation, found, share)
    fixed = np.all(solution.fixed[corners], axis=1) & np.any(inside[corners], axis=1)
    held, sliding = kind == HELD, kind == SLIDING
    nearest = corners[held, np.argmax(share[held], axis=1)]
    values[held], fixed[held] = solution.values[nearest], solution.fixed[nearest]
    fixed[sliding] = functional.given[chain[sliding]]
    exact = np.flatnonzero(sliding)[functional.linear[chain[sliding]]]
    start, rate = functional.on_chain[chain[exact]].T
    values[exact] = start + rate * constraints.parameter[exact]
    if solution.modes is None:
        return TrialFunction(values, fixed, None)
    return TrialFunction(values, fixed, carried_modes(functional, before, movable, hint, values, fixed))


def carried_modes(
    functional: Functional, before: MovableMesh, movable: MovableMesh, hint: Ints, values: Floats, fixed: Mask
) -> Modes:
    """The coefficients of sides and elements that interpolate the solution, given where the sides are.

    The points of an element are looked for from a hint of its own region; those of a side in one of its two elements.
    """
    old, new, degrees = before.triangulation, movable.triangulation, functional.ritz.order - 1
    elements, m = new.elements, len(new.elements.node)
    start = hints_of_elements(old, new, hint)
    modes = Modes(np.empty((m, 3, degrees)), np.zeros(m), given_sides(functional, movable, fixed))
    corners = new.position[elements.node]
    points = places_on_sides(corners, functional.ritz.order)  # (m, 3, degrees, 2)
    e, k = np.nonzero(elements.neighbour < np.arange(m)[:, None])
    own = np.empty((m, 3, degrees))
    own[e, k] = at_points(functional, old, points[e, k].reshape(-1, 2), np.repeat(start[e], degrees)).reshape(
        -1, degrees
    )
    beyond = elements.neighbour[e, k]
    e, k, beyond = e[beyond >= 0], k[beyond >= 0], beyond[beyond >= 0]
    own[beyond, np.argmax(elements.neighbour[beyond] == e[:, None], axis=1)] = own[e, k, ::-1]
    set_sides(modes, values[elements.node], own)
    modes.side[modes.given & straight_sides(functional, movable)] = 0.0
    if functional.ritz.order == 3:
        set_bubbles(modes, values[elements.node], at_points(functional, old, corners.mean(axis=1), start))
    return modes


def given_sides(functional: Functional, movable: MovableMesh, fixed: Mask) -> Mask:
    """Sides whose values are given, (m, 3): on chains where they are, and between nodes inside.

    So are, as far as sweeps know, those on periodic chains and those with a Robin condition.
    """
    elements, constraints = movable.triangulation.elements, movable.constraints
    given = on_chains(elements.chain, functional.given | functional.boundary.on | constraints.chains.paired)
    inside = fixed & (constraints.kind == FREE)
    ends = elements.node[:, AFTER], elements.node[:, BEFORE]
    return given | (fixed[ends[0]] & fixed[ends[1]] & (inside[ends[0]] | inside[ends[1]]))


def straight_sides(functional: Functional, movable: MovableMesh) -> Mask:
    """Sides on chains along which the given values are linear, (m, 3)."""
    return on_chains(movable.triangulation.elements.chain, functional.linear)


def hints_of_elements(old: Triangulation, new: Triangulation, hint: Ints) -> Ints:
    """An element of the old mesh for every new one, (m,), in its region and near it where a corner's hint is."""
    near = hint[new.elements.node]
    fits = old.elements.region[near] == new.elements.region[:, None]
    chosen = near[np.arange(len(near)), np.argmax(fits, axis=1)]
    return np.where(fits.any(axis=1), chosen, first_of_regions(old)[new.elements.region])


def at_points(functional: Functional, old: Triangulation, points: Floats, hint: Ints) -> Floats:
    """The solution at points (n, 2), each near an old element."""
    return values_at(functional.solution, old, *located(old, points, hint))


def values_at(solution: TrialFunction, old: Triangulation, element: Ints, share: Floats) -> Floats:
    """A function at barycentric coordinates (n, 3) of elements (n,)."""
    modes = solution.modes
    part = None if modes is None else Modes(*(array[element] for array in modes))
    return evaluated(local_coefficients(solution.values[old.elements.node[element]], part), share)


def located(old: Triangulation, points: Floats, hint: Ints) -> tuple[Ints, Floats]:
    """The old element that holds each point, (n,), and its barycentric coordinates there, (n, 3), none < 0."""
    found = holding(old, points, hint, across_outlines=False)
    share = np.empty((len(points), 3))
    barycentric(old.position, old.elements.node, points, found, share)
    share = np.maximum(share, 0.0)
    return found, share / share.sum(axis=1, keepdims=True)
