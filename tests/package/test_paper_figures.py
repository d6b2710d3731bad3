"""The numbers behind the figures of the paper, drawn small, say what the paper says, or where it falls short."""

import runpy

import numpy as np
import pytest
from helpers.places import EXAMPLES
from numpy.testing import assert_allclose

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("paper")


@pytest.fixture(scope="module")
def facts(folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLES)  # as for a script, which finds its neighbours
        return runpy.run_path(str(EXAMPLES / "paper_figures.py"))["main"](folder, quick=True)


def test_every_figure_is_written(facts, folder):
    assert sorted(file.stem for file in folder.iterdir()) == sorted(facts)
    assert {int(name.split("_")[1]) for name in facts} == set(range(1, 11))
    for file in folder.iterdir():
        content = file.read_bytes()
        assert content[:8] == b"\x89PNG\r\n\x1a\n" and len(content) > 20_000


def test_neighbourhoods_are_hexagons_of_the_grid(facts):
    assert facts["figure_1_neighbourhoods"]["members"] == [1, 7, 19]


def test_training_set_has_two_points_per_neuron_most_of_them_at_the_peak(facts):
    density = facts["figure_2_density"]
    assert density["points"] == 2 * density["neurons"]
    assert density["share_within_two_widths"] > 0.6


def test_corner_changes_hands_and_stays_occupied(facts):
    jump = facts["figure_3_corner_jump"]
    before, after = jump["nodes_on_sides"]
    assert jump["changed"] and jump["corner_distance"] < 1e-12 and jump["overturned"] == 0
    assert sorted(np.subtract(after, before)) == [-1, 0, 0, 1]


def test_circle_check_is_needed(facts):
    assert facts["figure_4_search"]["bettered"] > 0.01


def test_training_stops_at_its_criterion_with_a_mesh_like_the_density(facts):
    converged = facts["figure_5_converged"]
    assert converged["epochs"] < converged["most_epochs"]
    assert converged["error"] < 0.6
    assert converged["overturned"] == 0 and converged["min_quality"] > 0
    assert converged["correlation"] > 0.3
    start, end = converged["nodes_on_sides"]
    assert sum(start) == sum(end) and end[0] > start[0] and end[3] < start[3]  # towards the lower side


def test_error_falls_with_the_epochs_at_radius_1_and_hardly_with_those_at_radius_2(facts):
    study = facts["figure_6_epochs"]
    ratio = np.array(study["ratio"])
    assert ratio[0, 0] == 1
    assert np.all(np.diff(ratio, axis=1) < 0)
    assert study["by_radius_1"] > 0.1 > study["by_radius_2"] + 0.05


def test_more_training_points_fit_worse_and_serve_better(facts):
    points = facts["figure_6_epochs"]["points"]
    assert np.all(np.diff(points["own"]) > 0) and np.all(np.diff(points["held_out"]) < 0)
    rates = facts["figure_6_epochs"]["rates"]
    assert np.ptp(rates["held_out"]) < 0.1  # the learning rate hardly matters


def test_without_the_check_elements_overlap_to_the_end(facts):
    overlapping = facts["figure_7_overlapping"]
    assert overlapping["overturned"][-1] > 0 and overlapping["overlapping_area"] > 0


def test_l_shape_keeps_its_elements_and_a_delaunay_pass_betters_them(facts):
    l_shape = facts["figure_8_l_shape"]
    assert l_shape["overturned"] == 0
    assert_allclose(l_shape["area"], 3.0, rtol=1e-12)
    for quality in (l_shape["min_quality"], l_shape["mean_quality"]):
        _, fixed, delaunay = quality
        assert delaunay > fixed > 0


def test_two_regions_keep_their_areas_and_gather_at_the_peak(facts):
    regions = facts["figure_9_two_regions"]
    assert regions["overturned"] == 0
    before, after = regions["areas_of_inner"]
    assert after == pytest.approx(before, rel=1e-12)
    thin, dense = regions["mean_density_at_peak"]
    assert dense > 2 * thin


def test_search_takes_a_few_steps_at_any_number_of_neurons(facts):
    cost = facts["figure_10_cost"]
    assert cost["step_slopes"]["random"] > 0.3  # across the mesh: the root of the number of neurons
    assert cost["step_slopes"]["first"] < 0.15 and cost["step_slopes"]["later"] < 0.15
    assert max(cost["steps"]["first"]) < 3 and max(cost["steps"]["later"]) < 3
    assert all(cost[f"time_slope_{radius}"] < 1.6 for radius in (0, 1, 2))
