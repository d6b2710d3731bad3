"""Size, orientation and quality of elements, and curved edges in space."""

from dataclasses import replace
from functools import reduce
from itertools import permutations, product
from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh, MeshTet, MeshTet2
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import (
    CELLS,
    LARGEST_EXTENT,
    LEAST_EXTENT,
    TETRAHEDRON,
    cell_of,
    check_kind,
)
from kohonen_adapt.mesh.curved import (
    LATTICE,
    STRAIGHT,
    CurvedElements,
    Isoparametric,
    check_inverted,
    check_midsides,
    corner_positions,
    corners_of,
    is_second_order,
    jacobian_coefficients,
    least_determinants,
    midside_offsets,
)
from kohonen_adapt.mesh.elements.rules import tetrahedron_rule
from kohonen_adapt.mesh.host import number_edges, number_facets, of_kind

__all__ = [
    "EDGES",
    "CurvedTetrahedra",
    "area",
    "check_curved_sides",
    "determinant_coefficients",
    "directed",
    "edge_midside_offsets",
    "gradient",
    "hat_gradients",
    "inner_points",
    "is_in_front",
    "isoparametric",
    "magnitude",
    "quality",
    "signed_area",
    "tangent_corners",
    "unit_vectors",
    "with_edge_offsets",
]

EDGES = np.transpose(RefTet.edges)  # (2, 6): corners of edges, in the order of scikit-fem
BY_CORNER = np.argsort(TETRAHEDRON.opposite)  # rows of `t2f` by opposite corner
OF_DETERMINANTS = 3  # degree of determinants of a quadratic map


def signed_area(mesh: Mesh) -> Floats:
    """Return the signed area of triangles, or the volume of tetrahedra, (nelements,).

    The sign is positive if the nodes run counter-clockwise. In space it is positive if corners 1, 2, 3 run clockwise as
    seen from corner 0. scikit-fem sorts the nodes of elements, so that about half of the signs in a valid mesh are
    negative. An element is inverted if its sign differs from the sign before its nodes moved. For a `MeshTri2`
    or `MeshTet2` the corners count.
    """
    cell = cell_of(mesh)
    return cell.determinant(mesh.p[:, mesh.t]) / factorial(cell.dim)


def edges_of(mesh: Mesh) -> Floats:
    corners, (one, other) = mesh.p[:, mesh.t], np.transpose(cell_of(mesh).edges)
    return corners[:, one] - corners[:, other]


def area(mesh: Mesh) -> Floats:
    """Return the area or volume |K| of every element, (nelements,), in mesh units.

    The mean of the Bernstein coefficients of the determinant is twice the area.
    """
    if not is_second_order(mesh):
        return np.abs(signed_area(mesh))
    if len(mesh.p) == 3:
        return curved_volumes(mesh)
    return 0.5 * np.abs(jacobian_coefficients(corner_positions(mesh), midside_offsets(mesh)).mean(axis=1))


def is_in_front(corners: Floats, point: Floats) -> Mask:
    """Return True for points in front of facets.

    `corners` has shape (d, d, n), `point` (d, n). In front means to the left of a line, or on the side of a triangle
    from which its corners run clockwise. An element is in front of its facets if these run counter-clockwise around the
    element, or counter-clockwise as seen from outside.
    """
    cell = CELLS[len(point)]
    return (-1) ** cell.dim * cell.determinant(np.concatenate([corners, point[:, None]], axis=1)) > 0.0


def directed(mesh: Mesh, facets: Ints, which: Ints) -> Ints:
    corners = mesh.facets[:, facets]
    element = np.where(mesh.f2t[which, facets] < 0, mesh.f2t[0, facets], mesh.f2t[which, facets])
    right = is_in_front(mesh.p[:, corners], mesh.p[:, mesh.t[:, element]].mean(axis=1))
    return np.where(right, corners, corners[[1, 0, *range(2, len(corners))]]).T


def quality(mesh: Mesh) -> Floats:
    """Return the quality of every element, 1 if regular and 0 if flat.

    For a triangle with edge lengths a, b, c the quality is ``4 sqrt(3) |K| / (a^2 + b^2 + c^2)`` (Bank's measure; Bank
    and Smith, SIAM J. Numer. Anal. 34, 1997). For a tetrahedron it is ``12 (3 |K|)^(2/3) / (sum of the six squared edge
    lengths)`` (the mean ratio; Liu and Joe, BIT 34, 1994). For a `skfem.MeshTri2` or `MeshTet2` the straight elements
    between the corners count.

    Parameters
    ----------
    mesh
        A mesh of triangles or of tetrahedra.

    Returns
    -------
    ndarray (nelements,)
        Values from 0 to 1.

    Raises
    ------
    ValueError
        If the mesh is not a `skfem.MeshTri`, `MeshTri2`, `MeshTet` or `MeshTet2`, or if curved sides invert an
        element, which its quality would not show.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> ka.quality(skfem.MeshTri()).round(3).tolist()  # half a square is 0.866
    [0.866, 0.866]
    >>> ka.quality(skfem.MeshTet()).round(3).tolist()  # a cube in five: four corners around a regular one
    [0.84, 0.84, 0.84, 1.0, 0.84]
    """
    check_kind(mesh, curved=True, space=True)
    largest = np.abs(mesh.doflocs).max(initial=0.0)
    if largest < LEAST_EXTENT or largest > LARGEST_EXTENT:
        # areas and volumes would underflow or overflow, and 0 is the quality of a flat element
        mesh = replace(mesh, doflocs=np.ldexp(mesh.doflocs, -np.frexp(largest)[1]))
    if is_second_order(mesh):
        check_midsides(mesh)
        check_curved_sides(mesh)
    cell = cell_of(mesh)
    return cell.regular * np.abs(signed_area(mesh)) ** (2 / cell.dim) / np.sum(edges_of(mesh) ** 2, axis=(0, 1))


def hat_gradients(mesh: Mesh) -> Floats:
    return cell_of(mesh).hat_gradients(mesh.p[:, mesh.t])


def gradient(mesh: Mesh, values: ArrayLike, hats: Floats | None = None) -> Floats:
    hats = hat_gradients(mesh) if hats is None else hats
    return np.einsum("ik,cik->ck", np.asarray(values, dtype=float)[mesh.t], hats)


def inner_points(corners: Floats) -> Floats:
    """Return the points of a quadrature of degree 2, (d, d + 1, m).

    `corners` has the same shape. Each point lies on the line from the centroid to a corner, at a fraction of 1/2 in the
    plane and of 1 / sqrt(5) in space. The mean over the points is exact for polynomials of degree 2 (Strang and Fix,
    1973; Hammer, Marlowe and Stroud, 1956).
    """
    fraction = (len(corners) + 2.0) ** -0.5
    return fraction * corners + (1.0 - fraction) * corners.mean(axis=1, keepdims=True)


def magnitude(vectors: Floats) -> Floats:
    return reduce(np.hypot, vectors)


def unit_vectors(vectors: Floats) -> Floats:  # zero for zero
    size = magnitude(vectors)
    return vectors / np.where(size > 0.0, size, 1.0)


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

    def quadrature(self, rows: Ints, degree: int) -> tuple[Floats, Ints, Floats]:
        # points (3, n) in some elements, their elements and volumes
        barycentric, weight = tetrahedron_rule(degree)
        element, at = np.tile(rows, weight.size), np.repeat(barycentric.T, rows.size, axis=1)
        corners = tangent_corners(self.p[:, self.t[:, element]], self.offset[:, :, element], at)
        volumes = np.abs(TETRAHEDRON.determinant(corners)) / 6.0
        return self.points(element, at), element, np.repeat(weight, rows.size) * volumes


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
