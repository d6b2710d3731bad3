"""Triangular mesh as arrays that kernels change."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Ints
from kohonen_adapt.kernels.threads import LIGHT, even_cuts, shared
from kohonen_adapt.kernels.triangle.arrays import Elements, Star
from kohonen_adapt.kernels.triangle.geometry import fill_star, find_starts
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.tessellation import Tessellation

__all__ = ["Triangulation"]


@dataclass
class Triangulation(Tessellation[Elements, Star]):
    cell = TRIANGLE
    groups = "locating", "carrying"
    crowd = 1

    @classmethod
    def _arrays(cls, node: Ints, neighbour: Ints, region: Ints) -> Elements:
        level, layered = np.zeros(node.max() + 1, np.int32), np.zeros(region.max() + 1, bool)
        return Elements(node, neighbour, region, np.full_like(node, -1), level, layered)

    def _new_star(self) -> Star:
        rows = [np.empty(self.elements.node.size, np.int32) for _ in range(3)]
        star = Star(np.empty(self.nnodes + 1, np.int32), *rows)
        self._fill(star)
        return star

    def refill_star(self) -> None:
        self._fill(self.star)

    def _fill(self, star: Star) -> None:
        node, cursor = self.elements.node, np.empty(self.nnodes, np.int32)
        find_starts(node, star.start)
        cuts = even_cuts(self.nnodes, LIGHT)
        shared(lambda thread, first, last: fill_star(node, star, first, last, cursor), cuts)
