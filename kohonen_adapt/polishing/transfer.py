"""Interpolate a solution onto the moved mesh, with what of it is given."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import FREE, HELD, SLIDING, Modes
from kohonen_adapt.kernels.triangle.locate import barycentric
from kohonen_adapt.mesh.adjacency import parts_of_regions
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.isoparametric import CurvedElements
from kohonen_adapt.mesh.locate import holding
from kohonen_adapt.mesh.polynomials import (
    TrialFunction,
    evaluated,
    local_coefficients,
    places_on_sides,
    set_bubbles,
    set_sides,
)
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.chains import on_chains
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.polishing.elements import kinds_of, without_modes
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.regions import first_of_regions

__all__ = ["carried"]


def carried(functional: Functional, before: MovableMesh, movable: MovableMesh, hint: Ints) -> TrialFunction:
    """Interpolate the solution of a functional onto what became of its mesh.

    Nodes are known by where they are, not by their numbers: held ones by the old node in their place, sliding ones by
    their chain, free ones by the old element that holds them. `before` is the mesh of the solution, which does not
    move; `hint` (n,) is an element of it near every node, of a region that the node touches.
    """
    constraints, solution = movable.constraints, functional.solution
    kind, chain = constraints.kind, constraints.own_chain
    old = Old(functional, before)
    found, share = old.located(movable.triangulation.position, hint)
    corners = old.triangulation.elements.node[found]
    inside = solution.fixed & (before.constraints.kind == FREE)
    values = old.values(found, share)
    fixed = np.all(solution.fixed[corners], axis=1) & np.any(inside[corners], axis=1)
    held, sliding = kind == HELD, kind == SLIDING
    nearest = corners[held, np.argmax(share[held], axis=1)]
    values[held], fixed[held] = solution.values[nearest], solution.fixed[nearest]
    fixed[sliding] = functional.given[chain[sliding]]
    exact = np.flatnonzero(sliding)[functional.linear[chain[sliding]]]
    start, rate = functional.on_chain[chain[exact]].T
    values[exact] = start + rate * constraints.parameter[exact]
    dual = None if functional.dual is None else carried(functional.dual, before, movable, hint)
    if solution.modes is None:
        return TrialFunction(values, fixed, None, dual)
    return TrialFunction(values, fixed, carried_modes(old, movable, hint, values, fixed), dual)


class Old:
    """The solution of a functional on its mesh, which has not moved."""

    def __init__(self, functional: Functional, before: MovableMesh) -> None:
        self.functional, self.triangulation = functional, before.triangulation
        self.kind = kinds_of(functional.ritz, before.triangulation)
        self.curved: CurvedElements | None = None
        if before.curved:
            elements, bent = self.triangulation.elements, before.bent_sides()
            self.curved = CurvedElements(
                self.triangulation.position.T, elements.node.T, bent.transpose(2, 1, 0), elements.neighbour.T
            )

    def located(self, points: Floats, hint: Ints) -> tuple[Ints, Floats]:
        """The element that holds each point, (n,), and its barycentric coordinates there, (n, 3), none < 0.

        It is of the connected part of the mesh that the hint is of: another part, as a rotor that is drawn in its
        stator, may lie where this one ends by the chords of its rim.
        """
        found = holding(self.triangulation, points, hint, across_outlines=False)
        elements = self.triangulation.elements
        part = parts_of_regions(elements.neighbour, elements.region)[elements.region]
        astray = np.flatnonzero(part[found] != part[hint])
        for number in np.unique(part[hint[astray]]):
            rows = astray[part[hint[astray]] == number]
            found[rows] = nearest_on_rim(self.triangulation, points[rows], part == number)
        share = np.empty((len(points), 3))
        barycentric(self.triangulation.position, self.triangulation.elements.node, points, found, share)
        if self.curved is not None:
            rows = np.flatnonzero(self.curved.curved[found])
            found[rows] = self.curved.walked(found[rows], points[rows].T)
            share[rows] = self.curved.shares(found[rows], points[rows].T).T
        share = np.maximum(share, 0.0)
        return found, share / share.sum(axis=1, keepdims=True)

    def values(self, element: Ints, share: Floats) -> Floats:
        """The solution at barycentric coordinates (n, 3) of elements (n,)."""
        values, _, modes, _ = self.functional.solution
        part = None if modes is None else Modes(*(array[element] for array in modes))
        coefficients = local_coefficients(values[self.triangulation.elements.node[element]], part)
        return evaluated(coefficients, share, None if self.kind is None else self.kind[element])

    def at(self, points: Floats, hint: Ints) -> Floats:
        """The solution at points (n, 2), each near an element."""
        return self.values(*self.located(points, hint))


def carried_modes(old: Old, movable: MovableMesh, hint: Ints, values: Floats, fixed: Mask) -> Modes:
    """The coefficients of sides and elements that interpolate the solution, given where the sides are.

    The points of an element are looked for from a hint of its own region; those of a side in one of its two elements.
    """
    new, order = movable.triangulation, old.functional.ritz.order
    elements, m, functional, degrees = new.elements, len(new.elements.node), old.functional, order - 1
    if not degrees:
        return without_modes(m)
    start = hints_of_elements(old.triangulation, new, hint)
    modes = Modes(np.empty((m, 3, degrees)), np.zeros(m), given_sides(functional, movable, fixed))
    points, middles = places_inside(movable, order)
    e, k = np.nonzero(elements.neighbour < np.arange(m)[:, None])
    own = np.empty((m, 3, degrees))
    own[e, k] = old.at(points[e, k].reshape(-1, 2), np.repeat(start[e], degrees)).reshape(-1, degrees)
    beyond = elements.neighbour[e, k]
    e, k, beyond = e[beyond >= 0], k[beyond >= 0], beyond[beyond >= 0]
    own[beyond, np.argmax(elements.neighbour[beyond] == e[:, None], axis=1)] = own[e, k, ::-1]
    kind = kinds_of(functional.ritz, new)
    set_sides(modes, values[elements.node], own, kind)
    modes.side[modes.given & straight_sides(functional, movable)] = 0.0
    if order == 3:
        set_bubbles(modes, values[elements.node], old.at(middles, start), kind)
    return modes


def places_inside(movable: MovableMesh, order: int) -> tuple[Floats, Floats]:
    """Where sides have values of their own, counter-clockwise, (m, 3, order - 1, 2), and where elements do, (m, 2)."""
    corners, along = movable.triangulation.position[movable.triangulation.elements.node], np.arange(1, order) / order
    on_sides, middles = places_on_sides(corners, order), corners.mean(axis=1)
    if movable.curved:
        bent = movable.bent_sides()
        on_sides += (4.0 * along * (1.0 - along))[:, None] * bent[:, :, None]
        middles += 4.0 / 9.0 * bent.sum(axis=1)
    return on_sides, middles


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
    return np.where(fits.any(axis=1), chosen, first_of_regions(old.elements.region)[new.elements.region])


def nearest_on_rim(triangulation: Triangulation, points: Floats, inside: Mask) -> Ints:
    """The elements at the outer edges, of those inside (m,), that are nearest to points (n, 2)."""
    e, k = np.nonzero(inside[:, None] & (triangulation.elements.neighbour < 0))
    start, end = (triangulation.position[nodes] for nodes in triangulation.elements.ends(e, k))
    way, to = end - start, points[:, None] - start
    share = np.clip(np.sum(to * way, axis=2) / np.sum(way**2, axis=1), 0.0, 1.0)
    return e[np.argmin(np.sum((to - share[..., None] * way) ** 2, axis=2), axis=1)]
