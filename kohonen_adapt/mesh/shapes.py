"""Metric tensors of elements as a density of nodes and a shape.

A tensor D is the product of a scalar and a shape, a tensor of determinant 1: sqrt(det D) is the density of nodes, and
the shape has the directions and the ratios of the edges. Shapes are rows of the upper triangle, (xx, xy, yy) in the
plane and (xx, xy, xz, yy, yz, zz) in space.
"""

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import as_reals

__all__ = [
    "LARGEST_RATIO",
    "density_and_shape",
    "mean_shapes",
    "packed",
    "round_shapes",
    "shapes_at_nodes",
    "tensors_of_elements",
    "unpacked",
    "with_determinant_one",
]

LARGEST_RATIO = 1e6  # length of the longest edge of a tensor divided by the length of the shortest
SYMMETRIC = 1e-8  # difference of two entries that have to be equal, relative to the largest entry


def round_shapes(count: int, dim: int) -> Floats:
    return np.tile(packed(np.eye(dim)[None])[0], (count, 1))


def packed(tensors: Floats) -> Floats:
    return tensors[:, *np.triu_indices(tensors.shape[-1])]


def unpacked(shapes: Floats) -> Floats:
    dim = 2 if shapes.shape[1] == 3 else 3
    row, column = np.triu_indices(dim)
    tensors = np.empty((len(shapes), dim, dim))
    tensors[:, row, column] = tensors[:, column, row] = shapes
    return tensors


def tensors_of_elements(values: ArrayLike, count: int, dim: int, name: str) -> Floats:
    """Return checked tensors (count, dim, dim), exactly symmetric.

    Raises
    ------
    ValueError
        If a tensor is not finite, not symmetric or not positive definite, or if the ratio of its edges exceeds
        `LARGEST_RATIO`.
    """
    tensors = np.asarray(values)
    if tensors.shape != (count, dim, dim):
        raise ValueError(
            f"{name} must have shape (nelements,) = ({count},), or as tensors (nelements, {dim}, {dim}) = "
            f"({count}, {dim}, {dim}); got {tensors.shape}."
        )
    tensors = as_reals(name, tensors.reshape(count, -1), {"nelements": count, "d^2": dim**2}).reshape(tensors.shape)
    other = np.swapaxes(tensors, 1, 2)
    largest = np.abs(tensors).max(axis=(1, 2))
    refuse(name, "finite", ~np.isfinite(largest), tensors)
    refuse(name, "symmetric", np.abs(tensors - other).max(axis=(1, 2)) > SYMMETRIC * largest, tensors)
    tensors = 0.5 * (tensors + other)
    eigenvalues = np.linalg.eigvalsh(tensors)
    refuse(name, "positive definite", ~(eigenvalues[:, 0] > 0.0), tensors)
    ratio = np.sqrt(eigenvalues[:, -1] / eigenvalues[:, 0])
    bad = np.flatnonzero(ratio > LARGEST_RATIO)
    if len(bad):
        raise ValueError(
            f"{name} must have edges of ratio at most {LARGEST_RATIO:g}; the tensor of element {bad[0]} has "
            f"{ratio[bad[0]]:.3g}."
        )
    return tensors


def refuse(name: str, rule: str, wrong: np.ndarray, tensors: Floats) -> None:
    bad = np.flatnonzero(wrong)
    if len(bad):
        raise ValueError(f"{name} must be {rule}; the tensor of element {bad[0]} is {tensors[bad[0]].tolist()}.")


def density_and_shape(tensors: Floats) -> tuple[Floats, Floats]:
    """Return the densities (m,) and the shapes (m, 3) or (m, 6) of tensors (m, d, d)."""
    determinant = np.linalg.det(tensors)
    return np.sqrt(determinant), packed(tensors / determinant[:, None, None] ** (1.0 / tensors.shape[-1]))


def with_determinant_one(shapes: Floats) -> Floats:
    tensors = unpacked(shapes)
    return packed(tensors / np.linalg.det(tensors)[:, None, None] ** (1.0 / tensors.shape[-1]))


def shapes_at_nodes(node: Ints, shapes: Floats, weights: Floats, count: int) -> Floats:
    """Return the mean shape of the elements around every node, (count, 3) or (count, 6).

    The logarithms of shapes are averaged with `weights` (m,), so that directions at right angles give a round shape
    (Arsigny, Fillard, Pennec and Ayache, SIAM J. Matrix Anal. Appl. 29, 2007).
    """
    corners = node.ravel()
    total = np.bincount(corners, weights=np.repeat(weights, node.shape[1]), minlength=count)
    logs = logarithms(shapes) * weights[:, None]
    sums = [np.bincount(corners, weights=np.repeat(column, node.shape[1]), minlength=count) for column in logs.T]
    return mean_shapes(np.stack(sums, axis=1) / total[:, None])


def logarithms(shapes: Floats) -> Floats:
    return mapped(shapes, np.log)


def mean_shapes(logs: Floats) -> Floats:
    # shapes of mean logarithms
    return with_determinant_one(mapped(logs, np.exp))


def mapped(shapes: Floats, function: np.ufunc) -> Floats:
    values, vectors = np.linalg.eigh(unpacked(shapes))
    return packed(np.einsum("mij,mj,mkj->mik", vectors, function(values), vectors))
