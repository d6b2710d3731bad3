"""Areas and quality of triangles."""

import numpy as np
import pytest
from helpers.meshes import generic_square, perturbed

from kohonen_adapt import quality


def test_quality_is_the_formula_and_at_most_1():
    mesh = perturbed(generic_square(7), 1)
    for value, corners in zip(quality(mesh), mesh.p[:, mesh.t].transpose(2, 1, 0), strict=True):
        a, b, c = (np.hypot(*(corners[k] - corners[k - 1])) for k in range(3))
        s = (a + b + c) / 2
        heron = np.sqrt(s * (s - a) * (s - b) * (s - c))
        assert value == pytest.approx(4 * np.sqrt(3) * heron / (a**2 + b**2 + c**2), rel=1e-6)
    assert 0 < quality(mesh).min() < quality(mesh).max() <= 1
