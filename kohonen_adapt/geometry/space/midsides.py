"""Midside nodes on curved surfaces.

An edge that would bring a Jacobian determinant near zero or below stays straight, as in every element with two faces on
one smooth surface, which would be flat at the common edge.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.space.patches import Faces, Patches, on_their_patches
from kohonen_adapt.kernels.tetrahedron.arrays import Tetrahedra
from kohonen_adapt.kernels.triangle.polish.by_points import MIN_JACOBIAN
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.curved import STRAIGHT, determinant_coefficients, offsets_of_sides
from kohonen_adapt.mesh.host import edges_between, number_edges
from kohonen_adapt.mesh.tetrahedralization import faces_of

__all__ = ["NO_EDGES", "InputEdges", "offsets_on_surfaces"]


class InputEdges(NamedTuple):
    ends: Floats  # (k, 2, 3): positions of both ends, which do not move
    offset: Floats  # (k, 3)

    @classmethod
    def of(cls, mesh: MeshTet, faces: Faces, patches: Patches) -> "InputEdges":
        # Curved edges of a `MeshTet2` on plane patches only, which are facets of a surface that is not recognised.
        moves = patches.moves[patches.of_face]
        flat, curved = edges_of(mesh, faces.nodes[~moves]), edges_of(mesh, faces.nodes[moves])
        offset, own = offsets_of_sides(mesh), np.setdiff1d(flat, curved)
        own = own[offset[:, own].any(axis=0)]
        return cls(mesh.p.T[mesh.edges[:, own].T], offset[:, own].T)


NO_EDGES = InputEdges(np.zeros((0, 2, 3)), np.zeros((0, 3)))


def offsets_on_surfaces(
    mesh: MeshTet, elements: Tetrahedra, patches: Patches, input_edges: InputEdges = NO_EDGES
) -> tuple[Floats, Mask]:
    # The midside offsets of edges, (3, nedges), and the edges that stay straight. `mesh` are the tetrahedra of
    # `elements`. The midside node of an edge on curved patches is the projection of the middle of the edge.
    number_edges(mesh)
    e, k = np.nonzero((elements.patch >= 0) & (elements.node[:, :1] >= 0))
    edge = edges_of(mesh, faces_of(elements, e, k))
    start, end = mesh.p[:, mesh.edges].swapaxes(0, 1)
    middle = 0.5 * (start + end)
    there = on_their_patches(edge, patches._replace(of_face=elements.patch[e, k]), middle.T)
    offset = there.T - middle
    offset[:, np.linalg.norm(offset, axis=0) <= STRAIGHT * np.linalg.norm(end - start, axis=0)] = 0.0
    if len(input_edges.ends):
        own = rows_in_edges(mesh, input_edges.ends)
        offset[:, own[own >= 0]] = input_edges.offset[own >= 0].T
    curved = offset.any(axis=0)
    offset[:, _folding(mesh, offset)] = 0.0
    return offset, curved & ~offset.any(axis=0)


def edges_of(mesh: MeshTet, faces: Ints) -> Ints:
    return edges_between(mesh, faces, np.roll(faces, -1, axis=1))


def rows_in_edges(mesh: MeshTet, ends: Floats) -> Ints:
    # Indices of edges by the positions of their ends (k, 2, 3), -1 for none.
    distance, nodes = cKDTree(mesh.p.T).query(ends.reshape(-1, 3))
    pairs, found = nodes.reshape(-1, 2), np.all(distance.reshape(-1, 2) == 0.0, axis=1)
    row = edges_between(mesh, pairs[:, 0], pairs[:, 1]).clip(max=mesh.edges.shape[1] - 1)
    return np.where(found & np.all(np.sort(pairs, axis=1) == mesh.edges[:, row].T, axis=1), row, -1)


def _folding(mesh: MeshTet, offset: Floats) -> Ints:
    # An element that would fold gets the straight edge with which its determinants are largest.
    before, touched = (np.asarray(offset.any(axis=0)) for _ in range(2))
    offset = offset.copy()
    while touched.any():
        rows = np.flatnonzero(touched[mesh.t2e].any(axis=0))
        rows = rows[_least(mesh, rows, offset[:, mesh.t2e[:, rows]]) < MIN_JACOBIAN]
        found = np.full((6, rows.size), -np.inf)
        for k, least in enumerate(found):
            tried = offset[:, mesh.t2e[:, rows]]
            curved = tried[:, k].any(axis=0)
            tried[:, k] = 0.0
            least[curved] = _least(mesh, rows, tried)[curved]
        edge = mesh.t2e[np.argmax(found, axis=0), rows]
        offset[:, edge] = 0.0
        touched[:] = False
        touched[edge] = True
    return np.flatnonzero(before & ~offset.any(axis=0))


def _least(mesh: MeshTet, rows: Ints, offset: Floats) -> Floats:
    corners = mesh.p[:, mesh.t[:, rows]]
    return np.asarray((determinant_coefficients(corners, offset) / TETRAHEDRON.determinant(corners)).min(axis=0))
