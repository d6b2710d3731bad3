"""Reference functions of any order on sides, triangles and tetrahedra."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kohonen_adapt.mesh.elements.functions import (
    nodes,
    reference_functions,
)

POINTS = {dim: np.random.default_rng(dim).dirichlet(np.ones(dim + 1), 20) for dim in (1, 2, 3)}


def polynomial(barycentric, order):
    x, y = barycentric[:, 1], barycentric[:, -1]
    return x**order - x * y ** (order - 1)


@pytest.mark.parametrize("spread", [False, True])
@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("order", range(1, 9))
def test_functions_are_one_at_their_node_and_reproduce_polynomials(order, dim, spread):
    at = nodes(order, dim, spread)
    values, _ = reference_functions(at, order, spread=spread)
    assert_allclose(values, np.eye(len(at)), atol=1e-11)
    values, _ = reference_functions(POINTS[dim], order, spread=spread)
    assert_allclose(polynomial(at, order) @ values, polynomial(POINTS[dim], order), atol=1e-11)
    assert_allclose(values.sum(axis=0), 1.0, atol=1e-11)
