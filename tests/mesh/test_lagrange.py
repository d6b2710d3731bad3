"""Lagrange functions of any order, their rules, and triangles with arcs as sides."""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest
from helpers.curved_meshes import curved_annulus
from skfem import ElementTriP2

from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.lagrange import functions_and_slopes, lobatto, nodes, rule_about, trace_functions, triangle_rule

POINTS = np.random.default_rng(0).dirichlet(np.ones(3), 20)


@pytest.mark.parametrize("order", range(2, 10))
def test_functions_are_one_at_their_node_and_reproduce_polynomials(order):
    values, _ = functions_and_slopes(nodes(order), order)
    np.testing.assert_allclose(values, np.eye(len(nodes(order))), atol=1e-12)
    values, _ = functions_and_slopes(POINTS, order)
    x, y = nodes(order)[:, 1:].T
    np.testing.assert_allclose((x**order - x * y ** (order - 1)) @ values, _polynomial(POINTS, order), atol=1e-12)


def _polynomial(barycentric, order):
    _, x, y = barycentric.T
    return x**order - x * y ** (order - 1)


@pytest.mark.parametrize("kind", range(7))
@pytest.mark.parametrize("order", [2, 5, 8])
def test_slopes_are_the_derivatives_of_the_values(order, kind):
    step = 1e-6
    _, slopes = functions_and_slopes(POINTS, order, kind)
    for axis, way in enumerate(([-step, step, 0.0], [-step, 0.0, step])):
        ends = [functions_and_slopes(POINTS + sign * np.array(way), order, kind)[0] for sign in (1.0, -1.0)]
        np.testing.assert_allclose((ends[0] - ends[1]) / (2.0 * step), slopes[:, axis], atol=1e-6 * abs(slopes).max())


def test_functions_of_order_two_are_those_of_scikit_fem():
    values, slopes = functions_and_slopes(POINTS, 2)
    np.testing.assert_allclose(nodes(2)[:, 1:], ElementTriP2.doflocs)
    x, y = POINTS[:, 1:].T
    np.testing.assert_allclose(values[3], 4.0 * x * (1.0 - x - y), atol=1e-14)
    np.testing.assert_allclose(slopes[3], [4.0 * (1.0 - 2.0 * x - y), -4.0 * x], atol=1e-13)


@pytest.mark.parametrize(
    ("rule", "degree"), [(triangle_rule, 12), (triangle_rule, 26), (lambda n: rule_about(2, n), 9)]
)
def test_rules_integrate_their_degree(rule, degree):
    barycentric, weight = rule(degree)
    for power in (0, 1, degree // 2, degree):
        exact = 2.0 * factorial(power) * factorial(degree - power) / factorial(degree + 2)
        found = weight @ (barycentric[:, 1] ** power * barycentric[:, 2] ** (degree - power))
        assert found == pytest.approx(exact, rel=1e-11)


def test_traces_are_the_functions_on_a_side():
    at = np.linspace(0.0, 1.0, 7)
    on_side = np.stack([1.0 - at, at, np.zeros(7)], axis=1)
    values, _ = functions_and_slopes(on_side, 5)
    np.testing.assert_allclose(trace_functions(at, 5), values[[0, 1, 3, 4, 5, 6]].T, atol=1e-13)
    np.testing.assert_allclose(lobatto(5) + lobatto(5)[::-1], 1.0, atol=0.0)


def test_sides_through_three_nodes_of_a_circle_are_arcs():
    mesh = curved_annulus(8)
    shape = Blended(mesh)
    x, tangent = shape.facet_points(mesh.boundaries["outer"], np.linspace(0.0, 1.0, 11))
    np.testing.assert_allclose(np.hypot(*x), 1.5, atol=1e-14)
    np.testing.assert_allclose(np.sum(x * tangent, axis=0), 0.0, atol=1e-14)
    barycentric, weight = triangle_rule(26)
    count = mesh.t.shape[1]
    element, share = np.repeat(np.arange(count), weight.size), np.tile(barycentric.T, count)
    hats = shape.hat_gradients(element, share)
    size = 0.5 * np.tile(weight, count) / abs(hats[0, 1] * hats[1, 2] - hats[1, 1] * hats[0, 2])
    assert size.sum() == pytest.approx(2.0 * np.pi, rel=1e-14)
    points = shape.points(element, share)
    np.testing.assert_allclose(shape.barycentric_coordinates(element, points), share, atol=1e-12)


def test_a_midside_node_off_the_bisector_makes_a_parabola():
    mesh = curved_annulus(8)
    rim, p = mesh.boundaries["outer"][0], mesh.doflocs.copy()
    start, end = p[:, mesh.facets[:, rim]].T
    p[:, mesh.nvertices + rim] += 0.05 * (end - start)
    shape = Blended(replace(mesh, doflocs=p))
    quarter, _ = shape.facet_points(np.array([rim]), np.array([0.25]))
    offset = p[:, mesh.nvertices + rim] - 0.5 * (start + end)
    np.testing.assert_allclose(quarter[:, 0, 0], 0.75 * start + 0.25 * end + 0.75 * offset, atol=1e-14)
