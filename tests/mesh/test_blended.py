"""Triangles with arcs as sides."""

import numpy as np
import pytest
from helpers.curved_meshes import curved_annulus
from numpy.testing import assert_allclose

from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.elements.rules import triangle_rule


def test_sides_through_three_nodes_of_a_circle_are_arcs():
    mesh = curved_annulus(8)
    shape = Blended(mesh)
    along = np.linspace(0.0, 1.0, 11)
    x, tangents = shape.facet_points(mesh.boundaries["outer"], np.stack((1.0 - along, along)))
    assert_allclose(np.hypot(*x), 1.5, atol=1e-14)
    assert_allclose(np.sum(x * tangents[:, 0], axis=0), 0.0, atol=1e-14)
    barycentric, weight = triangle_rule(26)
    count = mesh.t.shape[1]
    element, share = np.repeat(np.arange(count), weight.size), np.tile(barycentric.T, count)
    hats = shape.hat_gradients(element, share)
    size = 0.5 * np.tile(weight, count) / abs(hats[0, 1] * hats[1, 2] - hats[1, 1] * hats[0, 2])
    assert size.sum() == pytest.approx(2.0 * np.pi, rel=1e-14)
    points = shape.points(element, share)
    assert_allclose(shape.barycentric_coordinates(element, points), share, atol=1e-12)
