"""A `MeshTri2` is its straight triangles and what bends them, and determinants are bounded from below."""

import numpy as np
import pytest
from helpers.meshes import inset, perturbed, square
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri, MeshTri2
from skfem.generic_utils import OrientedBoundary

import kohonen_adapt as ka
from kohonen_adapt.mesh.curved import (
    Isoparametric,
    corners_of,
    determinant_coefficients,
    midside_offsets,
    offsets_of_sides,
    refined,
    with_midside_offsets,
)
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.validity import check_mesh

MESH = perturbed(inset(6), 2).with_boundaries({"left": lambda x: x[0] == 0.0})
ORIENTED = OrientedBoundary(np.array([3, 8, 20]), np.array([0, 1, 0]))


def named():
    return MeshTri(MESH.p, MESH.t, {**MESH.boundaries, "sheet": ORIENTED}, MESH.subdomains)


def bent(mesh, size, seed=0):
    off = size * np.random.default_rng(seed).uniform(-1.0, 1.0, (2, mesh.facets.shape[1]))
    return with_midside_offsets(mesh, off), off


def test_corners_and_displacements_make_up_the_mesh():
    mesh = named()
    curved, off = bent(mesh, 0.01)
    assert type(curved) is MeshTri2 and curved.nvertices == mesh.nvertices
    assert_allclose(offsets_of_sides(curved), off, atol=1e-16)
    straight = corners_of(curved)
    assert type(straight) is MeshTri and corners_of(mesh) is mesh
    for array in ("p", "t", "facets", "t2f", "f2t"):
        assert_array_equal(getattr(straight, array), getattr(mesh, array))
    for each in (curved, straight):
        assert list(each.subdomains) == list(mesh.subdomains) and list(each.boundaries) == ["left", "sheet"]
        assert_array_equal(each.boundaries["sheet"].ori, ORIENTED.ori)
        assert_array_equal(each.boundaries["left"], mesh.boundaries["left"])
    assert not np.any(offsets_of_sides(mesh)) and not np.any(offsets_of_sides(MeshTri2.from_mesh(mesh)) > 1e-15)


def test_determinants_are_those_of_scikit_fem_and_the_coefficients_bound_them():
    curved, _ = bent(MESH, 0.04)
    coefficients = determinant_coefficients(curved.p[:, curved.t], midside_offsets(curved))
    x, y = points = np.random.default_rng(1).dirichlet(np.ones(3), 200).T[1:]
    found = coefficients.T @ bernstein(np.stack([1.0 - x - y, x, y]))
    assert_allclose(found, curved._mapping().detDF(points), atol=1e-14)
    assert np.all(coefficients.min(axis=0)[:, None] <= found + 1e-15)
    assert_allclose(coefficients[0], curved._mapping().detDF(np.zeros((2, 1)))[:, 0], atol=1e-14)


def bernstein(shares):
    """Values of the Bernstein polynomials of degree 2 in the order of the coefficients, (6, n)."""
    return np.stack([(1 + (i != j)) * shares[i] * shares[j] for i in range(3) for j in range(i, 3)])


def one_bent(side):
    """Two triangles with their common side bent towards one of them."""
    mesh = MeshTri()
    off = np.zeros((2, mesh.facets.shape[1]))
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    off[:, inner] = side
    return with_midside_offsets(mesh, off)


def test_folded_elements_are_refused_and_no_others():
    for ratio in (0.1, 0.24):
        check_mesh(one_bent(ratio), curved=True)
    calls = {
        "check": lambda mesh: check_mesh(mesh, curved=True),
        "quality": ka.quality,
        "find": lambda mesh: ka.find_elements(mesh, [[0.5], [0.5]]),
        "interpolate": lambda mesh: ka.interpolate(mesh, np.ones(4), [[0.5], [0.5]]),
        "density": lambda mesh: ka.density_from_indicators(mesh, np.ones(2)),
    }
    for call in calls.values():
        with pytest.raises(ValueError, match=r"must not invert elements; 1 are inverted, first element [01]\."):
            call(one_bent(0.26))


def test_nodes_must_be_as_many_as_corners_and_sides():
    curved = MeshTri2.from_mesh(square(2))
    broken = MeshTri2(np.hstack([curved.p, np.full((2, 1), 0.5)]), curved.t)
    with pytest.raises(ValueError, match=r"a finite node for every corner and every side, 25 in all; got 26\."):
        ka.quality(broken)
    curved.p[0, -1] = np.nan
    with pytest.raises(ValueError, match=r"25 in all; got 24\."):
        ka.quality(curved)


def test_a_mesh_cut_in_four_has_the_names_and_the_curves_that_it_had():
    straight, rng = perturbed(square(6), 3), np.random.default_rng(3)
    off = 0.001 * rng.uniform(-1.0, 1.0, straight.facets.shape)
    mesh = with_midside_offsets(straight.with_subdomains({"left": lambda x: x[0] < 0.5}), off)
    finer = refined(mesh)
    check_mesh(finer, curved=True)
    assert finer.subdomains["left"].size == 4 * mesh.subdomains["left"].size
    assert_allclose(area(finer).reshape(4, -1).sum(axis=0), area(mesh), rtol=1e-12)
    share = rng.dirichlet(np.ones(3), 40).T
    element, there = Isoparametric(finer), np.arange(40) % finer.t.shape[1]
    x = element.points(there, share)
    found, _ = Isoparametric(mesh).locate(x, there % mesh.t.shape[1])
    assert_array_equal(found, there % mesh.t.shape[1])
