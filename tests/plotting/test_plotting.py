"""Pictures: what is drawn, on which scale, with which units, and how fast."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.meshes import inset, junction, named, ring, square
from helpers.reports import a_pass
from helpers.reports import a_result as result_of
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import LogNorm, to_hex
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Arc, Line, plotting
from kohonen_adapt.display import lattice
from kohonen_adapt.magnetostatics import Arctan, Table


def two_regions(levels=3):
    mesh = MeshTri().refined(levels)
    return mesh.with_subdomains({"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5})


def a_result(mesh, indicators):
    """Of two passes, the second better, with these indicators."""
    return replace(result_of(mesh, [a_pass(0, mesh, 1.0), a_pass(1, mesh, 0.5)]), indicators=indicators)


def axes():
    return Figure().subplots()


def test_the_page_has_its_labels_and_nothing_is_cut_off(tmp_path):
    """Every title, label and number lies inside the page, and no two titles meet."""
    mesh = two_regions()
    before, after = a_result(mesh, np.linspace(0.1, 2.0, 128)), a_result(mesh, np.full(128, 0.3))
    values = {
        "potential": mesh.p[0],
        "magnitude": np.linspace(0.0, 1.0, 128),
        "magnitude_label": "flux density |B| (T)",
    }
    figure = plotting.adaptation_figure(before, after, **values, unit="mm", errors=[0.9, 0.4])
    figure.savefig(tmp_path / "page.png", dpi=50)
    assert (tmp_path / "page.png").stat().st_size > 10_000
    labels = {label for each in figure.axes for label in (each.get_xlabel(), each.get_ylabel())}
    assert labels >= {
        *("x (mm)", "y (mm)", "flux density |B| (T)", "error indicator of an element"),
        *("relocations, with 81 nodes", "energy-norm error (%)"),
    }
    shades = [each.collections[0] for each in figure.axes if "indicators" in each.get_title()]
    assert len(shades) == 2 and shades[0].norm is shades[1].norm
    assert (shades[0].norm.vmin, shades[0].norm.vmax) == pytest.approx((2e-3, 2.0))
    figure.draw_without_rendering()
    page = figure.bbox
    for each in figure.axes:
        box = each.get_tightbbox()
        assert box.x0 >= page.x0 and box.y0 >= page.y0 and box.x1 <= page.x1 and box.y1 <= page.y1
    boxes = [each.title.get_window_extent() for each in figure.axes if each.get_title()]
    assert len(boxes) == 6
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])


def facets_of(line):
    """The ends of the facets in a line with gaps, (f, 2, 2)."""
    return np.array(line.get_data()).reshape(2, -1, 3)[:, :, :2].transpose(1, 0, 2)


def test_a_mesh_is_drawn_with_every_edge_once_and_its_regions_outlined():
    mesh, drawing = two_regions(2), axes()
    plotting.draw_mesh(drawing, mesh)
    thin, thick = (facets_of(line) for line in drawing.lines)
    drawn = {frozenset(map(tuple, ends.T.tolist())) for ends in np.concatenate([thin, thick])}
    assert drawn == {frozenset(map(tuple, ends.T.tolist())) for ends in mesh.p[:, mesh.facets].transpose(2, 0, 1)}
    assert len(thin) + len(thick) == mesh.facets.shape[1]
    assert len(thick) == 16 + 4  # the rim and the interface
    assert (drawing.get_xlabel(), drawing.get_ylabel()) == ("x (m)", "y (m)")
    assert drawing.get_aspect() == 1.0


def test_lengths_are_drawn_in_the_unit():
    mesh, drawing = two_regions(2), axes()
    plotting.draw_mesh(drawing, mesh, unit="mm")
    assert facets_of(drawing.lines[0]).max() == pytest.approx(1000.0)
    plotting.draw_mesh(drawing, mesh, unit="")
    assert drawing.get_xlabel() == "x"
    with pytest.raises(ValueError, match="unit must be one of '', 'm', 'mm'; got 'inch'"):
        plotting.draw_mesh(drawing, mesh, unit="inch")


def test_field_lines_are_contours_of_the_potential():
    mesh, drawing = two_regions(), axes()
    colours = plotting.draw_field_lines(drawing, mesh, mesh.p[0], np.ones(128), lines=3)
    contours = next(each for each in drawing.collections if hasattr(each, "levels"))
    assert_allclose(contours.levels, [0.25, 0.5, 0.75])
    assert colours.norm.vmax == 1.0


def test_fields_of_higher_order_are_drawn_as_they_are_inside_elements():
    """A quadratic potential and its linear field, of a mesh of two elements, at the points of lattices."""
    mesh, drawing = MeshTri(), axes()
    share, _ = lattice(2)
    x = np.einsum("iq,ik->qk", share, mesh.p[0, mesh.t])
    colours = plotting.draw_field_lines(drawing, mesh, x**2, 2.0 * x + [0.0, 5.0], lines=1)
    assert_allclose(colours.get_array(), (2.0 * x + [0.0, 5.0]).ravel())
    contours = next(each for each in drawing.collections if hasattr(each, "levels"))
    # From 0 to 1/4 between the first two points of a side, to 1 at the third: 1/2 is at 2/3. By corners it is at 1/2.
    assert_allclose(contours.levels, [0.5])
    assert_allclose(np.concatenate([path.vertices for path in contours.get_paths()])[:, 0], 2.0 / 3.0)
    drawing.figure.canvas.draw()


def test_a_constant_potential_has_no_field_lines():
    mesh, drawing = two_regions(), axes()
    plotting.draw_field_lines(drawing, mesh, np.zeros(81), np.zeros(128))
    assert not any(hasattr(each, "levels") for each in drawing.collections)


def test_colours_end_where_a_hundredth_of_the_area_has_more():
    mesh = MeshTri().refined(4)
    magnitude = np.ones(512)
    magnitude[:4] = 50.0  # a spike on less than a hundredth
    assert plotting.draw_field_lines(axes(), mesh, mesh.p[0], magnitude).norm.vmax == 1.0


def test_indicators_that_are_all_zero_can_be_drawn():
    mesh = two_regions()
    assert plotting.draw_indicators(axes(), mesh, np.zeros(128)).norm.vmax == 1.0


@pytest.mark.parametrize(
    ("energy_norm", "calibrated", "wanted", "label"),
    [
        (2.0, True, [50.0, 25.0], "energy-norm error (%)"),
        (None, True, [1.0, 0.5], "energy-norm error"),
        (2.0, False, [1.0, 0.5], "indicator"),
    ],
)
def test_passes(energy_norm, calibrated, wanted, label):
    """What nobody vouches for is neither called an error nor shown as a share of the energy norm."""
    drawing = axes()
    history = [
        replace(a_pass(k, two_regions(), 1.0 / (1 + k)), energy_norm=energy_norm, calibrated=calibrated)
        for k in range(2)
    ]
    plotting.draw_passes(drawing, history)
    assert_allclose(drawing.lines[0].get_ydata(), wanted)
    assert drawing.get_ylabel() == label
    assert drawing.get_ylim()[0] == 0.0


def test_wrong_shapes():
    mesh = two_regions()
    with pytest.raises(ValueError, match=r"indicators must have shape \(nelements,\) = \(128,\); got \(81,\)"):
        plotting.draw_indicators(axes(), mesh, np.ones(81))
    with pytest.raises(ValueError, match=r"potential must have shape \(nnodes,\) = \(81,\); got \(3,\)"):
        plotting.draw_field_lines(axes(), mesh, np.ones(3), np.ones(128))
    with pytest.raises(ValueError, match=r"magnitude must have shape \(k, nelements\) = \(k, 128\) .*; got \(2, 128\)"):
        plotting.draw_field_lines(axes(), mesh, np.ones(81), np.ones((2, 128)))
    with pytest.raises(ValueError, match=r"density must have shape \(nelements,\) = \(128,\); got \(81,\)"):
        plotting.plot_density(mesh, np.ones(81))
    with pytest.raises(ValueError, match=r"errors must have shape \(passes,\) = \(1,\); got \(2,\)"):
        plotting.draw_passes(axes(), [a_pass(0, mesh, 1.0)], errors=[1.0, 2.0])


def legend_of(drawing):
    return [text.get_text() for text in drawing.get_legend().get_texts()]


def chains_drawn(drawing):
    """All chains of a picture, (points, colour) each; the first collection are the facets."""
    found = []
    for each in [each for each in drawing.collections[1:] if not isinstance(each, PathCollection)]:
        assert isinstance(each, LineCollection)
        found += zip(each.get_segments(), map(to_hex, each.get_colors()), strict=True)
    return found


def test_every_node_is_drawn_once_as_what_it_may_do():
    mesh = junction(8)
    drawing = plotting.plot_outlines(mesh, pinned=[20])
    assert legend_of(drawing)[:5] == [
        "10 chains straight",
        f"{81 - 32 - 10 - 1} nodes free",
        f"{32 + 10 - 8} nodes sliding",
        "4 nodes at corners",
        "5 nodes fixed",
    ]
    markers = [line for line in drawing.lines if line.get_marker() in ("o", "s")]
    drawn = np.hstack([np.array(line.get_data()) for line in markers])
    assert sorted(zip(*drawn, strict=True)) == sorted(zip(*mesh.p, strict=True))
    hollow = next(line for line in markers if line.get_markerfacecolor() == "white")
    assert set(zip(*np.array(hollow.get_data()), strict=True)) == {(0, 0), (0, 1), (1, 0), (1, 1)}


def test_held_nodes_have_the_colour_of_their_reason():
    mesh = junction(8).with_boundaries({"$rim$": lambda x: x[0] < 2.0})
    drawing = plotting.plot_outlines(mesh, pinned=[40])
    why = np.char.replace(ka.why_held(mesh, rules=ka.Rules(pinned=[40])), ", 90 degrees", "")
    squares = [each for each in drawing.collections if isinstance(each, PathCollection) and len(each.get_offsets())]
    drawn = {tuple(x): to_hex(each.get_edgecolors()[0]) for each in squares for x in each.get_offsets().tolist()}
    held = np.flatnonzero(why)
    assert sorted(drawn) == sorted(map(tuple, mesh.p[:, held].T.tolist()))
    colours = {reason: {drawn[tuple(mesh.p[:, v].tolist())] for v in held if why[v] == reason} for reason in why[held]}
    assert all(len(each) == 1 for each in colours.values()) and len(set.union(*colours.values())) == len(colours)
    legend = [" ".join(text.split()).replace("\\$", "$") for text in legend_of(drawing)]
    assert {f"{np.sum(why == reason)}: {reason}" for reason in colours} <= set(legend)
    assert "1: pinned by number" in legend
    assert legend_of(plotting.plot_outlines(named(8)))[-1].endswith("further reasons")


@pytest.mark.parametrize("build", [lambda: junction(8), lambda: named(8), lambda: inset(8)])
def test_chains_that_meet_differ_in_colour(build):
    chains = chains_drawn(plotting.plot_outlines(build()))
    at = {}
    for points, colour in chains:
        for end in (points[0], points[-1]):
            at.setdefault(tuple(end.tolist()), []).append(colour)
    assert max(map(len, at.values())) >= 2
    assert all(len(set(colours)) == len(colours) for colours in at.values())


def test_recognised_circles_are_drawn_round_and_dashed_with_their_radii():
    mesh = ring(24, 3)
    drawing = plotting.plot_outlines(mesh, unit="mm")
    assert legend_of(drawing)[0] == "2 chains recognised as arc or circle,\nradius 500, 1000 mm"
    assert sorted(text.get_text() for text in drawing.texts) == ["inner, r = 500 mm", "outer, r = 1000 mm"]
    chains = chains_drawn(drawing)
    assert len(chains) == 2
    assert drawing.collections[1].get_linestyles()[0][1] is not None  # dashed
    assert np.ptp(np.array(drawing.collections[0].get_segments())) == pytest.approx(2000.0)
    for points, _ in chains:
        radius = np.hypot(*points.T)
        assert_allclose(radius, round(radius[0]), rtol=1e-12)
        gap = np.hypot(*np.diff(points, axis=0).T).max() / radius[0]
        assert gap < np.deg2rad(2.1) and np.all(points[0] == pytest.approx(points[-1]))


def test_chains_on_given_curves_are_dotted_and_named():
    mesh = square(8).with_boundaries({"floor": lambda x: x[1] == 0.0, "top": lambda x: x[1] == 1.0})
    drawing = plotting.plot_outlines(mesh, curves={"floor": Line((0.0, 0.0), (1.0, 0.0))}, unit="")
    assert legend_of(drawing)[:2] == ["3 chains straight", "1 chain on a given curve"]
    assert sorted(text.get_text() for text in drawing.texts) == ["floor", "top"]
    drawing = plotting.plot_outlines(ring(24, 2), curves={"outer": Arc((0.0, 0.0), 1.0)}, unit="")
    assert legend_of(drawing)[:2] == [
        "1 chain recognised as arc or circle,\nradius 0.5",
        "1 chain on a given curve",
    ]


def test_periodic_chains_are_dash_dotted():
    mesh = square(8).with_boundaries({"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0})
    drawing = plotting.plot_outlines(mesh, periodic=[("left", "right")])
    assert legend_of(drawing)[:2] == ["2 chains straight", "2 chains periodic, matched with another"]


def test_a_name_is_no_formula(tmp_path):
    mesh = square(8).with_boundaries({r"$\frac$": lambda x: x[1] == 0.0})
    drawing = plotting.plot_outlines(mesh)
    drawing.figure.savefig(tmp_path / "outlines.png", dpi=30)
    assert [text.get_text() for text in drawing.texts] == [r"$\frac$"]


def test_outlines_are_drawn_where_one_wishes_and_the_mesh_stays_as_it_is():
    mesh, drawing = named(8), axes()
    before = mesh.p.tobytes(), mesh.t.tobytes()
    assert plotting.plot_outlines(mesh, ax=drawing) is drawing
    assert (mesh.p.tobytes(), mesh.t.tobytes()) == before
    with pytest.raises(ValueError, match="pinned name 'roof' is not in the mesh"):
        plotting.plot_outlines(mesh, pinned="roof")
    with pytest.raises(ValueError, match="curves has 'roof', which is no boundary of the mesh"):
        plotting.plot_outlines(mesh, curves={"roof": Line((0, 0), (1, 0))})


def test_a_magnetisation_curve():
    table = Table([(0.9, 120.0), (1.5, 1000.0), (1.9, 17e3), (2.25, 17e4)])
    drawn = plotting.plot_bh(table)
    curve, points = drawn.lines
    assert_allclose(curve.get_xdata(), table.field_strength(curve.get_ydata()))
    assert_allclose(points.get_xydata(), np.array(table.points)[1:, ::-1])
    assert curve.get_ydata().max() > 2.25 and drawn.get_xscale() == "log"
    assert (drawn.get_xlabel(), drawn.get_ylabel()) == ("field strength H (A/m)", "flux density B (T)")
    given = axes()
    assert plotting.plot_bh(Arctan(1000.0, 2.0), given) is given and len(given.lines) == 1


def test_a_density_is_drawn_per_square_of_the_unit_on_a_logarithmic_scale():
    mesh = two_regions()
    density = np.linspace(1e6, 1e8, 128)
    drawn = plotting.plot_density(mesh, density, unit="mm")
    shades, bar = drawn.collections[0], drawn.figure.axes[-1]
    assert_allclose(shades.get_array(), density / 1e6)
    assert isinstance(shades.norm, LogNorm) and (shades.norm.vmin, shades.norm.vmax) == (1.0, 100.0)
    assert bar.get_ylabel() == "nodes asked for per mm²" and drawn.get_xlabel() == "x (mm)"
    given = axes()
    assert plotting.plot_density(mesh, density, ax=given, unit="") is given
    assert given.figure.axes[-1].get_ylabel() == "nodes asked for per unit of area"


@pytest.mark.parametrize(("density", "ends"), [(np.ones(128), (0.0, 1.0)), (np.zeros(128), (0.0, 1.0))])
def test_a_density_with_nothing_to_scale_can_be_drawn(density, ends, tmp_path):
    drawn = plotting.plot_density(two_regions(), density)
    drawn.figure.savefig(tmp_path / "density.png", dpi=30)
    assert (drawn.collections[0].norm.vmin, drawn.collections[0].norm.vmax) == ends


def test_histograms_of_quality_hold_all_elements():
    coarse, fine = two_regions(2), two_regions(3)
    drawn = plotting.plot_qualities({"before": coarse, "after": fine})
    steps = [patch for patch in drawn.patches if patch.get_label()]
    assert [patch.get_label() for patch in steps] == ["before: worst 0.87, mean 0.87", "after: worst 0.87, mean 0.87"]
    for patch in steps:
        assert patch.get_data().values.sum() == pytest.approx(100.0)
        assert np.flatnonzero(patch.get_data().values).tolist() == [int(np.sqrt(0.75) * 40)]
    assert (drawn.get_xlim(), drawn.get_ylabel()) == ((0.0, 1.0), "share of the elements (%)")
    with pytest.raises(ValueError, match="meshes must be one to 3; got 0"):
        plotting.plot_qualities({})


def test_the_estimate_over_nodes_and_its_slopes():
    """At equal nodes half the error stands for four times as many nodes on a line of slope -1/2."""
    mesh = two_regions()
    drawn = plotting.plot_convergence({"adapted": [a_pass(0, mesh, 1.0), a_pass(1, mesh, 0.5)]})
    points, first, best, _, mark = drawn.lines
    assert_allclose(points.get_xydata(), [[81, 50.0], [81, 25.0]])
    for line, error in ((first, 50.0), (best, 25.0)):
        x, y = np.log(line.get_data())
        assert (y[1] - y[0]) / (x[1] - x[0]) == pytest.approx(-0.5)
        assert np.interp(np.log(81), x, y) == pytest.approx(np.log(error))
    assert_allclose(mark.get_xydata(), [[4 * 81, 25.0]])
    assert drawn.get_xlim()[0] < 81 and drawn.get_xlim()[1] > 4 * 81
    assert (drawn.get_xscale(), drawn.get_yscale()) == ("log", "log")
    assert drawn.get_ylabel() == "energy-norm error (%)"


def test_more_histories_than_one_share_their_axes():
    histories = {
        "one": [replace(a_pass(0, two_regions(2), 1.0), energy_norm=None)],
        "other": [a_pass(0, two_regions(4), 0.1)],
    }
    drawn = plotting.plot_convergence(histories, slope=-1.0)
    assert legend_of(drawn) == ["one", "other", "$N^{-1}$ through the first pass"]
    assert drawn.get_ylabel() == "energy-norm error"
    assert drawn.get_xlim()[0] < 25 and drawn.get_xlim()[1] > 289


@pytest.mark.parametrize("histories", [{}, {"none": []}, {word: [1] for word in "abcdefg"}])
def test_histories_that_cannot_be_drawn(histories):
    with pytest.raises(ValueError, match=f"histories must be one to 6, each with a pass; got {len(histories)}"):
        plotting.plot_convergence(histories)


def test_an_estimate_of_zero_has_no_slope(tmp_path):
    drawn = plotting.plot_convergence({"exact": [a_pass(0, two_regions(), 0.0)]})
    drawn.figure.savefig(tmp_path / "estimate.png", dpi=30)
    assert len(drawn.lines) == 1


def test_the_scale_shows_the_top_decade_of_every_array():
    scale = plotting.indicator_scale([0.1, 1.0], [2e-4, 1e-5])
    assert (scale.vmin, scale.vmax) == (pytest.approx(2e-5), 1.0)
    assert plotting.indicator_scale([1.0], [1e-12]).vmin == pytest.approx(1e-6)
