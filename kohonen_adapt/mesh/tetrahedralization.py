"""Tetrahedral mesh as arrays that kernels change, and back with every name."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.tetrahedron.arrays import Star, Tetrahedra
from kohonen_adapt.kernels.tetrahedron.geometry import fill_star
from kohonen_adapt.mesh.adjacency import neighbours_of, positive, refuse_overlap
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.host import remade
from kohonen_adapt.mesh.names import regions_of, subdomains_of
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["Tetrahedralization"]


@dataclass
class Tetrahedralization:
    """Working copy of a tetrahedral mesh as arrays, which kernels may change.

    Attributes
    ----------
    position
        Nodes (n, 3).
    elements
        Arrays of `kernels/tetrahedron/arrays.py`. Rows of ``node`` that begin with -1 are unused.
    mesh
        The input mesh, of a `MeshTet2` its straight tetrahedra, for its names and numbered facets.
    region_of_input
        Region of every element of the input mesh.
    """

    position: Floats
    elements: Tetrahedra
    mesh: MeshTet
    region_of_input: NDArray[np.int32]
    _star: Star | None = None

    @classmethod
    def of(cls, mesh: MeshTet) -> "Tetrahedralization":
        if cell_of(mesh) is not TETRAHEDRON:
            raise ValueError(f"mesh must be a skfem.MeshTet; got {type(mesh).__name__}.")
        check_mesh(mesh, curved=True, inverted=True, space=True)
        mesh = corners_of(mesh)
        position = np.ascontiguousarray(mesh.p.T, dtype=np.float64)
        node = positive(position, mesh.t)
        neighbour = neighbours_of(node, position)
        refuse_overlap(mesh, position, node, neighbour)
        region = regions_of(mesh, neighbour)
        return cls(position, Tetrahedra(node, neighbour, region.copy(), np.full_like(node, -1)), mesh, region)

    @property
    def nnodes(self) -> int:
        return len(self.position)

    @property
    def star(self) -> Star:
        if self._star is None:
            self._star = Star.of(self.nnodes, len(self.elements.node))
            fill_star(self.elements.node, self._star)
        return self._star

    @property
    def used(self) -> Ints:
        return np.flatnonzero(self.elements.node[:, 0] >= 0)

    def copy(self) -> "Tetrahedralization":
        elements = Tetrahedra(*(array.copy() for array in self.elements))
        return replace(self, position=self.position.copy(), elements=elements, _star=None)

    def set_arrays(self, position: Floats, elements: Tetrahedra) -> None:
        self.position, self.elements, self._star = position, elements, None

    def volumes(self) -> Floats:
        a, b, c, d = self.position[self.elements.node[self.used]].transpose(1, 0, 2)
        return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6.0

    def centroids(self) -> Floats:
        return self.position[self.elements.node[self.used]].mean(axis=1)

    def to_mesh(self) -> MeshTet:
        used, mesh = self.used, self.mesh
        t = np.ascontiguousarray(self.elements.node[used].T).astype(mesh.t.dtype)
        if np.array_equal(t, positive(mesh.p.T, mesh.t).T):
            t = mesh.t.copy()
        subdomains = subdomains_of(mesh, self.region_of_input, self.elements.region[used])
        position = np.ascontiguousarray(self.position.T)
        return remade(mesh, position, t, boundaries=None, subdomains=subdomains)
