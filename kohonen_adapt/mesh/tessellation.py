"""Mesh as arrays that kernels change, and back with every name."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, copied
from kohonen_adapt.mesh.adjacency import connected_arrays
from kohonen_adapt.mesh.cells import Cell
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.host import remade
from kohonen_adapt.mesh.names import regions_of, subdomains_of
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["AnyTessellation", "Tessellation"]

ElementArrays = TypeVar("ElementArrays", bound=Any)
StarArrays = TypeVar("StarArrays", bound=Any)


@dataclass
class Tessellation(Generic[ElementArrays, StarArrays]):
    """Working copy of a mesh as arrays, which kernels may change.

    Attributes
    ----------
    position
        Nodes (n, d).
    elements
        Arrays of the kernels. Rows of ``node`` that begin with -1 are unused.
    mesh
        The input mesh, of curved elements the straight ones, for its names and cached connectivity.
    region_of_input
        Region of every element of the input mesh.
    """

    position: Floats
    elements: ElementArrays
    mesh: Mesh
    region_of_input: Ints
    _star: StarArrays | None = None

    cell: ClassVar[Cell]
    groups: ClassVar[Sequence[str]]  # groups of `kernels/entries.py` that search elements
    crowd: ClassVar[int]  # elements per cell of the grid of a search

    @classmethod
    def of(cls, mesh: Mesh) -> Self:
        check_mesh(mesh, inverted=True, space=cls.cell.dim == 3)
        position, node, neighbour = connected_arrays(mesh)
        mesh = corners_of(mesh)
        element, corner = np.nonzero(neighbour > np.arange(len(neighbour))[:, None])
        region = regions_of(mesh, np.stack([element, neighbour[element, corner]]))
        return cls(position, cls._arrays(node, neighbour, region.copy()), mesh, region)

    @classmethod
    def _arrays(cls, node: Ints, neighbour: Ints, region: Ints) -> ElementArrays:
        raise NotImplementedError

    def _new_star(self) -> StarArrays:
        raise NotImplementedError

    @property
    def nnodes(self) -> int:
        return len(self.position)

    @property
    def star(self) -> StarArrays:
        if self._star is None:
            self._star = self._new_star()
        return self._star

    @property
    def used(self) -> Ints:
        return np.flatnonzero(self.elements.node[:, 0] >= 0)

    def copy(self) -> Self:
        position, elements = self.position.copy(), copied(self.elements)
        return replace(self, position=position, elements=elements, _star=self._star and copied(self._star))

    def set_arrays(self, position: Floats, elements: ElementArrays) -> None:
        self.position, self.elements, self._star = position, elements, None

    def centroids(self) -> Floats:
        # np.take is faster than indexing
        return np.mean([np.take(self.position, nodes, axis=0) for nodes in self.elements.node[self.used].T], axis=0)

    def to_mesh(self) -> Mesh:
        used, mesh = self.used, self.mesh
        t = np.ascontiguousarray(self.elements.node[used].T).astype(mesh.t.dtype)
        if np.array_equal(np.sort(t, axis=0), np.sort(mesh.t, axis=0)):
            t = mesh.t.copy()
        subdomains = subdomains_of(mesh, self.region_of_input, self.elements.region[used])
        return remade(mesh, np.ascontiguousarray(self.position.T), t, boundaries=None, subdomains=subdomains)


AnyTessellation = Tessellation[Any, Any]
