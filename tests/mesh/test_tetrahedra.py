"""Tetrahedra: what is measured of them, their faces and neighbours, and what is refused."""

import numpy as np
import pytest
from helpers.solids import box
from helpers.tetrahedra import REGULAR, comb, fichera, generic_cube, hollow, lone, slit, thrown
from numpy.testing import assert_allclose, assert_array_equal
from skfem import Basis, ElementTetP1, MeshTet

import kohonen_adapt as ka
from kohonen_adapt.mesh.host import keys_of
from kohonen_adapt.mesh.measures import gradient, hat_gradients

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
def test_gradients_are_those_of_linear_functions_and_of_scikit_fem(name):
    mesh = MESHES[name]
    slope = np.array([2.0, -3.0, 0.5])
    assert gradient(mesh, slope @ mesh.p + 7.0) == pytest.approx(slope[:, None] * np.ones(mesh.nelements), abs=1e-8)
    values = np.random.default_rng(0).normal(size=mesh.p.shape[1])
    basis = Basis(mesh, ElementTetP1(), intorder=1)
    theirs = basis.interpolate(values).grad[:, :, 0]
    assert_allclose(gradient(mesh, values), theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())
    assert_allclose(hat_gradients(mesh).sum(axis=1), 0.0, atol=1e-9 * np.abs(hat_gradients(mesh)).max())


def test_columns_come_in_their_order_however_many_nodes_there_are():
    rows = np.sort(np.random.default_rng(0).integers(0, 50, (3, 400)), axis=0)
    order = np.lexsort(rows[::-1])
    for count in (50, 3_000_000, 2**31 - 1):  # the last two are too many for a number of three digits to that base
        key = keys_of(rows + count - 50, count)
        assert_array_equal(rows[:, np.argsort(key, kind="stable")], rows[:, order])
        assert len(np.unique(key)) == len(np.unique(rows, axis=1).T)
