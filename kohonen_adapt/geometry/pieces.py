"""Parts of elements, and the mesh that they form."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from skfem import Mesh
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.curved import Isoparametric, inverted_elements, with_midside_offsets
from kohonen_adapt.mesh.host import facets_opposite, set_boundaries
from kohonen_adapt.mesh.joining import sides_of

__all__ = ["FoldedLayers", "Pieces", "curved_mesh", "mesh_of", "sides_in_parent"]


class FoldedLayers(ValueError):
    """Layers would invert elements at a curve.

    Attributes
    ----------
    elements
        Elements of the mesh without layers whose parts would be inverted.
    nodes
        Their corners.
    """

    def __init__(self, elements: Ints, nodes: Ints) -> None:
        self.elements, self.nodes = elements, nodes
        super().__init__(
            "layers at the nodes would invert elements at a curve, because its facets turn too far. Refine the mesh "
            "along the curve first, or leave out the nodes at its ends."
        )


class Pieces(NamedTuple):
    """Triangles or tetrahedra that lie in the elements of a mesh, their parents."""

    node: Ints  # (m, d + 1): corners; new nodes follow the nodes of the mesh
    parent: Ints  # (m,): element that the part lies in
    share: Floats  # (m, d + 1, d + 1): barycentric coordinates of the corners in the parent

    @classmethod
    def of(cls, t: Ints) -> Self:
        corners, count = t.shape
        return cls(t.T.astype(np.int64), np.arange(count), np.tile(np.eye(corners), (count, 1, 1)))

    def select(self, rows: Ints | Mask) -> "Pieces":
        return Pieces(self.node[rows], self.parent[rows], self.share[rows])

    def replaced(self, rows: Ints, parts: Sequence["Pieces"]) -> "Pieces":
        kept = self.select(np.delete(np.arange(len(self.node)), rows))
        return Pieces(*map(np.concatenate, zip(kept, *parts, strict=True)))


def mesh_of(pieces: Pieces, mesh: Mesh, shape: Isoparametric) -> Mesh:
    """Return the straight mesh of parts, with the names of the mesh of their parents.

    New nodes lie where `shape`, the curved elements of `mesh`, has their barycentric coordinates.
    """
    dim, old = shape.p.shape
    p = np.empty((dim, int(pieces.node.max()) + 1))
    p[:, :old] = shape.p
    number, first = np.unique(pieces.node.ravel(), return_index=True)
    number, first = number[number >= old], first[number >= old]
    p[:, number] = shape.points(pieces.parent[first // (dim + 1)], pieces.share.reshape(-1, dim + 1)[first].T)
    made = type(shape.corners)(p, np.ascontiguousarray(pieces.node.T))
    made = made.with_subdomains(
        {name: np.flatnonzero(np.isin(pieces.parent, rows)) for name, rows in (mesh.subdomains or {}).items()}
    )
    if mesh.boundaries is not None:
        facet, on_side = facets_opposite(made, pieces.node.astype(np.int32)), sides_in_parent(pieces.share)
        args = made, facet, pieces.parent, on_side, shape.corners
        set_boundaries(made, {name: divided_boundary(*args, rows) for name, rows in mesh.boundaries.items()})
    return made


def curved_mesh(made: Mesh, offset: Floats, pieces: Pieces, shape: Isoparametric) -> Mesh:
    # the result of `mesh_of` with midside offsets (d, nsides)
    curved = with_midside_offsets(made, offset)
    inverted = inverted_elements(curved)
    if inverted.size:
        folded = np.unique(pieces.parent[inverted])
        raise FoldedLayers(folded, np.unique(shape.t[:, folded]))
    return curved


def sides_in_parent(share: Floats) -> Mask:
    # Return a mask of sides k that lie on sides j of the parents, (m, d + 1, d + 1).
    on = share == 0.0
    return np.stack([np.delete(on, k, axis=1).all(axis=1) for k in range(on.shape[1])], axis=1)


def divided_boundary(mesh: Mesh, facet: Ints, parent: Ints, on_side: Mask, before: Mesh, rows: Ints) -> Ints:
    sides = sides_of(before, rows)
    meant = len(rows) if sides.oriented else len(sides.element)  # `sides_of` lists the oriented side first
    named = np.zeros(before.t.shape[::-1], bool)
    named[sides.element[:meant], sides.corner[:meant]] = True
    e, k = np.nonzero(np.any(on_side & named[parent][:, None], axis=2))
    number, first = np.unique(facet[e, k], return_index=True)
    if not sides.oriented:
        return number
    return OrientedBoundary(number, (mesh.f2t[0, number] != e[first]).astype(np.int64))
