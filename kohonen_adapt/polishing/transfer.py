"""Interpolate a solution onto the moved mesh, with what of it is given."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import FREE, HELD, SLIDING
from kohonen_adapt.kernels.triangle.locate import barycentric
from kohonen_adapt.mesh.locate import holding
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.polishing.functional import Functional

__all__ = ["carried"]


def carried(functional: Functional, before: MovableMesh, movable: MovableMesh, hint: Ints) -> tuple[Floats, Mask]:
    """Interpolate the solution of a functional onto what became of its mesh: nodal values, and whether they are given.

    Nodes are known by where they are, not by their numbers: held ones by the old node in their place, sliding ones by
    their chain, free ones by the old element that holds them. `before` is the mesh of the solution, which does not
    move; `hint` (n,) is an element of it near every node, of a region that the node touches.
    """
    constraints = movable.constraints
    kind, chain = constraints.kind, constraints.own_chain
    corners, share = located(before.triangulation, movable.triangulation.position, hint)
    inside = functional.fixed & (before.constraints.kind == FREE)
    values = np.sum(share * functional.values[corners], axis=1)
    fixed = np.all(functional.fixed[corners], axis=1) & np.any(inside[corners], axis=1)
    held, sliding = kind == HELD, kind == SLIDING
    nearest = corners[held, np.argmax(share[held], axis=1)]
    values[held], fixed[held] = functional.values[nearest], functional.fixed[nearest]
    fixed[sliding] = functional.given[chain[sliding]]
    exact = np.flatnonzero(sliding)[functional.linear[chain[sliding]]]
    start, rate = functional.on_chain[chain[exact]].T
    values[exact] = start + rate * constraints.parameter[exact]
    return values, fixed


def located(old: Triangulation, points: Floats, hint: Ints) -> tuple[Ints, Floats]:
    """Corners of the old element that holds each point, (n, 3), and its barycentric coordinates there, none < 0."""
    found = holding(old, points, hint, across_outlines=False)
    share = np.empty((len(points), 3))
    barycentric(old.position, old.elements.node, points, found, share)
    share = np.maximum(share, 0.0)
    return old.elements.node[found], share / share.sum(axis=1, keepdims=True)
