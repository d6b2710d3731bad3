"""A solution on the triangulation it was found on, looked up for the nodes of what became of that."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import FREE, HELD, SLIDING
from kohonen_adapt.kernels.triangle.locate import barycentric, walk_each
from kohonen_adapt.mesh.locate import Locator
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.outline import Outline
from kohonen_adapt.polish.functional import Functional
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["Carrier"]


@dataclass(frozen=True)
class Carrier:
    """A P1 function, what of it is given, and the triangulation it was found on.

    Attributes
    ----------
    functional
        Knows what is given on every chain.
    base
        The old triangulation: one that does not move with the nodes.
    values, fixed
        Nodal values there, and whether they are given, (n,).
    inside
        Whether a value is given at a node that is on no outline, (n,).
    """

    functional: Functional
    base: Triangulation
    values: Floats
    fixed: Mask
    inside: Mask

    @classmethod
    def of(cls, ritz: Ritz, functional: Functional, triangulation: Triangulation, outline: Outline) -> "Carrier":
        """The solution of `ritz` on a triangulation and its outline as they were before nodes moved."""
        values, fixed = np.asarray(ritz.values), np.asarray(ritz.fixed)
        return cls(functional, triangulation, values, fixed, fixed & (outline.constraints.kind == FREE))

    def onto(self, triangulation: Triangulation, outline: Outline, hint: Ints) -> tuple[Floats, Mask]:
        """Values and whether they are given, (n,) each, at the nodes of what became of the triangulation.

        `hint` (n,) is an element of the old triangulation near every node, of a region that the node touches. Nodes are
        known by where they are, not by their numbers: held ones by the old node in their place, sliding ones by their
        chain, free ones by the old element that holds them.
        """
        position, kind, chain = triangulation.position, outline.constraints.kind, outline.constraints.own_chain
        corners, share = self._located(position, hint)
        values = np.sum(share * self.values[corners], axis=1)
        fixed = np.all(self.fixed[corners], axis=1) & np.any(self.inside[corners], axis=1)
        held, sliding = kind == HELD, kind == SLIDING
        before = corners[held, np.argmax(share[held], axis=1)]
        values[held], fixed[held] = self.values[before], self.fixed[before]
        fixed[sliding] = self.functional.given[chain[sliding]]
        exact = np.flatnonzero(sliding)[self.functional.linear[chain[sliding]]]
        start, rate = self.functional.on_chain[chain[exact]].T
        values[exact] = start + rate * outline.constraints.parameter[exact]
        return values, fixed

    def _located(self, points: Floats, hint: Ints) -> tuple[NDArray[np.int32], Floats]:
        """Corners of the old element that holds each point, (n, 3), and its barycentric coordinates there, none < 0."""
        old = self.base
        found, inside = np.array(hint, dtype=np.int32), np.empty(len(points), dtype=np.bool_)
        walk_each(old.position, old.elements, points, found, inside)
        if not inside.all():
            # Blocked by a concave outline, or too far: searched for. Outside by rounding: where the walk ended.
            searched = Locator(old).find(points[~inside])
            found[~inside] = np.where(searched >= 0, searched, found[~inside])
        share = np.empty((len(points), 3))
        barycentric(old.position, old.elements.node, points, found, share)
        share = np.maximum(share, 0.0)
        return old.elements.node[found], share / share.sum(axis=1, keepdims=True)
