"""Tetrahedra: what is measured of them, their faces and neighbours, and what is refused."""

import numpy as np
import pytest
from helpers.solids import box
from helpers.tetrahedra import REGULAR, comb, fichera, generic_cube, hollow, lone, sixfold, slit, thrown, turned
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from skfem import Basis, ElementTetP1, MeshTet

import kohonen_adapt as ka
from kohonen_adapt.mesh.adjacency import neighbours_of, positive
from kohonen_adapt.mesh.cells import CELLS, TETRAHEDRON, TRIANGLE
from kohonen_adapt.mesh.host import keys_of
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


@pytest.mark.parametrize("size", [1e-90, 1e-6, 1.0, 1e90])
def test_a_regular_tetrahedron_has_quality_1_at_any_size_and_turn(size):
    for seed in range(5):
        mesh = lone(size * Rotation.random(random_state=seed).as_matrix() @ REGULAR)
        assert ka.quality(mesh) == pytest.approx([1.0], rel=1e-13)


@pytest.mark.parametrize("height", [0.0, 1e-3, 1e-9])
def test_quality_is_the_formula_and_0_of_a_flat_tetrahedron(height):
    p = np.array([[0, 1, 1, 0], [0, 1, 0, 1], [0, 0, height, height]], dtype=float)
    squares = sum(np.sum((p[:, i] - p[:, j]) ** 2) for i in range(4) for j in range(i))
    volume = abs(np.linalg.det(p[:, 1:] - p[:, :1])) / 6
    assert ka.quality(lone(p)) == pytest.approx([12 * (3 * volume) ** (2 / 3) / squares], rel=1e-6, abs=1e-15)
    assert (ka.quality(lone(p))[0] == 0.0) == (height == 0.0)


def test_no_tetrahedron_is_better_than_the_regular_one():
    """A small change of any corner lowers the quality, and by the square of the change."""
    rng = np.random.default_rng(0)
    for step in (1e-3, 1e-4):
        lost = [1 - ka.quality(lone(REGULAR + step * rng.normal(size=(3, 4))))[0] for _ in range(50)]
        assert min(lost) > 0 and max(lost) < 20 * step**2
    assert 0 < ka.quality(MESHES["random"]).min() < ka.quality(MESHES["random"]).max() < 1


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


def test_columns_come_in_their_order_however_many_nodes_there_are():
    rows = np.sort(np.random.default_rng(0).integers(0, 50, (3, 400)), axis=0)
    order = np.lexsort(rows[::-1])
    for count in (50, 3_000_000, 2**31 - 1):  # the last two are too many for a number of three digits to that base
        key = keys_of(rows + count - 50, count)
        assert_array_equal(rows[:, np.argsort(key, kind="stable")], rows[:, order])
        assert len(np.unique(key)) == len(np.unique(rows, axis=1).T)


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


def test_the_table_of_cells_says_what_is_so_of_both():
    for cell in CELLS.values():
        corners = np.hstack([np.zeros((cell.dim, 1)), np.eye(cell.dim)])[:, :, None]
        assert cell.determinant(corners) == pytest.approx([1.0])
        assert len(cell.facets) == cell.dim + 1 and len(cell.edges) == cell.dim * (cell.dim + 1) // 2
        assert [tuple(each) for each in cell.mesh.elem.refdom.facets] == [tuple(sorted(each)) for each in cell.facets]
        for facet, opposite in zip(cell.facets, cell.opposite, strict=True):
            assert {*facet, opposite} == set(range(cell.dim + 1))
        for k, facet in enumerate(
            cell.outward
        ):  # with the corner behind, a facet that is seen from outside is positive
            along = corners[:, facet[1:], 0] - corners[:, facet[:1], 0]
            behind = corners[:, facet[:1], 0] - corners[:, [k], 0]
            assert np.linalg.det(np.hstack([behind, along])) > 0
    assert (TRIANGLE.floor, TETRAHEDRON.floor) == (0.3, 0.2)
