"""Areas and quality of triangles."""

import numpy as np
import pytest
from helpers.meshes import areas_of, generic_square, perturbed, square
from numpy.testing import assert_allclose
from skfem import MeshTri

from kohonen_adapt import quality
from kohonen_adapt.mesh.measures import area, signed_area
from kohonen_adapt.mesh.triangulation import Triangulation


def triangle(*corners):
    return MeshTri(np.array(corners, dtype=float).T, np.array([[0], [1], [2]]))


@pytest.mark.parametrize("size", [1e-100, 1e-6, 1.0, 1e100])
def test_an_equilateral_triangle_has_quality_1_at_any_size(size):
    mesh = triangle((0, 0), (size, 0), (size / 2, size * np.sqrt(3) / 2))
    assert quality(mesh) == pytest.approx([1.0], rel=1e-14)


def test_quality_is_the_formula_and_at_most_1():
    mesh = perturbed(generic_square(7), 1)
    for value, corners in zip(quality(mesh), mesh.p[:, mesh.t].transpose(2, 1, 0), strict=True):
        a, b, c = (np.hypot(*(corners[k] - corners[k - 1])) for k in range(3))
        s = (a + b + c) / 2
        heron = np.sqrt(s * (s - a) * (s - b) * (s - c))
        assert value == pytest.approx(4 * np.sqrt(3) * heron / (a**2 + b**2 + c**2), rel=1e-6)
    assert 0 < quality(mesh).min() < quality(mesh).max() <= 1


def test_areas_have_signs_that_sorted_elements_do_not_show():
    mesh = square(4)
    assert np.sum(signed_area(mesh) < 0) > 0
    assert_allclose(area(mesh), 1 / 32)
    assert_allclose(areas_of(Triangulation.of(mesh)), area(mesh))


def test_quality_does_not_depend_on_the_order_of_nodes():
    mesh = perturbed(square(4), 2)
    turned = MeshTri(mesh.p, mesh.t[[1, 2, 0]], sort_t=False)
    assert_allclose(quality(turned), quality(mesh), rtol=1e-13)
