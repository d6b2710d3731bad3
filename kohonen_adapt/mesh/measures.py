"""Size, orientation and quality of elements."""

from dataclasses import replace
from functools import reduce
from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import (
    CELLS,
    LARGEST_EXTENT,
    LEAST_EXTENT,
    TETRAHEDRON,
    cell_of,
    centroids_of,
    check_kind,
    corner_positions,
    crossed,
    determinants,
)
from kohonen_adapt.mesh.curved import check_curved_sides, check_midsides, curved_determinants, is_second_order

__all__ = [
    "EDGES",
    "angles_between",
    "area",
    "directed",
    "distances",
    "gradient",
    "hat_gradients",
    "inner_points",
    "is_in_front",
    "magnitude",
    "qualities_of",
    "quality",
    "signed_area",
    "unit_vectors",
]

EDGES = np.transpose(TETRAHEDRON.edges)  # (2, 6): corners of edges, in the order of scikit-fem


def signed_area(mesh: Mesh) -> Floats:
    """Return the signed area of triangles, or the volume of tetrahedra, (nelements,).

    The sign is positive if the nodes run counter-clockwise. In space it is positive if corners 1, 2, 3 run clockwise as
    seen from corner 0. scikit-fem sorts the nodes of elements, so that about half of the signs in a valid mesh are
    negative. An element is inverted if its sign differs from the sign before its nodes moved. For a `MeshTri2`
    or `MeshTet2` the corners count.
    """
    cell = cell_of(mesh)
    return cell.determinant(corner_positions(mesh)) / factorial(cell.dim)


def area(mesh: Mesh) -> Floats:
    """Return the area or volume |K| of every element, (nelements,), in mesh units.

    The mean of the Bernstein coefficients of the determinant is ``d! |K|``.
    """
    found = np.abs(signed_area(mesh))
    if is_second_order(mesh):
        rows, coefficients, _ = curved_determinants(mesh)
        found[rows] = np.abs(coefficients.mean(axis=0)) / factorial(len(mesh.p))
    return found


def is_in_front(corners: Floats, point: Floats) -> Mask:
    """Return True for points in front of facets.

    `corners` has shape (d, d, n), `point` (d, n). In front means to the left of a line, or on the side of a triangle
    from which its corners run clockwise. An element is in front of its facets if these run counter-clockwise around the
    element, or counter-clockwise as seen from outside.
    """
    cell = CELLS[len(point)]
    return (-1) ** cell.dim * cell.determinant(np.concatenate([corners, point[:, None]], axis=1)) > 0.0


def directed(mesh: Mesh, facets: Ints, which: Ints | int = 0) -> Ints:
    corners, element = mesh.facets[:, facets], mesh.f2t[which, facets]
    element = np.where(element < 0, mesh.f2t[0, facets], element)
    right = is_in_front(mesh.p[:, corners], centroids_of(mesh, element))
    return np.where(right, corners, corners[[1, 0, *range(2, len(corners))]]).T


def distances(x: Floats, corners: Floats) -> Floats:
    # from points (d, n) to points (d, 1, n), segments (d, 2, n) or triangles (d, 3, n)
    away = x - corners[:, 0]
    if corners.shape[1] == 1:
        return np.asarray(np.linalg.norm(away, axis=0))
    sides = [distances(x, np.delete(corners, k, axis=1)) for k in range(corners.shape[1])]
    edges = np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0)
    share = np.linalg.pinv(edges) @ away.T[:, :, None]
    off_plane = np.linalg.norm(away.T - (edges @ share)[:, :, 0], axis=1)
    above = np.all(share >= 0.0, axis=(1, 2)) & (share.sum(axis=(1, 2)) <= 1.0)
    return np.where(above, off_plane, np.min(sides, axis=0))


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
    check_kind(mesh)
    largest = np.abs(mesh.doflocs).max(initial=0.0)
    if largest < LEAST_EXTENT or largest > LARGEST_EXTENT:
        # areas and volumes would underflow or overflow, and 0 is the quality of a flat element
        mesh = replace(mesh, doflocs=np.ldexp(mesh.doflocs, -np.frexp(largest)[1]))
    if is_second_order(mesh):
        check_midsides(mesh)
        check_curved_sides(mesh)
    return np.abs(qualities_of(corner_positions(mesh)))


def qualities_of(corners: Floats) -> Floats:
    """Return qualities of elements with corners (d, d + 1, m), negative if inverted."""
    cell = CELLS[len(corners)]
    one, other = np.transpose(cell.edges)
    size, squares = cell.determinant(corners) / factorial(cell.dim), (corners[:, one] - corners[:, other]) ** 2
    return np.sign(size) * cell.regular * np.abs(size) ** (2 / cell.dim) / np.sum(squares, axis=(0, 1))


def hat_gradients(mesh: Mesh) -> Floats:
    return cell_of(mesh).hat_gradients(corner_positions(mesh))


def gradient(mesh: Mesh, values: ArrayLike) -> Floats:
    return np.einsum("ik,cik->ck", np.asarray(values, float)[mesh.t], hat_gradients(mesh))


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


def angles_between(u: Floats, v: Floats) -> Floats:  # of vectors (d, ...), from 0 to pi
    across = np.abs(determinants((u, v))) if len(u) == 2 else magnitude(crossed(u, v))
    return np.arctan2(across, np.sum(u * v, axis=0))
