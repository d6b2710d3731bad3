"""Exponents of fields at corners against closed forms, and the nodes that get layers."""

import numpy as np
import pytest
from helpers.devices import two_magnets
from helpers.exact_fields import Corner, rectangle_mesh
from helpers.meshes import square
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.mesh.corners import singular_nodes
from kohonen_adapt.mesh.elements.exponents import exponents
from kohonen_adapt.problem.singular_nodes import materials_of

RIGHT = np.pi / 2.0
SOFT = 2.0 / np.pi * np.arctan(0.02**0.5)


@pytest.mark.parametrize("permeability", [5.0, 1000.0])
def test_the_exponent_at_iron_is_that_of_the_exact_field(permeability):
    found = exponents(np.array([RIGHT, 3.0 * RIGHT]), np.array([1.0 / permeability, 1.0]), None)
    assert np.abs(found - Corner(permeability).exponent).min() < 1e-4


@pytest.mark.parametrize(
    ("angle", "coefficient", "prescribed", "wanted"),
    [
        ([3.0 * RIGHT], [1.0], (True, True), [2.0 / 3.0, 4.0 / 3.0]),
        ([2.0 * RIGHT], [3.0], (True, False), [0.5, 1.5]),
        ([RIGHT], [1.0], (False, False), []),
        ([2.0 * RIGHT, 2.0 * RIGHT], [1.0, 9.0], None, []),
        ([RIGHT, RIGHT], [1.0, 9.0], (True, True), []),
        ([4.0 * RIGHT], [1.0], (True, False), [0.25, 0.75, 1.25, 1.75]),
        ([3.0 * RIGHT], [1.0], (True, False), [1.0 / 3.0, 5.0 / 3.0]),
        ([4.0 * RIGHT], [1.0], (False, False), [0.5, 1.5]),
        # two sectors of a right angle, one held: tan^2(l pi / 2) is the ratio of the coefficients
        ([RIGHT, RIGHT], [0.02, 1.0], (True, False), [SOFT, 2.0 - SOFT]),
    ],
)
def test_closed_forms(angle, coefficient, prescribed, wanted):
    found = exponents(np.array(angle), np.array(coefficient), prescribed)
    assert_allclose(found[np.abs(found - 1.0) > 1e-3], wanted, atol=1e-4)


@pytest.mark.parametrize("ratio", [3.0, 10.0, 161.4476387975881, 1000.0, 1e6])
def test_iron_that_touches_iron(ratio):
    """By the closed form, for any contrast and any turn of the squares; two right angles side by side are as one."""
    wanted = 4.0 / np.pi * np.arctan(ratio**-0.5)
    for coefficient in ([1.0, ratio, 1.0, ratio], [ratio, 1.0, ratio, 1.0]):
        assert exponents(np.full(4, RIGHT), np.array(coefficient), None)[0] == pytest.approx(wanted, rel=1e-6)
    turned = np.array([0.3 * RIGHT, RIGHT, RIGHT, RIGHT, 0.7 * RIGHT])
    assert exponents(turned, np.array([1.0, ratio, 1.0, ratio, 1.0]), None)[0] == pytest.approx(wanted, rel=1e-6)


def laplace(mesh, fixed, **tables):
    rim = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes() if fixed is None else fixed)
    ritz = ka.Ritz(np.zeros(mesh.nvertices), rim, **{"coefficient": 1.0} | tables)
    return materials_of(mesh, ritz)


def test_only_the_re_entrant_corner_of_an_l_counts():
    mesh = MeshTri.init_lshaped().refined(2)
    found = singular_nodes(mesh, laplace(mesh, None))
    assert_allclose(mesh.p[:, found], [[0.0], [0.0]], atol=1e-12)


def test_a_change_of_condition_counts_and_a_right_angle_does_not():
    mesh = square(4)
    bottom = np.flatnonzero((mesh.p[1] == 0.0) & (mesh.p[0] <= 0.5))
    found = singular_nodes(mesh, laplace(mesh, bottom))
    assert_allclose(mesh.p[:, found], [[0.5], [0.0]])


def test_corners_of_magnets_and_iron_count_and_straight_interfaces_do_not():
    mesh, problem = two_magnets(1)
    field = problem.solve(mesh)
    assert problem.singular_nodes(mesh, field).size == 8
    of_ritz = singular_nodes(mesh, materials_of(mesh, problem.ritz(mesh, field)))
    assert_array_equal(of_ritz, problem.singular_nodes(mesh, field))
    for order in (3, 6):
        assert_array_equal(of_ritz, problem.singular_nodes(mesh, problem.solve(mesh, order=order)))
    mesh = rectangle_mesh(1)
    region = (mesh.p[0, mesh.t].mean(axis=0) > 0.0).astype(int)
    assert singular_nodes(mesh, laplace(mesh, None, coefficient=[1.0, 50.0], region=region)).size == 0


def test_a_single_fixed_node_inside_counts():
    mesh = square(4)
    centre = int(np.argmin(np.hypot(*(mesh.p - 0.5))))
    found = singular_nodes(mesh, laplace(mesh, np.append(mesh.boundary_nodes(), centre)))
    assert found.tolist() == [centre]
