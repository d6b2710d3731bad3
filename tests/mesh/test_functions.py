"""Reference functions of any order on sides, triangles and tetrahedra."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kohonen_adapt.mesh.elements.functions import (
    hierarchical,
    near_axis,
    nodes,
    positions,
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


@pytest.mark.parametrize(("dim", "kind"), [(1, 0), *((2, kind) for kind in range(7)), (3, 0)])
@pytest.mark.parametrize("order", [1, 2, 3, 5, 8])
def test_slopes_are_the_derivatives_of_the_values(order, dim, kind):
    step, at = 1e-6, POINTS[dim]
    _, slopes = reference_functions(at, order, kind)
    for axis, direction in enumerate(np.eye(dim + 1)[1:] - np.eye(dim + 1)[0]):
        ends = [reference_functions(at + sign * step * direction, order, kind)[0] for sign in (1.0, -1.0)]
        assert_allclose((ends[0] - ends[1]) / (2.0 * step), slopes[:, axis], atol=1e-6 * abs(slopes).max())


def test_hierarchical_functions_are_those_of_the_kernels():
    a, b, c = POINTS[2].T
    values, _ = hierarchical(POINTS[2], 3)
    expected = [a, b, c, 4.0 * b * c, 4.0 * c * a, 4.0 * a * b]
    expected += [13.5 * b * c * (c - b), 13.5 * c * a * (a - c), 13.5 * a * b * (b - a), 27.0 * a * b * c]
    assert_allclose(values, expected, atol=1e-15)
    first, second = POINTS[3].T[[0, 0, 0, 1, 1, 2]], POINTS[3].T[[1, 2, 3, 2, 3, 3]]
    assert_allclose(hierarchical(POINTS[3], 2)[0][4:], 4.0 * first * second, atol=1e-15)


@pytest.mark.parametrize("order", [1, 3, 6])
def test_kinds_at_an_axis_may_differ_between_points(order):
    kind = np.arange(20) % 7
    values, slopes = near_axis(POINTS[2], order, kind)
    for point, own in enumerate(kind):
        value, slope = near_axis(POINTS[2][point : point + 1], order, int(own))
        assert_allclose(values[:, point], value[:, 0], rtol=1e-14, atol=1e-15)
        assert_allclose(slopes[..., point], slope[..., 0], rtol=1e-14, atol=1e-14)


def test_functions_of_a_side_are_traces():
    at = np.linspace(0.0, 1.0, 7)
    on_side = np.stack([1.0 - at, at, np.zeros(7)], axis=1)
    values, _ = reference_functions(on_side, 5)
    assert_allclose(reference_functions(on_side[:, :2], 5)[0], values[[0, 1, 3, 4, 5, 6]], atol=1e-13)
    assert_allclose(positions(5, True) + positions(5, True)[::-1], 1.0, atol=0.0)
