"""A scikit-fem mesh of tetrahedra as arrays (elements by region, neighbours, names), and back with every name."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet
from skfem.mesh import MeshTet1

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.tetrahedron.arrays import Star, Tetrahedra
from kohonen_adapt.kernels.tetrahedron.connectivity import fill_star
from kohonen_adapt.mesh.adjacency import neighbours_of, positive
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.host import number_facets, remade
from kohonen_adapt.mesh.names import regions_of, subdomains_of
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["FACES", "Tetrahedralization", "facet_of_face"]

FACES = np.array(TETRAHEDRON.outward)  # opposite to each, counter-clockwise from outside


@dataclass
class Tetrahedralization:
    """A working copy of a mesh that kernels may change; everything in it is its own.

    Attributes
    ----------
    position
        (n, 3): the one truth of where a node is.
    elements
        As `kernels/tetrahedron/arrays.py` describes them; those of rows that begin with -1 are no part of the mesh.
    mesh
        The mesh it came from: names, and facets that are numbered.
    region_of_input
        Region of every element of that mesh.
    """

    position: Floats
    elements: Tetrahedra
    mesh: MeshTet
    region_of_input: NDArray[np.int32]
    _star: Star | None = None

    @classmethod
    def of(cls, mesh: MeshTet) -> "Tetrahedralization":
        """Take a mesh apart; refused unless it is a valid `skfem.MeshTet` with no two elements on one another.

        No face has a patch yet.
        """
        if type(mesh) is not MeshTet1:
            raise ValueError(f"mesh must be a skfem.MeshTet; got {type(mesh).__name__}.")
        check_mesh(mesh, space=True)
        position = np.ascontiguousarray(mesh.p.T, dtype=np.float64)
        node = positive(position, mesh.t)
        neighbour = neighbours_of(node)
        region = regions_of(mesh, neighbour)
        return cls(position, Tetrahedra(node, neighbour, region.copy(), np.full_like(node, -1)), mesh, region)

    @property
    def nnodes(self) -> int:
        """Number of nodes."""
        return len(self.position)

    @property
    def star(self) -> Star:
        """The elements around every node, worked out when first asked for."""
        if self._star is None:
            self._star = Star.of(self.nnodes, len(self.elements.node))
            fill_star(self.elements.node, self._star)
        return self._star

    @property
    def used(self) -> Ints:
        """The rows of the elements that the mesh has, in order."""
        return np.flatnonzero(self.elements.node[:, 0] >= 0)

    def copy(self) -> "Tetrahedralization":
        """The tetrahedralization as it is now."""
        elements = Tetrahedra(*(array.copy() for array in self.elements))
        return replace(self, position=self.position.copy(), elements=elements, _star=None)

    def become(self, position: Floats, elements: Tetrahedra) -> None:
        """Take other nodes and elements, of the same regions, which are not copied."""
        self.position, self.elements, self._star = position, elements, None

    def volumes(self) -> Floats:
        """Volume of every element that the mesh has, (m,)."""
        a, b, c, d = self.position[self.elements.node[self.used]].transpose(1, 0, 2)
        return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6.0

    def centroids(self) -> Floats:
        """Centroid of every element that the mesh has, (m, 3)."""
        return self.position[self.elements.node[self.used]].mean(axis=1)

    def to_mesh(self) -> MeshTet:
        """The mesh as it is now, with its subdomains and without its boundaries (see `MovableSolid.mesh`)."""
        used, mesh = self.used, self.mesh
        t = np.ascontiguousarray(self.elements.node[used].T).astype(mesh.t.dtype)
        if np.array_equal(t, positive(mesh.p.T, mesh.t).T):
            t = mesh.t.copy()
        subdomains = subdomains_of(mesh, self.region_of_input, self.elements.region[used])
        position = np.ascontiguousarray(self.position.T)
        return remade(mesh, position, t, boundaries=None, subdomains=subdomains)


def facet_of_face(mesh: MeshTet, node: NDArray[np.int32]) -> NDArray[np.int32]:
    """Number of the facet opposite to each corner of the elements, whose corners may stand in another order, (m, 4)."""
    number_facets(mesh)
    facet = np.empty_like(node)
    for row in range(4):  # scikit-fem's facets of an element: corners 012, 013, 023, 123
        corner = np.argmax(node == mesh.t[3 - row][:, None], axis=1)
        facet[np.arange(len(node)), corner] = mesh.t2f[row]
    return facet
