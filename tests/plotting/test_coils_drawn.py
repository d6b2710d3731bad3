"""Coils in cuts, from outside and in the view of a report."""

import numpy as np
import pytest
from helpers.magnet_solids import blocks
from helpers.reports import a_pass, a_result, unpacked
from matplotlib.collections import LineCollection, PolyCollection
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Coil
from kohonen_adapt.mesh.slicing import cut_triangles
from kohonen_adapt.plotting import plot_slice, plot_surface
from kohonen_adapt.report.scene import view_data

COIL = Coil.racetrack((0.0, 0.0, 0.1), (0.0, 0.0, 1.0), 1.6, 1.2, 0.3, (0.2, 0.5), 10.0)
T = np.linspace(-2.0, 2.0, 6)


def length_of(segments):
    return np.hypot(*(segments[:, 1] - segments[:, 0])).sum()


def test_a_cut_along_the_winding_is_its_outline():
    segments = cut_triangles(COIL.winding.surface, ka.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    straight = 2.0 * (1.6 + 1.2 - 4.0 * 0.3)
    assert length_of(segments) == pytest.approx(2.0 * (straight + 2.0 * np.pi * 0.3), rel=1e-3)
    assert not cut_triangles(COIL.winding.surface, ka.Plane((0.0, 0.0, 2.0), (0.0, 0.0, 1.0))).size


def test_pictures_have_coils():
    mesh = blocks([T, T, T], {})
    ax = plot_slice(mesh, ka.Plane((0.0, 0.1, 0.0), (0.0, 1.0, 0.0)), coils=[COIL, COIL], unit="mm")
    lines = [each for each in ax.collections if isinstance(each, LineCollection)]
    ends = np.array(lines[-1].get_segments())
    assert_allclose([ends.min(), ends.max()], [-900.0, 900.0])
    plain = len(plot_surface(mesh).collections)
    drawn = [each for each in plot_surface(mesh, coils=[COIL]).collections if isinstance(each, PolyCollection)]
    assert len(drawn) == plain + 1 and len(drawn[-1].get_paths()) == 4


@pytest.mark.parametrize("coils", [{"winding": COIL}, COIL, ["winding"]])
def test_coils_are_drawn_from_a_list(coils):
    mesh = blocks([T, T, T], {})
    for draw in (
        lambda: plot_surface(mesh, coils=coils),
        lambda: plot_slice(mesh, ka.Plane((0.0, 0.1, 0.0), (0.0, 1.0, 0.0)), coils=coils),
    ):
        with pytest.raises(
            ValueError, match=r"^coils must be a list of Coil, as list\(problem.coils.values\(\)\); got"
        ):
            draw()


def test_the_view_of_a_report_has_the_section():
    mesh = blocks([T, T, T], {})
    result = a_result(mesh, [a_pass(0, mesh, 1.0)])
    common = {"fields": ({}, {}), "indicator_label": "", "why": [], "unit": "m", "axisymmetric": False}
    plane = ka.Plane((0.0, 0.1, 0.0), (0.0, 1.0, 0.0))
    with_coil, without = (
        view_data({"before": result}, plane=plane, coils=coils, **common)["meshes"][0] for coils in ([COIL], [])
    )
    lines = unpacked(with_coil["outline"])[len(unpacked(without["outline"])) :].reshape(-1, 2)
    x, y = (unpacked(with_coil[name]) for name in "xy")
    assert np.hypot(np.diff(x[lines]), np.diff(y[lines])).sum() == pytest.approx(2.8, rel=1e-5)
    assert lines.max() == len(x) - 1
