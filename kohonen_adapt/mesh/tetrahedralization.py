"""Tetrahedral mesh as arrays that kernels change."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask
from kohonen_adapt.kernels.tetrahedron.arrays import Star, Tetrahedra
from kohonen_adapt.kernels.tetrahedron.geometry import fill_star
from kohonen_adapt.mesh.cells import FACES, TETRAHEDRON
from kohonen_adapt.mesh.tessellation import Tessellation

__all__ = ["Tetrahedralization", "faces_of", "faces_on"]


@dataclass
class Tetrahedralization(Tessellation[Tetrahedra, Star]):
    cell = TETRAHEDRON
    groups = "space locating", "space carrying"
    crowd = 8  # tetrahedra meet many cells, hence fewer and larger cells

    @classmethod
    def _arrays(cls, node: Ints, neighbour: Ints, region: Ints) -> Tetrahedra:
        return Tetrahedra(node, neighbour, region, np.full_like(node, -1))

    def _new_star(self) -> Star:
        star = Star.of(self.nnodes, len(self.elements.node))
        fill_star(self.elements.node, star)
        return star

    def volumes(self) -> Floats:
        a, b, c, d = self.position[self.elements.node[self.used]].transpose(1, 0, 2)
        return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6.0


def faces_of(elements: Tetrahedra, element: Ints, corner: Ints) -> Ints:
    """Return the nodes (f, 3) of the faces of elements opposite to corners."""
    return elements.node[element[:, None], FACES[corner]]


def faces_on(elements: Tetrahedra, patches: Mask) -> IntsPair:
    """Return elements and opposite corners of the faces on some patches."""
    element, corner = np.nonzero(np.append(patches, False)[elements.patch] & (elements.node[:, :1] >= 0))
    return element, corner
