"""Newton's steps of the descent in the plane and in space, beside those by numpy's eigenvalues."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron.polish import descend as space
from kohonen_adapt.kernels.triangle.polish import descend as plane


@pytest.mark.parametrize(("kernels", "dim"), [(plane, 2), (space, 3)])
def test_small_eigenvalues_are_raised_and_negative_ones_turned(kernels, dim):
    rng, step = np.random.default_rng(0), interpreted(kernels.newton_step)
    for _ in range(200):
        turn = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
        curvature, gradient = 10 ** rng.uniform(-3, 3) * rng.normal(size=dim), rng.normal(size=dim)
        raised = np.maximum(np.abs(curvature), kernels.LEAST_CURVATURE * np.abs(curvature).max())
        wanted = -kernels.OVERSTEP * turn @ (turn.T @ gradient / raised)
        hessian = (turn * curvature @ turn.T)[np.triu_indices(dim)]
        assert_allclose(step(tuple(gradient), tuple(hessian)), wanted, rtol=1e-7, atol=1e-9 * np.abs(wanted).max())
    assert not np.any(step((1.0,) * dim, (0.0,) * len(hessian)))
