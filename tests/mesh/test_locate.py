"""Elements that hold points, and values of a solution there."""

import numpy as np
import pytest
from helpers.meshes import comb, generic_square, holed, inset, l_shape, perturbed, slit, square
from scipy.interpolate import LinearNDInterpolator
from skfem import MeshTri

from kohonen_adapt import find_elements, interpolate
from kohonen_adapt.mesh.locate import elements_at, walk_to_elements
from kohonen_adapt.mesh.triangulation import Triangulation

BUILDS = {
    "square": lambda: square(7),
    "bad": lambda: perturbed(square(7), 1),
    "delaunay": lambda: generic_square(8),
    "comb": lambda: perturbed(comb(10), 2),
    "hole": lambda: perturbed(holed(9), 3),
    "inset": lambda: inset(8),
    "slit": lambda: perturbed(slit(8), 4),
    "thin": lambda: MeshTri(np.array([[1e-6], [1e3]]) * square(6).p, square(6).t),
    "apart": lambda: MeshTri(np.hstack([square(2).p, square(2).p + 5]), np.hstack([square(2).t, square(2).t + 9])),
}


def shares(mesh, x):
    """Barycentric coordinates of every point in every element, (3, elements, points)."""
    a, b, c = mesh.p[:, mesh.t].transpose(1, 2, 0)
    matrix = np.linalg.inv(np.stack([b - a, c - a], axis=-1))
    two = np.einsum("eij,enj->ien", matrix, x.T[None] - a[:, None])
    return np.concatenate([1 - two.sum(axis=0, keepdims=True), two])


def points_around(mesh, number=400, seed=0):
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    return (low + (high - low) * np.random.default_rng(seed).uniform(-0.2, 1.2, (number, 2))).T


@pytest.mark.parametrize("search", [find_elements, elements_at])
@pytest.mark.parametrize("kind", BUILDS)
def test_points_are_found_in_the_element_that_holds_them_and_nowhere_else(kind, search):
    mesh = BUILDS[kind]()
    x = points_around(mesh)
    depth = shares(mesh, x).min(axis=0)
    found = search(mesh, x)
    clear = np.abs(depth.max(axis=0)) > 1e-8
    assert clear.sum() > 350
    np.testing.assert_array_equal(found[clear] >= 0, depth.max(axis=0)[clear] > 0)
    inside = np.flatnonzero(found >= 0)
    assert depth[found[inside], inside].min() > -1e-9
    assert 0 < len(inside) < 400


@pytest.mark.parametrize("search", [find_elements, elements_at])
@pytest.mark.parametrize("kind", BUILDS)
def test_nodes_and_midpoints_lie_in_the_mesh(kind, search):
    mesh = BUILDS[kind]()
    x = np.hstack([mesh.p, mesh.p[:, mesh.facets].mean(axis=1)])
    found = search(mesh, x)
    assert found.min() >= 0
    assert np.min(shares(mesh, x).min(axis=0)[found, np.arange(len(found))]) > -1e-9


@pytest.mark.parametrize("kind", BUILDS)
def test_linear_functions_are_reproduced_and_outside_there_is_nan(kind):
    mesh = BUILDS[kind]()
    x = points_around(mesh)
    plane = lambda x: 2.0 - 3.0 * x[0] + 0.5 * x[1]  # noqa: E731
    values = interpolate(mesh, plane(mesh.p), x)
    np.testing.assert_array_equal(np.isnan(values), find_elements(mesh, x) < 0)
    inside = ~np.isnan(values)
    np.testing.assert_allclose(values[inside], plane(x[:, inside]), rtol=1e-9, atol=1e-9)


def test_values_are_those_of_an_independent_interpolation():
    mesh = generic_square(9, 3)
    values = np.random.default_rng(0).random(mesh.p.shape[1])
    x = np.random.default_rng(1).random((2, 500))
    reference = LinearNDInterpolator(mesh.p.T, values)(x.T)
    np.testing.assert_allclose(interpolate(mesh, values, x), reference, rtol=1e-9)


def test_nodal_values_come_back_at_the_nodes():
    for build in BUILDS.values():
        mesh = build()
        values = np.random.default_rng(0).random(mesh.p.shape[1])
        pairs = interpolate(mesh, values, mesh.p)
        single = np.unique(mesh.p, axis=1, return_counts=True, return_inverse=True)
        alone = single[2][single[1].ravel()] == 1  # both banks of a slit are the same place
        np.testing.assert_allclose(pairs[alone], values[alone], rtol=1e-9)


def test_points_at_infinity_and_without_a_place_are_outside():
    x = np.array([[np.nan, np.inf, 0.5, -np.inf, 1e300], [0.5, 0.5, np.nan, 0.0, 1e300]])
    assert find_elements(square(3), x).tolist() == [-1] * 5
    assert np.all(np.isnan(interpolate(square(3), np.ones(16), x)))


@pytest.mark.parametrize("kind", [square, inset, slit, holed, l_shape])
@pytest.mark.parametrize("across_regions", [False, True])
def test_a_walk_from_any_element_ends_where_a_search_does(kind, across_regions):
    tri, rng = Triangulation.of(kind(8)), np.random.default_rng(0)
    points, region = tri.centroids(), tri.elements.region
    start = rng.permutation(len(points)).astype(np.int32)
    if not across_regions:
        start = np.array([rng.choice(np.flatnonzero(region == own)) for own in region], dtype=np.int32)
    np.testing.assert_array_equal(walk_to_elements(tri, points, start, across_regions), np.arange(len(points)))


def test_what_no_element_holds_is_said_to_be_in_one_nearby():
    tri = Triangulation.of(square(8))
    found = walk_to_elements(tri, np.array([[1.0 + 1e-6, 0.53]]), np.array([0], dtype=np.int32), across_regions=False)
    assert tri.centroids()[found[0]] == pytest.approx([1.0, 0.53], abs=0.15)


def test_no_points_give_no_values():
    assert interpolate(square(3), np.ones(16), np.empty((2, 0))).shape == (0,)


def test_a_nan_in_the_values_stays_where_it_is():
    values = np.ones(16)
    values[0] = np.nan
    mesh = square(3)
    result = interpolate(mesh, values, mesh.p[:, mesh.t].mean(axis=1))
    np.testing.assert_array_equal(np.isnan(result), (mesh.t == 0).any(axis=0))


@pytest.mark.parametrize("exponent", [-60, -30, 30, 60])
def test_location_does_not_depend_on_the_size_of_the_mesh(exponent):
    mesh = perturbed(l_shape(3), 1)
    x = points_around(mesh)
    np.testing.assert_array_equal(find_elements(mesh.scaled(2.0**exponent), x * 2.0**exponent), find_elements(mesh, x))


def test_a_solution_carried_to_the_same_mesh_is_the_same():
    mesh = perturbed(inset(8), 2)
    values = np.sin(5 * mesh.p[0]) + mesh.p[1]
    np.testing.assert_allclose(interpolate(mesh, values, mesh.p), values, rtol=1e-9)
