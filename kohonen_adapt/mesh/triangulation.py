"""Triangular mesh as arrays that kernels change, and back with every name."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.threads import LIGHT, even_cuts, shared
from kohonen_adapt.kernels.triangle.arrays import Elements, Star
from kohonen_adapt.kernels.triangle.geometry import fill_star, find_starts
from kohonen_adapt.mesh.adjacency import neighbours_of, positive, refuse_overlap
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.host import ascending, remade
from kohonen_adapt.mesh.names import regions_of, subdomains_of
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["Triangulation"]


@dataclass
class Triangulation:
    """Working copy of a triangular mesh as arrays, which kernels may change.

    Attributes
    ----------
    position
        Nodes (n, 2).
    elements
        Arrays of `kernels/triangle/arrays.py`.
    mesh
        The input mesh, of a `MeshTri2` its straight triangles, for its names and cached connectivity.
    region_of_input
        Region of every element of the input mesh.
    """

    position: Floats
    elements: Elements
    mesh: MeshTri
    region_of_input: NDArray[np.int32]
    _star: Star | None = None

    @classmethod
    def of(cls, mesh: MeshTri) -> "Triangulation":
        check_mesh(mesh, curved=True, inverted=True)
        drawn, mesh = mesh, corners_of(mesh)
        position = np.ascontiguousarray(mesh.p.T, dtype=np.float64)
        node = positive(position, mesh.t)
        neighbour = neighbours_of(node, position)
        refuse_overlap(drawn, position, node, neighbour)
        chain = np.full_like(node, -1)
        region = regions_of(mesh, neighbour)
        level, layered = np.zeros(len(position), dtype=np.int32), np.zeros(region.max() + 1, dtype=np.bool_)
        return cls(position, Elements(node, neighbour, region.copy(), chain, level, layered), mesh, region)

    @property
    def nnodes(self) -> int:
        return len(self.position)

    @property
    def star(self) -> Star:
        if self._star is None:
            self._star = star_of(self.elements.node, self.nnodes, [0, self.nnodes])
        return self._star

    def copy(self) -> "Triangulation":
        elements = Elements(*(array.copy() for array in self.elements))
        star = self._star and Star(*(array.copy() for array in self._star))
        return replace(self, position=self.position.copy(), elements=elements, _star=star)

    def set_arrays(self, position: Floats, elements: Elements) -> None:
        self.position, self.elements = position, elements
        if self._star is not None:
            self._star = star_of(elements.node, len(position), even_cuts(len(position), LIGHT))

    def refill_star(self) -> None:
        fill(self.star, self.elements.node, even_cuts(self.nnodes, LIGHT))

    def areas(self) -> Floats:
        a, b, c = self._corners()
        return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1]))

    def centroids(self) -> Floats:
        a, b, c = self._corners()
        return (a + b + c) / 3.0

    def _corners(self) -> list[Floats]:
        return [np.take(self.position, corner, axis=0) for corner in self.elements.node.T]  # faster than indexing

    def to_mesh(self) -> MeshTri:
        t, node = self.mesh.t, ascending(*self.elements.node.T)
        t = t.copy() if np.array_equal(node, ascending(*t)) else node.astype(t.dtype)
        position = np.ascontiguousarray(self.position.T)
        subdomains = subdomains_of(self.mesh, self.region_of_input, self.elements.region)
        return remade(self.mesh, position, t, boundaries=None, subdomains=subdomains)


def star_of(node: Ints, nnodes: int, cuts: Sequence[int]) -> Star:
    rows = [np.empty(node.size, dtype=np.int32) for _ in range(3)]
    star = Star(np.empty(nnodes + 1, dtype=np.int32), *rows)
    fill(star, node, cuts)
    return star


def fill(star: Star, node: Ints, cuts: Sequence[int]) -> None:
    cursor = np.empty(len(star.start) - 1, dtype=np.int32)
    find_starts(node, star.start)
    shared(lambda thread, first, last: fill_star(node, star, first, last, cursor), cuts)
