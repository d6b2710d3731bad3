"""Rules of quadrature are exact to their degree, with positive weights and points inside."""

from math import factorial

import numpy as np

from kohonen_adapt.mesh.basis import LAW_RULE_IN_SPACE

DEGREE = 8


def test_laws_in_space_are_integrated_by_points_inside():
    points, weights = LAW_RULE_IN_SPACE
    assert points.shape == (46, 4) and points.min() > 0.01 and weights.min() > 0.0
    np.testing.assert_allclose(points.sum(axis=1), 1.0, rtol=1e-15)
    for powers in filter(lambda powers: sum(powers) <= DEGREE, np.ndindex((DEGREE + 1,) * 3)):
        exact = 6.0 * np.prod([factorial(power) for power in powers]) / factorial(3 + sum(powers))
        assert abs(weights @ np.prod(points[:, :3] ** powers, axis=1) - exact) < 1e-15
