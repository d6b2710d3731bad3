"""Measure the elements of a mesh: area or volume, orientation, quality, and gradients of P1 functions."""

from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import CELLS, cell_of, check_kind
from kohonen_adapt.mesh.curved import (
    check_bent,
    check_middles,
    corner_places,
    displacements,
    is_second_order,
    jacobian_coefficients,
)

__all__ = [
    "area",
    "directed",
    "edges_of",
    "gradient",
    "hat_gradients",
    "inner_points",
    "is_in_front",
    "quality",
    "signed_area",
]


def signed_area(mesh: Mesh) -> Floats:
    """Signed area of every element, (nelements,) in mesh units squared, positive where its nodes run counter-clockwise.

    Of tetrahedra it is the volume, in mesh units cubed, positive where three run so seen from the fourth's far side.
    scikit-fem sorts the nodes of an element, so about half of a good mesh's signed areas are negative. An element is
    overturned when its sign differs from the one it had before its nodes moved. Of a `MeshTri2` it is the corners'.
    """
    cell = cell_of(mesh)
    return cell.determinant(mesh.p[:, mesh.t]) / factorial(cell.dim)


def edges_of(mesh: Mesh) -> Floats:
    """The edges of every element as vectors, (d, nedges, nelements), in the order of `Cell.edges`."""
    corners, (one, other) = mesh.p[:, mesh.t], np.transpose(cell_of(mesh).edges)
    return corners[:, one] - corners[:, other]


def area(mesh: Mesh) -> Floats:
    """Area |K| of every element, (nelements,), in mesh units squared; of a `MeshTri2` between its bent sides.

    Of tetrahedra it is the volume, in mesh units cubed.

    The mean of the Bernstein coefficients of a determinant is twice the area.
    """
    if not is_second_order(mesh):
        return np.abs(signed_area(mesh))
    return 0.5 * np.abs(jacobian_coefficients(corner_places(mesh), displacements(mesh)).mean(axis=1))


def is_in_front(corners: Floats, point: Floats) -> Mask:
    """Whether points (d, n) are in front of facets with these corners, (d, d, n).

    That is on the left of a line, and where a triangle is seen to run clockwise from: so it is for an element around
    which lines run counter-clockwise, or whose triangles do so as seen from outside.
    """
    cell = CELLS[len(point)]
    return (-1) ** cell.dim * cell.determinant(np.concatenate([corners, point[:, None]], axis=1)) > 0.0


def directed(mesh: Mesh, facets: Ints, which: Ints) -> Ints:
    """The corners of facets (m,), (m, d), so that the first or second of their elements is in front, as `which` says.

    On the rim it is the first in any case.
    """
    corners = mesh.facets[:, facets]
    element = np.where(mesh.f2t[which, facets] < 0, mesh.f2t[0, facets], mesh.f2t[which, facets])
    right = is_in_front(mesh.p[:, corners], mesh.p[:, mesh.t[:, element]].mean(axis=1))
    return np.where(right, corners, corners[[1, 0, *range(2, len(corners))]]).T


def quality(mesh: Mesh) -> Floats:
    """Quality of every element: 1 for a regular one, 0 for a flat one.

    ``4 sqrt(3) |K| / (a^2 + b^2 + c^2)`` of a triangle with the edge lengths a, b, c (Bank's measure; Bank and Smith,
    SIAM J. Numer. Anal. 34, 1997), ``12 (3 |K|)^(2/3) / (sum of the six squared edge lengths)`` of a tetrahedron (the
    mean ratio; Liu and Joe, BIT 34, 1994). Of a `skfem.MeshTri2` it is that of the straight triangles between its
    corners.

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
        If the mesh is neither a `skfem.MeshTri`, `skfem.MeshTri2` nor `skfem.MeshTet`, and if the bent sides of a
        `skfem.MeshTri2` fold an element over: no quality of its corners makes up for that.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> ka.quality(skfem.MeshTri()).round(3).tolist()  # half a square is 0.866
    [0.866, 0.866]
    >>> ka.quality(skfem.MeshTet()).round(3).tolist()  # a cube in five: four corners around a regular one
    [0.84, 0.84, 0.84, 1.0, 0.84]
    """
    check_kind(mesh, bent=True, space=True)
    if is_second_order(mesh):
        check_middles(mesh)
        check_bent(mesh)
    cell = cell_of(mesh)
    return cell.regular * np.abs(signed_area(mesh)) ** (2 / cell.dim) / np.sum(edges_of(mesh) ** 2, axis=(0, 1))


def hat_gradients(mesh: Mesh) -> Floats:
    """Gradients of the hat functions of every element, constant on it, (d, d + 1, nelements), per mesh unit.

    They are in the order of ``mesh.t``, and the orientation of an element does not matter.
    """
    return cell_of(mesh).hat_gradients(mesh.p[:, mesh.t])


def gradient(mesh: Mesh, values: ArrayLike, hats: Floats | None = None) -> Floats:
    """Gradient of the P1 function with these nodal values (nnodes,), (d, nelements), in their units per mesh unit.

    `hats` is what `hat_gradients` returns for this mesh, where it is at hand.
    """
    hats = hat_gradients(mesh) if hats is None else hats
    return np.einsum("ik,cik->ck", np.asarray(values, dtype=float)[mesh.t], hats)


def inner_points(corners: Floats) -> Floats:
    """Points on the way from the middle of every element to its corners, (d, d + 1, m), for corners (d, d + 1, m).

    Half-way in the plane, at 1 / sqrt(5) of it in space: the mean over them is that over the element for polynomials of
    degree 2 (Strang and Fix, 1973; Hammer, Marlowe and Stroud, 1956).
    """
    share = (len(corners) + 2.0) ** -0.5
    return share * corners + (1.0 - share) * corners.mean(axis=1, keepdims=True)
