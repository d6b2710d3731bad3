"""The layers solve their equations, and their errors fall as those of linear elements do."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.problems.helmholtz import square_mesh
from benchmarks.problems.layers import BoundaryLayer, Layer, closed_layer, wave_front

FUNCTIONS = {"closed": closed_layer(5.0), "front": wave_front(5.0)}
STEP = 1e-4


@pytest.mark.parametrize("name", FUNCTIONS)
def test_gradients_and_laplacians_are_those_of_the_solution(name):
    parts = FUNCTIONS[name]
    x = np.random.default_rng(0).uniform(0.05, 0.95, (2, 50))
    steps = STEP * np.eye(2)[:, :, None]
    ahead, behind = (np.stack([parts["exact"](x + sign * step) for step in steps]) for sign in (1, -1))
    assert_allclose(parts["gradient"](x), (ahead - behind) / (2 * STEP), rtol=1e-4, atol=1e-5)
    second = (ahead - 2 * parts["exact"](x) + behind).sum(axis=0) / STEP**2
    assert_allclose(parts["laplacian"](x), second, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("problem", [Layer(**FUNCTIONS["closed"]), Layer(**FUNCTIONS["front"]), BoundaryLayer(0.01)])
def test_errors_fall_at_the_rate_of_linear_elements(problem):
    errors = [problem.error(mesh, problem.solve(mesh)) for mesh in (square_mesh(40), square_mesh(80))]
    assert 1.9 < errors[0] / errors[1] < 2.05
