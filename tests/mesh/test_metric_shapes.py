"""Metric tensors as densities and shapes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kohonen_adapt.mesh.shapes import (
    density_and_shape,
    mean_tensors,
    unpacked,
)

DIMS = [2, 3]


def turned(eigenvalues, rng):
    """Tensors (n, d, d) with eigenvalues (n, d), each in random directions."""
    n, dim = eigenvalues.shape
    directions = np.linalg.qr(rng.normal(size=(n, dim, dim)))[0]
    tensors = np.einsum("nij,nj,nkj->nik", directions, eigenvalues, directions)
    return 0.5 * (tensors + tensors.transpose(0, 2, 1))


@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e4, 1e6])
@pytest.mark.parametrize("dim", DIMS)
@pytest.mark.parametrize("long", [1, 2])
def test_density_and_shape_are_those_of_the_eigenvalues(dim, long, ratio):
    """To the condition of the tensor, the square of the ratio, of needles and of plates."""
    eigenvalues = np.ones((200, dim))
    eigenvalues[:, : min(long, dim - 1)] = ratio**2
    tensors = turned(eigenvalues, np.random.default_rng(0))
    density, shape = density_and_shape(tensors)
    assert_allclose(density, np.sqrt(eigenvalues.prod(axis=1)), rtol=1e-15 * (ratio**2 + 10))
    assert_allclose(density[:, None, None] ** (2.0 / dim) * unpacked(shape), tensors, rtol=1e-12, atol=1e-12 * ratio**2)


@pytest.mark.parametrize("dim", DIMS)
def test_means_of_logarithms_commute_with_inverses_and_keep_determinants(dim):
    rng = np.random.default_rng(0)
    tensors = turned(np.exp(rng.uniform(-3.0, 3.0, (60, dim))), rng).reshape(20, 3, dim, dim)
    means = mean_tensors(tensors)
    assert_allclose(np.linalg.inv(means), mean_tensors(np.linalg.inv(tensors)), rtol=1e-10, atol=1e-12)
    determinants = np.exp(np.log(np.linalg.det(tensors)).mean(axis=1))
    assert_allclose(np.linalg.det(means), determinants, rtol=1e-11)
    assert_array_equal(mean_tensors(tensors[:, :1]), tensors[:, 0])
