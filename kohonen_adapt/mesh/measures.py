"""Measure the triangles of a mesh: area, orientation, quality, and gradients of P1 functions."""

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
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
    "gradient",
    "hat_gradients",
    "inner_points",
    "is_left",
    "quality",
    "signed_area",
]


def signed_area(mesh: MeshTri) -> Floats:
    """Signed area of every element, (nelements,) in mesh units squared, positive where its nodes run counter-clockwise.

    scikit-fem sorts the nodes of an element, so about half of a good mesh's signed areas are negative. An element is
    overturned when its sign differs from the one it had before its nodes moved. Of a `MeshTri2` it is the corners'.
    """
    x, y = mesh.p[:, mesh.t]
    return 0.5 * ((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))


def area(mesh: MeshTri) -> Floats:
    """Area |K| of every element, (nelements,), in mesh units squared; of a `MeshTri2` between its bent sides.

    The mean of the Bernstein coefficients of a determinant is twice the area.
    """
    if not is_second_order(mesh):
        return np.abs(signed_area(mesh))
    return 0.5 * np.abs(jacobian_coefficients(corner_places(mesh), displacements(mesh)).mean(axis=1))


def is_left(start: Floats, end: Floats, point: Floats) -> Mask:
    """Whether points are on the left of the lines from start to end; all are (2, n)."""
    along, off = end - start, point - start
    return along[0] * off[1] > along[1] * off[0]


def directed(mesh: MeshTri, facets: Ints, which: Ints) -> Ints:
    """The ends of facets (m,), (m, 2), with the first or second of their elements on the left, as `which` says.

    On the rim it is the first in any case.
    """
    ends = mesh.facets[:, facets]
    element = np.where(mesh.f2t[which, facets] < 0, mesh.f2t[0, facets], mesh.f2t[which, facets])
    left = is_left(mesh.p[:, ends[0]], mesh.p[:, ends[1]], mesh.p[:, mesh.t[:, element]].mean(axis=1))
    return np.where(left, ends, ends[::-1]).T


def quality(mesh: MeshTri) -> Floats:
    """Quality of every element: 1 for an equilateral triangle, 0 for a flat one.

    ``4 sqrt(3) |K| / (a^2 + b^2 + c^2)`` with the edge lengths a, b, c (Bank's measure; Bank and Smith, SIAM J. Numer.
    Anal. 34, 1997). Of a `skfem.MeshTri2` it is that of the straight triangles between its corners.

    Parameters
    ----------
    mesh
        A triangular mesh.

    Returns
    -------
    ndarray (nelements,)
        Values from 0 to 1.

    Raises
    ------
    ValueError
        If the bent sides of a `skfem.MeshTri2` fold an element over: no quality of its corners makes up for that.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> ka.quality(skfem.MeshTri()).round(3).tolist()  # half a square is 0.866
    [0.866, 0.866]
    """
    if is_second_order(mesh):
        check_middles(mesh)
        check_bent(mesh)
    corners = mesh.p[:, mesh.t]
    edges = corners - np.roll(corners, 1, axis=1)
    return 4.0 * np.sqrt(3.0) * np.abs(signed_area(mesh)) / np.sum(edges**2, axis=(0, 1))


def hat_gradients(mesh: MeshTri) -> Floats:
    """Gradients of the three hat functions of every element, constant on it, (2, 3, nelements), per mesh unit.

    ``grad phi_i = (y_j - y_k, x_k - x_j) / (2 |K|)`` with i, j, k in the order of ``mesh.t`` and the area signed, so
    the orientation of an element does not matter.
    """
    x, y = mesh.p[:, mesh.t]
    along_x = x[[2, 0, 1]] - x[[1, 2, 0]]
    along_y = y[[1, 2, 0]] - y[[2, 0, 1]]
    twice_area = along_y[0] * along_x[1] - along_y[1] * along_x[0]
    return np.stack((along_y, along_x)) / twice_area


def gradient(mesh: MeshTri, values: ArrayLike, hats: Floats | None = None) -> Floats:
    """Gradient of the P1 function with these nodal values (nnodes,), (2, nelements), in their units per mesh unit.

    `hats` is what `hat_gradients` returns for this mesh, where it is at hand.
    """
    hats = hat_gradients(mesh) if hats is None else hats
    return np.einsum("ik,cik->ck", np.asarray(values, dtype=float)[mesh.t], hats)


def inner_points(corners: Floats) -> Floats:
    """Half-way from the middle of every element to its corners, (2, 3, m), for corners (2, 3, m).

    The mean over the three is that over the element for polynomials of degree 2 (Strang and Fix, 1973).
    """
    return 0.5 * (corners + corners.mean(axis=1, keepdims=True))
