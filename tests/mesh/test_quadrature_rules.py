"""Rules of quadrature are exact to their degree, with positive weights and points inside."""

from math import factorial, prod

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kohonen_adapt.mesh.elements.rules import (
    LAW_RULE_IN_SPACE,
    product_rule,
    rule_about,
    tetrahedron_rule,
    triangle_rule,
)


@pytest.mark.parametrize(
    ("rule", "degree"),
    [
        (product_rule((4,)), 7),
        (triangle_rule(12), 12),
        (triangle_rule(26), 26),
        (rule_about(2, 9), 9),
        (tetrahedron_rule(3), 3),
        (tetrahedron_rule(8), 8),
        (LAW_RULE_IN_SPACE, 8),
    ],
)
def test_rules_integrate_their_degree_by_points_inside(rule, degree):
    (points, weights), dim = rule, rule[0].shape[1] - 1
    assert points.min() > 0.0 and weights.min() > 0.0
    assert_allclose(points.sum(axis=1), 1.0, rtol=1e-14)
    for powers in filter(lambda powers: sum(powers) <= degree, np.ndindex((degree + 1,) * dim)):
        exact = factorial(dim) * prod(factorial(power) for power in powers) / factorial(dim + sum(powers))
        assert abs(weights @ np.prod(points[:, :dim] ** powers, axis=1) - exact) < 1e-14
