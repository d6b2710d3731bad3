"""Metric tensors of elements as a density of nodes and a shape.

A tensor D is the product of a scalar and a shape, a tensor of determinant 1: sqrt(det D) is the density of nodes, and
the shape has the directions and the ratios of the edges. Shapes are rows of the upper triangle, (xx, xy, yy) in the
plane and (xx, xy, xz, yy, yz, zz) in space.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.checks import as_reals

__all__ = [
    "LARGEST_RATIO",
    "are_round",
    "checked_tensors",
    "density_and_shape",
    "determinants",
    "eigenvectors",
    "logarithms",
    "mean_shapes",
    "mean_tensors",
    "packed",
    "round_shapes",
    "shapes_at_nodes",
    "tensors_at_points",
    "tensors_of_elements",
    "unpacked",
]

LARGEST_RATIO = 1e6  # length of the longest edge of a tensor divided by the length of the shortest
SYMMETRIC = 1e-8  # difference of entries that count as equal, relative to the largest entry


def round_shapes(count: int, dim: int) -> Floats:
    return np.tile(packed(np.eye(dim)[None])[0], (count, 1))


def are_round(shapes: Floats) -> bool:
    return bool(np.abs(shapes - round_shapes(1, 2 if shapes.shape[1] == 3 else 3)).max() <= SYMMETRIC)


def packed(tensors: Floats) -> Floats:
    return np.ascontiguousarray(tensors[:, *np.triu_indices(tensors.shape[-1])])  # as kernels take


def unpacked(shapes: Floats) -> Floats:
    dim = 2 if shapes.shape[1] == 3 else 3
    row, column = np.triu_indices(dim)
    tensors = np.empty((len(shapes), dim, dim))
    tensors[:, row, column] = tensors[:, column, row] = shapes
    return tensors


def tensors_of_elements(values: ArrayLike, count: int, dim: int, name: str) -> Floats:
    """Return checked tensors (count, dim, dim), see `checked_tensors`."""
    return checked_tensors(as_tensors(values, count, dim, name, "nelements"), name)


def tensors_at_points(values: ArrayLike, points: Floats) -> Floats:
    """Return checked tensors (n, d, d) at points (n, d), see `checked_tensors`."""
    count, dim = points.shape
    tensors = as_tensors(values, count, dim, "density", "n")
    return checked_tensors(tensors, "density", lambda row: f"at {tuple(points[row].tolist())}")


def as_tensors(values: ArrayLike, count: int, dim: int, name: str, rows: str) -> Floats:
    tensors = np.asarray(values)
    if tensors.shape != (count, dim, dim):
        raise ValueError(
            f"{name} must have shape ({rows}, {dim}, {dim}) = ({count}, {dim}, {dim}) as tensors; got {tensors.shape}."
        )
    return as_reals(name, tensors.reshape(count, -1), {rows: count, "d^2": dim**2}).reshape(tensors.shape)


def checked_tensors(tensors: Floats, name: str, owner: Callable[[int], str] = "of element {}".format) -> Floats:
    """Return the tensors (m, ..., d, d), exactly symmetric.

    Raises
    ------
    ValueError
        If a tensor is not finite, not symmetric or not positive definite, if the ratio of its edges exceeds
        `LARGEST_RATIO`, or if its determinant is out of the range of numbers. The message has the `owner` of the row.
    """

    def refuse(rule: str, wrong: Mask, found: Callable[[tuple[int, ...]], str]) -> None:
        bad = np.argwhere(wrong)
        if len(bad):
            place = tuple(bad[0].tolist())
            raise ValueError(f"{name} must {rule}; the tensor {owner(place[0])} {found(place)}.")

    def shown(place: tuple[int, ...]) -> str:
        return f"is {tensors[place].tolist()}"

    other, largest = np.swapaxes(tensors, -1, -2), np.abs(tensors).max(axis=(-2, -1))
    refuse("be finite", ~np.isfinite(largest), shown)
    refuse("be symmetric", np.abs(tensors - other).max(axis=(-2, -1)) > SYMMETRIC * largest, shown)
    symmetric = 0.5 * tensors + 0.5 * other
    eigenvalues = np.linalg.eigvalsh(symmetric)
    refuse("be positive definite", ~(eigenvalues[..., 0] > 0.0), shown)
    ratio = np.sqrt(eigenvalues[..., -1] / eigenvalues[..., 0])
    refuse(
        f"have edges of a ratio of at most {LARGEST_RATIO:g}",
        ratio > LARGEST_RATIO,
        lambda place: f"has {ratio[place]:.3g}: {tensors[place].tolist()}",
    )
    with np.errstate(all="ignore"):
        determinant = determinants(symmetric)
    refuse("have a determinant in the range of numbers", ~(np.isfinite(determinant) & (determinant > 0.0)), shown)
    return symmetric


def density_and_shape(tensors: Floats) -> FloatsPair:
    """Return the densities (m,) and the shapes (m, 3) or (m, 6) of tensors (m, d, d)."""
    determinant = determinants(tensors)
    return np.sqrt(determinant), packed(tensors / determinant[:, None, None] ** (1.0 / tensors.shape[-1]))


def determinants(tensors: Floats) -> Floats:
    # in closed form, because `np.linalg.det` works with logarithms and is not exact for multiples of the identity
    a, b, c = tensors[..., 0, 0], tensors[..., 0, 1], tensors[..., 1, 1]
    if tensors.shape[-1] == 2:
        return a * c - b * b
    d, e, f = tensors[..., 0, 2], tensors[..., 1, 2], tensors[..., 2, 2]
    # By elimination: in sums of products the error is the fourth power of the ratio of edges, not the second.
    c, e, f = c - b * b / a, e - b * d / a, f - d * d / a
    return a * (c * (f - e * e / c))


def shapes_at_nodes(node: Ints, shapes: Floats, weights: Floats, count: int) -> Floats:
    # (count, 3) or (count, 6), means of logarithms weighted by `weights` (m,): directions at right angles give a round
    # shape (Arsigny, Fillard, Pennec and Ayache, SIAM J. Matrix Anal. Appl. 29, 2007).
    corners = node.ravel()
    total = np.bincount(corners, weights=np.repeat(weights, node.shape[1]), minlength=count)
    logs = logarithms(shapes) * weights[:, None]
    sums = [np.bincount(corners, weights=np.repeat(column, node.shape[1]), minlength=count) for column in logs.T]
    return mean_shapes(np.stack(sums, axis=1) / total[:, None])


def logarithms(shapes: Floats) -> Floats:
    return mapped(shapes, np.log)


def mean_shapes(logs: Floats) -> Floats:
    # shapes of mean logarithms
    return density_and_shape(unpacked(mapped(logs, np.exp)))[1]


def mean_tensors(tensors: Floats) -> Floats:
    # means (m, d, d) of tensors (m, k, d, d) over k, by logarithms
    m, k, dim, _ = tensors.shape
    if k == 1:
        return tensors[:, 0]
    logs = logarithms(packed(tensors.reshape(-1, dim, dim)))
    return unpacked(mapped(logs.reshape(m, k, -1).mean(axis=1), np.exp))


def eigenvectors(tensors: Floats) -> FloatsPair:
    """Return eigenvalues (m, d), ascending, and eigenvectors (m, d, d) in columns."""
    if tensors.shape[-1] == 3:
        return np.linalg.eigh(tensors)
    # in closed form, which takes a quarter of the time
    a, b, c = tensors[:, 0, 0], tensors[:, 0, 1], tensors[:, 1, 1]
    half, mean = 0.5 * a - 0.5 * c, 0.5 * a + 0.5 * c
    radius = np.hypot(half, b)
    x, y = np.where(half >= 0.0, radius + half, b), np.where(half >= 0.0, b, radius - half)
    length = np.hypot(x, y)
    x, length = np.where(length > 0.0, x, 1.0), np.where(length > 0.0, length, 1.0)
    x, y = x / length, y / length
    return np.stack([mean - radius, mean + radius], axis=1), np.moveaxis(np.array([[-y, x], [x, y]]), -1, 0)


def mapped(shapes: Floats, function: np.ufunc) -> Floats:
    values, vectors = eigenvectors(unpacked(shapes))
    return packed(np.einsum("mij,mj,mkj->mik", vectors, function(values), vectors))
