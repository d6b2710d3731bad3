"""Cuts through tetrahedra: areas, values and names of the pieces, wherever the plane lies."""

import numpy as np
import pytest
from helpers.examples import examples
from helpers.mesh_files import two_boxes
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.slicing import flat

GRID = MeshTet.init_tensor(*[np.linspace(0, 1, 5)] * 3).with_subdomains({"low": lambda x: x[2] < 0.5})


@pytest.mark.parametrize(
    ("point", "normal", "size", "low"),
    [
        ((0.3, 0.3, 0.3), (0, 1, 0), 1.0, 0.5),
        ((0.3, 0.3, 0.3), (0, 0, -2), 1.0, 1.0),
        ((0.5, 0.5, 0.5), (1, 0, 0), 1.0, 0.5),  # through faces of elements
        ((0.0, 0.0, 0.0), (1, 0, 0), 1.0, 0.5),  # along the rim, with the mesh above it
        ((1.0, 1.0, 1.0), (0, 1, 0), 1.0, 0.5),  # and below it
        ((0.5, 0.5, 0.1), (1, 1, 0), np.sqrt(2.0), np.sqrt(0.5)),
        ((0.5, 0.5, 0.5), (1, 1, 1), 0.75 * np.sqrt(3.0), 0.375 * np.sqrt(3.0)),
    ],
)
def test_the_pieces_cover_the_cut_once(point, normal, size, low):
    cut = flat(GRID, ka.Plane(point, normal))
    assert area(cut.mesh).sum() == pytest.approx(size, rel=1e-12) and area(cut.mesh).min() > 0.0
    assert area(cut.mesh)[cut.mesh.subdomains["low"]].sum() == pytest.approx(low, rel=1e-12)
    assert len(np.unique(cut.mesh.p.round(9), axis=1).T) == cut.mesh.p.shape[1] == 1 + cut.mesh.t.max()


@examples(25)
@given(point=st.tuples(*[st.floats(0.2, 0.8)] * 3), normal=st.tuples(*[st.integers(-3, 3)] * 3).filter(any))
def test_the_cuts_of_two_neighbours_meet(point, normal):
    """The rim of the cut is where the rim of the solid is cut: pieces inside have a neighbour at every side."""
    mesh = two_boxes(1)
    cut = flat(mesh, ka.Plane(point, normal))
    rim = cut.mesh.boundary_facets()
    ends = np.unique(cut.mesh.facets[:, rim])
    on_rim = np.isin(cut.ends[:, ends], mesh.boundary_nodes()).all(axis=0)
    assert on_rim.all()
    assert cut.of_nodes(np.ones(mesh.p.shape[1])) == pytest.approx(1.0)
    x = cut.of_nodes(mesh.p[0])
    centre = mesh.p[0, mesh.t[:, cut.element]]
    assert np.all(x[cut.mesh.t].min(axis=0) >= centre.min(axis=0) - 1e-12)
    assert np.all(x[cut.mesh.t].max(axis=0) <= centre.max(axis=0) + 1e-12)


def test_axes_aslant_are_called_by_their_direction():
    aslant = flat(GRID, ka.Plane((0.5, 0.5, 0.5), (1.0, 1.0, 0.0)))
    assert aslant.axes == ("along (0.707, -0.707, 0)", "z")
    assert_allclose(np.ptp(aslant.mesh.p, axis=1), [np.sqrt(2.0), 1.0])


def test_a_plane_mesh_is_shown_as_it_is():
    mesh = MeshTri()
    assert flat(mesh, None).mesh is mesh
    assert_array_equal(flat(mesh, None).sides, np.arange(5))
    with pytest.raises(ValueError, match="plane cuts tetrahedra only; got a plane mesh"):
        flat(mesh, ka.Plane((0, 0, 0), (0, 0, 1)))


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"from -2 to -1 along its normal from its point \(0\.0, 0\.0, 2\.0\)"):
        flat(GRID, ka.Plane((0, 0, 2), (0, 0, 5)))
    with pytest.raises(ValueError, match=r"shown in a cut: plane=ka\.Plane\(point, normal\)\. Or plot_surface"):
        flat(GRID, None)


def test_values_that_are_linear_stay_so_and_elements_keep_theirs():
    cut = flat(GRID, ka.Plane((0.4, 0.4, 0.4), (0.0, 1.0, 0.0)))
    assert cut.axes == ("x", "z")
    assert_allclose(cut.of_nodes(GRID.p[0]), cut.mesh.p[0], atol=1e-15)
    assert_allclose(cut.of_nodes(GRID.p[2]), cut.mesh.p[1], atol=1e-15)
    assert_allclose(cut.of_nodes(GRID.p[1]), 0.4, atol=1e-15)
    middle, own = cut.mesh.p[:, cut.mesh.t].mean(axis=1), GRID.p[:, GRID.t[:, cut.of_elements(np.arange(384))]]
    assert np.all(own.min(axis=1)[[0, 2]] <= middle + 1e-12) and np.all(middle <= own.max(axis=1)[[0, 2]] + 1e-12)


def test_a_quadrilateral_has_no_diagonal_among_its_sides():
    one = MeshTet(np.eye(4)[1:], np.arange(4)[:, None])
    cut = flat(one, ka.Plane((0.25, 0.25, 0.0), (1.0, 1.0, 0.0)))  # two of its corners are on each side
    assert (cut.mesh.t.shape[1], len(cut.sides), cut.mesh.facets.shape[1]) == (2, 4, 5)
