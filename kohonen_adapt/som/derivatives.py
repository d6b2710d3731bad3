"""Derivatives recovered from values at nodes, separately in every region.

A polynomial is fitted by least squares to the values around every node (Zhang and Naga, SIAM J. Sci. Comput. 26, 2005),
in coordinates in which these nodes have the unit matrix as covariance. Fits on long elements are therefore as well
conditioned as on regular elements.
"""

from collections.abc import Iterator
from itertools import combinations_with_replacement
from math import factorial, prod
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.measures import hat_gradients

__all__ = ["highest_derivatives"]

MOST_RINGS = 4  # of elements around a node
ILL_POSED = 10.0  # norm of the inverse of the normal matrix above which a fit needs more nodes, per degree and 1
RIDGE = 1e-14  # relative to the largest entries, so that no matrix is singular
BATCH = 1 << 20  # numbers per array of a batch of fits
ALIKE = 4  # members by which patches of a batch differ at most, so that small meshes have few batches


class Sites(NamedTuple):
    """Nodes, repeated for every region around."""

    corner: Ints  # (d + 1, nelements): site of every corner
    node: Ints  # (nsites,)


def highest_derivatives(mesh: Mesh, region: Ints, values: Floats, order: int) -> tuple[Floats, Mask]:
    """Return derivatives in elements and a mask of elements with enough nodes.

    Derivatives of ``order - 1`` at the nodes are those of fitted polynomials of degree `order`, and their linear
    interpolant is differentiated. The result is exact for polynomials of degree `order`.

    Parameters
    ----------
    mesh
        Mesh of straight elements.
    region
        Region of every element, shape (nelements,). Fits use values of their own region only.
    values
        Values at the nodes, shape (nvertices,).
    order
        Order of the derivatives, at least 2.

    Returns
    -------
    derivatives : ndarray of shape (nelements, d, ..., d)
        Symmetric tensors, zero where the elements of a region do not determine a polynomial.
    found : ndarray of shape (nelements,)
    """
    pair, corner = np.unique(region * np.int64(mesh.p.shape[1]) + mesh.t, return_inverse=True)
    sites = Sites(corner.reshape(mesh.t.shape), pair % mesh.p.shape[1])
    at_sites, have = derivatives_at_sites(mesh.p.T[sites.node], sites, values[sites.node], order)
    found = np.all(have[sites.corner], axis=0)
    at_corners = np.moveaxis(at_sites[sites.corner], 0, -1)
    hats = np.ascontiguousarray(hat_gradients(mesh).T)
    tensors = at_corners @ hats.reshape(len(hats), *[1] * (order - 2), *hats.shape[1:])
    symmetric = sum(np.swapaxes(tensors, axis, -1) for axis in range(1, order + 1)) / order
    return np.where(found.reshape(-1, *[1] * order), symmetric, 0.0), found


def derivatives_at_sites(points: Floats, sites: Sites, values: Floats, degree: int) -> tuple[Floats, Mask]:
    count, dim = points.shape
    tensors, found = np.zeros((count, *[dim] * (degree - 1))), np.zeros(count, bool)
    neighbours = patch = neighbours_of_sites(sites)
    for _ in range(MOST_RINGS):
        missing = np.flatnonzero(~found)
        for rows, members, weights in batches(patch[missing], len(monomials(dim, degree))):
            site = missing[rows]
            offset, difference = points[members] - points[site, None], values[members] - values[site, None]
            tensors[site], found[site] = fitted(offset, difference, weights, degree)
        if found.all():
            break
        patch = patch @ neighbours
    return tensors, found


def neighbours_of_sites(sites: Sites) -> csr_array:
    corner = sites.corner
    count = len(sites.node)
    row, column = np.repeat(corner, len(corner), axis=0).ravel(), np.tile(corner, (len(corner), 1)).ravel()
    return csr_array((np.ones(row.size, np.float32), (row, column)), shape=(count, count))


def batches(patch: csr_array, unknowns: int) -> Iterator[tuple[Ints, Ints, Floats]]:
    # Rows with similar numbers of members, at least `unknowns`, and their members with weights (rows, number), which
    # are zero for the repeated members of rows that have fewer.
    size = np.diff(patch.indptr)
    width = -(-size // ALIKE) * ALIKE
    for number in np.unique(width[size >= unknowns]):
        rows = np.flatnonzero((width == number) & (size >= unknowns))
        for part in np.array_split(rows, rows.size * int(number) * unknowns // BATCH + 1):
            count = size[part, None]
            place = np.arange(number)
            members = patch.indices[patch.indptr[part, None] + np.minimum(place, count - 1)]
            yield part, members, np.where(place < count, 1.0 / count, 0.0)


def fitted(offset: Floats, values: Floats, weights: Floats, degree: int) -> tuple[Floats, Mask]:
    # Derivatives of order `degree - 1` at offset zero, from values at offsets (n, number, d).
    dim = offset.shape[2]
    spread = np.swapaxes(offset, 1, 2) @ (weights[..., None] * offset)
    spread += RIDGE * np.trace(spread, axis1=1, axis2=2)[:, None, None] * np.eye(dim)
    unit = np.linalg.inv(np.linalg.cholesky(spread))
    local = offset @ np.swapaxes(unit, 1, 2)
    powers = monomials(dim, degree)
    # The norm of the inverse is the same in all directions, because these monomials are orthonormal as tensors.
    scale = np.sqrt([factorial(len(axes)) / repeated(axes) for axes in powers])
    basis = np.stack([np.prod(local[..., list(axes)], axis=-1) for axes in powers], axis=-1) * scale
    transposed = np.swapaxes(basis, 1, 2) * weights[:, None]
    gram = transposed @ basis
    inverse = np.linalg.inv(gram + RIDGE * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(len(powers)))
    coefficients = (inverse @ (transposed @ values[..., None]))[..., 0]
    tensors = np.empty((len(offset), *[dim] * (degree - 1)))
    for axes in np.ndindex(*[dim] * (degree - 1)):
        column = powers.index(tuple(sorted(axes)))
        tensors[:, *axes] = repeated(axes) * scale[column] * coefficients[:, column]
    for axis in range(1, degree):
        tensors = np.moveaxis(np.einsum("n...i,nij->n...j", np.moveaxis(tensors, axis, -1), unit), -1, axis)
    return tensors, np.linalg.norm(inverse, axis=(1, 2)) < ILL_POSED ** (degree + 1)


def repeated(axes: tuple[int, ...]) -> int:
    # derivative of a monomial along the axes of the monomial
    return prod(factorial(axes.count(axis)) for axis in set(axes))


def monomials(dim: int, degree: int) -> list[tuple[int, ...]]:
    return [axes for total in range(degree + 1) for axes in combinations_with_replacement(range(dim), total)]
