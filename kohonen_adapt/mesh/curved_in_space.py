"""Curved edges of a `MeshTet2`, and points in curved tetrahedra.

An element is the image of ``x = sum_i lambda_i x_i + 4 sum_k lambda_a lambda_b d_k`` with the midside offsets d_k of
the edges from a to b, in the order of scikit-fem. At every point the map has the derivatives of the straight
tetrahedron with the corners ``x_i + 4 sum_k lambda_b d_k``, summed over the edges from i to b (`tangent_corners`).
"""

from itertools import permutations, product

import numpy as np
from skfem import Mesh, MeshTet, MeshTet2
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.mesh.cells import TETRAHEDRON, tetrahedron_rule
from kohonen_adapt.mesh.curved import (
    LATTICE,
    STRAIGHT,
    CurvedElements,
    Isoparametric,
    check_inverted,
    corners_of,
    is_second_order,
    least_determinants,
)
from kohonen_adapt.mesh.host import number_edges, number_facets, of_kind

__all__ = [
    "EDGES",
    "CurvedTetrahedra",
    "check_curved_sides",
    "curved_volumes",
    "determinant_coefficients",
    "edge_midside_offsets",
    "isoparametric",
    "tangent_corners",
    "with_edge_offsets",
]

EDGES = np.transpose(RefTet.edges)  # (2, 6): corners of edges, in the order of scikit-fem
BY_CORNER = np.argsort(TETRAHEDRON.opposite)  # rows of `t2f` by opposite corner
OF_DETERMINANTS = 3  # degree of determinants of a quadratic map


def tangent_corners(corners: Floats, offset: Floats, barycentric: Floats) -> Floats:
    # (3, 4, m), of corners of the same shape, offsets (3, 6, m) and points (4, m) or (4, 1)
    found = corners.copy()
    for k, (a, b) in enumerate(EDGES.T):
        found[:, a] += 4.0 * barycentric[b] * offset[:, k]
        found[:, b] += 4.0 * barycentric[a] * offset[:, k]
    return found


def determinant_coefficients(corners: Floats, offset: Floats) -> Floats:
    # Bernstein coefficients of the Jacobian determinants, (4, 4, 4, m), symmetric in the first three axes and relative
    # to the determinant of the straight element. The smallest is a lower bound, as of `jacobian_coefficients`.
    at = np.stack([tangent_corners(corners, offset, corner[:, None]) for corner in np.eye(4)])
    one, two, three = (at[:, :, k] - at[:, :, 0] for k in (1, 2, 3))
    normal = np.cross(two[:, None], three[None], axis=2)
    found = np.einsum("icm,jkcm->ijkm", one, normal) / TETRAHEDRON.determinant(corners)
    return np.mean([found.transpose(*order, 3) for order in permutations(range(3))], axis=0)


def edge_midside_offsets(mesh: MeshTet) -> Floats:
    number_edges(mesh)
    if not is_second_order(mesh):
        return np.zeros((3, mesh.edges.shape[1]))
    start, end = mesh.p[:, mesh.edges].swapaxes(0, 1)
    offset = mesh.p[:, mesh.nvertices :] - 0.5 * (start + end)
    curved = np.linalg.norm(offset, axis=0) > STRAIGHT * np.linalg.norm(end - start, axis=0)
    return np.where(curved, offset, 0.0)


def with_edge_offsets(mesh: MeshTet, offset: Floats) -> MeshTet:
    if not offset.any():
        return mesh
    number_edges(mesh)
    return of_kind(MeshTet2, np.hstack([mesh.p, mesh.p[:, mesh.edges].mean(axis=1) + offset]), mesh)


class CurvedTetrahedra(CurvedElements):
    # elements of a mesh with straight (`MeshTet`) or curved (`MeshTet2`) edges
    def __init__(self, mesh: MeshTet) -> None:
        self.corners = corners = corners_of(mesh)  # with the same elements, facets, edges and names
        number_facets(corners)
        self.edge_offset = edge_midside_offsets(mesh)  # (3, nedges)
        number_edges(corners)
        sides = corners.t2f[BY_CORNER]
        neighbour = corners.f2t.sum(axis=0)[sides] - np.arange(sides.shape[1])  # -1 at the outer boundary
        super().__init__(corners.p, corners.t, self.edge_offset[:, corners.t2e], neighbour)

    @property
    def curved_sides(self) -> Mask:
        curved = np.any(self.offset, axis=0)
        return np.stack([curved[np.all(corner != EDGES, axis=0)].any(axis=0) for corner in range(4)])

    def points(self, element: np.ndarray, barycentric: Floats) -> Floats:
        x = np.einsum("in,cin->cn", barycentric, self.p[:, self.t[:, element]])
        rows, (start, end) = np.flatnonzero(self.curved[element]), EDGES
        between = 4.0 * barycentric[start][:, rows] * barycentric[end][:, rows]
        x[:, rows] += np.sum(between * self.offset[:, :, element[rows]], axis=1)
        return x

    def in_straight(self, corner: Floats, x: Floats) -> Floats:
        return 0.25 + np.einsum("cin,cn->in", TETRAHEDRON.hat_gradients(corner), x - corner.mean(axis=1))

    def hat_gradients(self, element: np.ndarray, barycentric: Floats) -> Floats:
        corner = self.p[:, self.t[:, element]]
        return TETRAHEDRON.hat_gradients(tangent_corners(corner, self.offset[:, :, element], barycentric))


def isoparametric(mesh: Mesh) -> Isoparametric | CurvedTetrahedra:
    return CurvedTetrahedra(mesh) if len(mesh.p) == 3 else Isoparametric(mesh)


def curved_volumes(mesh: MeshTet) -> Floats:
    shape = CurvedTetrahedra(mesh)
    corners, rows = shape.p[:, shape.t], np.flatnonzero(shape.curved)
    six = np.abs(TETRAHEDRON.determinant(corners))
    six[rows] = sum(
        weight * np.abs(TETRAHEDRON.determinant(tangent_corners(corners[:, :, rows], shape.offset[:, :, rows], at)))
        for at, weight in zip(*tetrahedron_rule(OF_DETERMINANTS), strict=True)
    )
    return six / 6.0


def check_curved_sides(mesh: Mesh) -> None:
    if len(mesh.p) == 2:
        check_inverted("MeshTri2", np.flatnonzero(~(least_determinants(mesh) > 0.0)))
        return
    shape = CurvedTetrahedra(mesh)
    rows = np.flatnonzero(shape.curved)
    coefficients = determinant_coefficients(shape.p[:, shape.t[:, rows]], shape.offset[:, :, rows])
    doubtful = np.flatnonzero(~(coefficients.min(axis=(0, 1, 2)) > 0.0))
    at = np.array([each for each in product(range(LATTICE + 1), repeat=4) if sum(each) == LATTICE]) / LATTICE
    between = np.einsum("qi,qj,qk->qijk", at, at, at).reshape(len(at), -1)
    least = (between @ coefficients[..., doubtful].reshape(between.shape[1], -1)).min(axis=0)
    check_inverted("MeshTet2", rows[doubtful[~(least > 0.0)]])
