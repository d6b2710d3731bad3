"""Robin terms of a functional on triangles.

The kernels, which see vertex stars only, do not include Robin terms. Nodes and values on Robin boundaries stay, because
better values there change errors by a few thousandths, and on meshes of 200 nodes by 2.5 %.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask
from kohonen_adapt.geometry.plane.chains import on_chains
from kohonen_adapt.geometry.plane.outline import Outline
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.problem.boundary_terms import robin_value, terms_of_sides
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["BoundaryTerms"]


@dataclass(frozen=True)
class BoundaryTerms:
    """Robin terms of a functional on a moving triangulation.

    Attributes
    ----------
    ritz
        User-defined functional.
    chains
        Curve segments of every named Robin boundary, (c,) bool.
    on
        Curve segments of all Robin boundaries, (c,) bool.
    """

    ritz: Ritz
    chains: dict[str, Mask]
    on: Mask

    @classmethod
    def of(cls, ritz: Ritz, outline: Outline) -> "BoundaryTerms":
        chains = {name: outline.names[name] != 0 for name in ritz.robin}
        return cls(ritz, chains, np.any([np.zeros(len(outline.straight), bool), *chains.values()], axis=0))

    def nodes(self, triangulation: Triangulation) -> Mask:
        elements = triangulation.elements
        found = np.zeros(triangulation.nnodes, bool)
        found[np.concatenate(elements.ends(*sides_on(elements.chain, self.on)))] = True
        return found

    def value(self, chain: Ints, corners: Floats, coefficients: Floats, offset: Floats | None = None) -> float:
        # `chain` (m, 3) holds the curve segment of every side, `corners` (2, 3, m) and `coefficients` (k, m) belong
        # to the elements, and `offset` (2, 3, m) holds the midside offsets.
        total = 0.0
        for name, chains in self.chains.items():
            sides = sides_on(chain, chains)
            terms = self.ritz.robin[name]
            total += robin_value(corners, coefficients, sides, terms, self.ritz.axisymmetric, offset)
        return total

    def terms(self, chain: Ints, corners: Floats, offset: Floats | None) -> Iterator[tuple[IntsPair, Floats, Floats]]:
        """Return the terms of every condition by `terms_of_sides`, for `value`."""
        for name, chains in self.chains.items():
            data = self.ritz.order, self.ritz.robin[name], self.ritz.axisymmetric, offset
            yield terms_of_sides(corners, sides_on(chain, chains), *data)


def sides_on(chain: Ints, chains: Mask) -> IntsPair:
    e, k = np.nonzero(on_chains(chain, chains))
    return e, k
