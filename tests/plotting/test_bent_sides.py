"""Pictures and reports of a `MeshTri2` show its bent sides bent."""

import numpy as np
from helpers.meshes import disk
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal
from skfem import MeshTri2

from kohonen_adapt import Rules
from kohonen_adapt.commands.check import outlines_described
from kohonen_adapt.display import PARTS, divided, lattice, straight_and_curved
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.slicing import flat
from kohonen_adapt.plotting import draw_field_lines, draw_indicators, draw_mesh, plot_outlines
from kohonen_adapt.report.scene import _mesh

ROUND = MovableMesh.of(disk(3, 1.0), Rules(), curved=True).mesh()
FLAT = 2e-4  # how far parabolas of 20 degrees and their pieces are off the circle


def radii_of(line):
    x, y = line.get_data()
    return np.hypot(x, y)


def test_the_outline_is_a_circle_and_edges_inside_are_straight():
    axes = Figure().add_subplot()
    draw_mesh(axes, ROUND, unit="")
    *_, rim = axes.lines
    found = radii_of(rim)
    assert np.sum(np.isfinite(found)) == (PARTS + 1) * len(ROUND.boundary_facets())
    assert_allclose(found[np.isfinite(found)], 1.0, atol=FLAT)
    straight, bent = straight_and_curved(ROUND, np.arange(ROUND.facets.shape[1]))
    assert len(straight) + bent.shape[2] == ROUND.facets.shape[1]
    assert set(straight) == set(range(ROUND.facets.shape[1])) - set(ROUND.boundary_facets())


def test_elements_are_divided_between_their_bent_sides():
    fine = divided(ROUND, PARTS)
    assert_allclose(area(fine).sum(), np.pi, rtol=1e-3)
    assert_allclose(np.hypot(*fine.p).max(), 1.0, atol=FLAT)
    parts = area(fine).reshape(PARTS**2, -1).sum(axis=0)
    assert_allclose(parts, area(ROUND), rtol=1e-2)


def test_colours_and_lines_reach_the_arc():
    figure = Figure()
    one, other = figure.subplots(1, 2)
    shades = draw_indicators(one, ROUND, np.arange(1.0, ROUND.nelements + 1.0), unit="")
    outlines = [path.vertices for path in shades.get_paths()]  # closed
    areas = [0.5 * abs(np.sum(x[:-1, 0] * x[1:, 1] - x[:-1, 1] * x[1:, 0])) for x in outlines]
    assert_allclose(areas, area(ROUND)[shades.get_array().astype(int) - 1], rtol=1e-2)
    colours = draw_field_lines(other, ROUND, ROUND.p[0, : ROUND.nvertices], np.ones((3, ROUND.nelements)), unit="")
    assert colours.get_array().size == lattice(PARTS)[0].shape[1] * ROUND.nelements
    places = np.concatenate(outlines)
    assert_allclose(np.hypot(*places.T).max(), 1.0, atol=FLAT)


def test_a_report_has_lines_along_the_arc(monkeypatch):
    monkeypatch.setattr("kohonen_adapt.report.scene.packed", lambda values, kind, **how: np.asarray(values))
    shown = _mesh(flat(ROUND, None), (), "")
    places = np.stack([shown["x"], shown["y"]]) + np.array(shown["centre"])[:, None]
    assert shown["outline"].shape == (PARTS * len(ROUND.boundary_facets()), 2)
    assert_allclose(np.hypot(*places[:, shown["outline"]]), 1.0, atol=FLAT)
    assert_array_equal(shown["t"], ROUND.t)


def test_chains_are_called_what_they_are():
    mesh = MeshTri2(ROUND.p * np.array([[2.0], [1.0]]), ROUND.t)
    words = [text.get_text() for text in plot_outlines(mesh, unit="").get_legend().get_texts()]
    assert "1 chain on a spline through midside nodes" in words
    assert not any("straight" in word for word in words)
    lines = outlines_described(MovableMesh.of(mesh, Rules()))
    assert lines[0] == "boundaries and interfaces: 1 segment, 0 straight, 0 on arcs, 1 on splines, 1 closed"
