"""Tetrahedra: what is measured of them, their faces and neighbours, and what is refused."""

import numpy as np
import pytest
from helpers.solids import box
from helpers.tetrahedra import REGULAR, comb, fichera, generic_cube, hollow, lone, sixfold, slit, thrown, turned
from numpy.testing import assert_allclose, assert_array_equal
from skfem import Basis, ElementTetP1, MeshTet

import kohonen_adapt as ka
from kohonen_adapt.mesh.adjacency import neighbours_of, positive
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients, signed_area

MESHES = {
    "one": lone(REGULAR),
    "cube": box(3),
    "five": MeshTet(),
    "random": thrown(generic_cube(4), 1),
    "hollow": hollow(3),
    "comb": comb(5),
    "slit": slit(4),
    "fichera": fichera(2),
}


@pytest.mark.parametrize("height", [0.0, 1e-3, 1e-9])
def test_quality_is_the_formula_and_0_of_a_flat_tetrahedron(height):
    p = np.array([[0, 1, 1, 0], [0, 1, 0, 1], [0, 0, height, height]], dtype=float)
    squares = sum(np.sum((p[:, i] - p[:, j]) ** 2) for i in range(4) for j in range(i))
    volume = abs(np.linalg.det(p[:, 1:] - p[:, :1])) / 6
    assert ka.quality(lone(p)) == pytest.approx([12 * (3 * volume) ** (2 / 3) / squares], rel=1e-6, abs=1e-15)
    assert (ka.quality(lone(p))[0] == 0.0) == (height == 0.0)


@pytest.mark.parametrize("name", MESHES)
def test_volumes_have_the_signs_of_determinants_and_fill_the_domain(name):
    mesh = MESHES[name]
    assert_allclose(signed_area(mesh), sixfold(mesh.p, mesh.t) / 6, rtol=1e-9, atol=1e-16)
    assert_array_equal(area(mesh), np.abs(signed_area(mesh)))
    known = {"one": 1 / 3, "hollow": 26 / 27, "comb": 1 - 2 * 0.2 * 0.8, "fichera": 7.0}
    assert area(mesh).sum() == pytest.approx(known.get(name, 1.0), rel=1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_gradients_are_those_of_linear_functions_and_of_scikit_fem(name):
    mesh = MESHES[name]
    slope = np.array([2.0, -3.0, 0.5])
    assert gradient(mesh, slope @ mesh.p + 7.0) == pytest.approx(slope[:, None] * np.ones(mesh.nelements), abs=1e-8)
    values = np.random.default_rng(0).normal(size=mesh.p.shape[1])
    basis = Basis(mesh, ElementTetP1(), intorder=1)
    theirs = basis.interpolate(values).grad[:, :, 0]
    assert_allclose(gradient(mesh, values), theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())
    assert_allclose(hat_gradients(mesh).sum(axis=1), 0.0, atol=1e-9 * np.abs(hat_gradients(mesh)).max())


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("seed", [None, 0])
def test_neighbours_share_the_face_opposite_to_a_corner(name, seed):
    mesh = MESHES[name] if seed is None else turned(MESHES[name], seed)
    node = positive(np.ascontiguousarray(mesh.p.T), mesh.t)
    assert sixfold(mesh.p, node.T).min() > 0
    assert_array_equal(np.sort(node.T, axis=0), np.sort(mesh.t, axis=0))
    neighbour = neighbours_of(node, mesh.p.T)
    for e, k in np.ndindex(neighbour.shape):
        (facet,) = [f for f in mesh.t2f[:, e] if not np.any(mesh.facets[:, f] == node[e, k])]
        (other,) = set(mesh.f2t[:, facet]) - {e}
        assert neighbour[e, k] == other
