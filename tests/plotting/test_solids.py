"""Pictures of tetrahedra: what of a cut is drawn, which faces are seen from outside, in which colours."""

import numpy as np
import pytest
from helpers.mesh_files import two_boxes
from helpers.reports import a_pass
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from skfem import MeshTet, MeshTri

import kohonen_adapt as ka
from kohonen_adapt import plotting
from kohonen_adapt.mesh.curved import Isoparametric
from kohonen_adapt.mesh.slicing import flat
from kohonen_adapt.plotting.solids import _camera, _faces

MESH = two_boxes(1)
MIDDLE = ka.Plane((0.5, 0.5, 0.4), (0.0, 0.0, 1.0))


def words(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_a_cut_in_the_colours_of_its_subdomains():
    axes = plotting.plot_slice(MESH, ka.Plane((0.5, 0.4, 0.4), (0.0, 1.0, 0.0)), unit="mm")
    assert sorted(words(axes)) == ["low", "low, left", "upper half", "upper half, left"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (mm)", "z (mm)")
    (triangles,) = axes.collections
    assert len(np.unique(triangles.get_array())) == 4


def test_a_cut_in_the_colours_of_values(tmp_path):
    axes = plotting.plot_slice(MESH, MIDDLE, MESH.p[0], label="x")
    assert axes.collections[0].get_array().min() >= 0.0  # of nodes: linear between them
    count = MESH.nelements
    axes = plotting.plot_slice(MESH, MIDDLE, np.arange(count), label="number")
    assert set(axes.collections[0].get_array()) <= set(range(count))
    assert axes.figure.axes[1].get_ylabel() == "number" and axes.get_legend() is None
    axes.figure.savefig(tmp_path / "slice.png")


def test_every_picture_of_a_plane_mesh_has_a_cut_of_tetrahedra():
    figure = Figure()
    panels, count = figure.subplots(1, 3), MESH.nelements
    plotting.draw_mesh(panels[0], MESH, plane=MIDDLE)
    drawn = sum(len(line.get_xdata()) // 3 for line in panels[0].lines)
    assert drawn == len(flat(MESH, MIDDLE).sides) < flat(MESH, MIDDLE).mesh.facets.shape[1]
    plotting.draw_indicators(panels[1], MESH, np.ones(count), plane=MIDDLE)
    plotting.draw_field_lines(panels[2], MESH, MESH.p[0], np.ones(count), plane=MIDDLE)
    axes = plotting.plot_density(MESH, np.full(count, 8.0), plane=MIDDLE, unit="mm")
    assert axes.figure.axes[1].get_ylabel() == "nodes asked for per mm³"
    assert_allclose(axes.collections[0].get_array(), 8e-9)
    assert "mean" in plotting.plot_qualities({"mesh": MESH}).get_legend().get_texts()[0].get_text()


def test_only_faces_that_look_here_are_seen_and_near_ones_last():
    mesh = MeshTet.init_tensor(*[np.linspace(0, 1, 3)] * 3)
    axes = plotting.plot_surface(mesh, view=(-60.0, 25.0))
    (faces,) = axes.collections
    assert isinstance(faces, PolyCollection) and len(faces.get_paths()) == 3 * 8
    rim, camera = mesh.boundary_facets(), _camera(-60.0, 25.0)
    _, order, _ = _faces(Isoparametric(mesh), rim, camera, 1.0)
    centres = mesh.p[:, mesh.facets[:, rim[order]]].mean(axis=1)
    assert np.all(np.diff(camera[2] @ centres) >= 0.0)
    assert_allclose(camera @ camera.T, np.eye(3), atol=1e-15)
    assert axes.get_xlabel() == "1 x 1 x 1 m"


def test_the_surface_in_the_colours_of_names():
    axes = plotting.plot_surface(MESH)
    assert words(axes) == ["no name", "outer, with a corner", "with a corner", "sheet"]  # the wall is inside
    assert sorted(words(plotting.plot_surface(MESH, "subdomains")))[0] == "low"
    axes = plotting.plot_surface(MESH, np.arange(MESH.nelements), label="number")
    assert axes.figure.axes[1].get_ylabel() == "number" and axes.get_legend() is None


def test_passes_are_filmed_in_a_cut(tmp_path):
    plotting.animate_passes(tmp_path / "cut.gif", [a_pass(k, MESH, 1.0) for k in range(2)], plane=MIDDLE)
    assert (tmp_path / "cut.gif").read_bytes()[:4] == b"GIF8"


def test_what_is_refused():
    with pytest.raises(ValueError, match="a mesh of triangles is drawn by draw_mesh"):
        plotting.plot_surface(MeshTri())
    with pytest.raises(ValueError, match='values must be numbers, "boundaries" or "subdomains"; got \'faces\''):
        plotting.plot_surface(MESH, "faces")
    with pytest.raises(TypeError, match=r"no argument 'names'\. Did you mean 'values'"):
        plotting.plot_surface(MESH, names="subdomains")
    with pytest.raises(ValueError, match="values must have shape"):
        plotting.plot_slice(MESH, MIDDLE, np.ones(3))
    with pytest.raises(ValueError, match="shown in a cut"):
        plotting.draw_mesh(Figure().subplots(), MESH)
    with pytest.raises(ValueError, match=r"plane must be a Plane.*; got \(0, 0, 1\)"):
        plotting.plot_slice(MESH, (0, 0, 1))
