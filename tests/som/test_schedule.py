"""Schedules: the paper's, the default one, and what a stage says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kohonen_adapt import Schedule, Stage


def test_the_papers_schedule():
    schedule = Schedule.paper()
    assert [(stage.radius, stage.epochs) for stage in schedule.stages] == [(2, 3), (1, 10), (0, 5)]
    assert {stage.neighbourhood for stage in schedule.stages} == {"flat"}
    assert {stage.points_per_neuron for stage in schedule.stages} == {2.0}
    assert schedule.fresh is False
    assert schedule.sweeps == 0
    assert schedule.tolerance is None


@pytest.mark.parametrize("epochs", [(3, 10, 5), (1, 1, 1), (0, 4, 0), (5, 0, 2), (1, 0, 0)])
def test_the_papers_rate_falls_geometrically_over_all_epochs_together(epochs):
    schedule = Schedule.paper(epochs, (0.5, 0.01))
    rates = np.concatenate([stage.rates() for stage in schedule.stages])
    assert_allclose(rates, np.geomspace(0.5, 0.01, sum(epochs)), rtol=1e-12)
    assert [stage.epochs for stage in schedule.stages] == [count for count in epochs if count]


def test_neighbourhoods():
    assert Stage(3, 1, 0.3, neighbourhood="flat").strength().tolist() == [1, 1, 1, 1]
    assert Stage(0, 1, 0.3).strength().tolist() == [1]
    ring = np.arange(5)
    assert_allclose(Stage(4, 1, 0.3).strength(), np.exp(-(ring**2) / (2 * (4 / 1.5) ** 2)), rtol=1e-14)


@pytest.mark.parametrize(("nnodes", "widest"), [(4, 2), (100, 4), (833, 16), (3201, 32), (12545, 64)])
def test_the_default_has_a_round_for_every_halving_of_the_widest_radius_down_to_4(nnodes, widest):
    assert widest <= 0.6 * np.sqrt(nnodes) < 2 * widest or widest == 2
    schedule = Schedule.default(nnodes)
    assert schedule.rounds == max(0, np.log2(widest) - 2)
    assert [stage.radius for stage in schedule.stages] == [2, 1]
    assert schedule.fresh
    assert schedule.sweeps > 0


def test_the_default_starts_where_it_is_told():
    rounds = [Schedule.default(12545, radius=radius).rounds for radius in (0, 1, 2, 4, 8, 16, 64)]
    assert rounds == [0, 0, 0, 0, 1, 2, 4]
    assert [stage.radius for stage in Schedule.default(12545, radius=2).stages] == [2, 1]
    assert [stage.radius for stage in Schedule.default(12545, radius=0).stages] == [1]
    assert [stage.radius for stage in Schedule.default(12545, radius=8, topology="fixed").stages] == [4, 2, 1]


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Stage(-1, 1, 0.3), r"radius of a stage must be an integer >= 0; got -1\."),
        (lambda: Stage(True, 1, 0.3), r"radius of a stage must be an integer >= 0; got True\."),
        (lambda: Stage(1, -2, 0.3), r"epochs of a stage must be an integer >= 0; got -2\."),
        (lambda: Stage(1, 1, 0.0), r"learning_rate must be in \(0, 1\], one or \(first, last\); got 0\.0\."),
        (lambda: Stage(1, 1, np.nan), r"learning_rate must be in \(0, 1\], .* got nan\."),
        (lambda: Stage(1, 1, (0.3, 0.2, 0.1)), r"learning_rate must be .* got \(0\.3, 0\.2, 0\.1\)\."),
        (lambda: Stage(1, 1, 0.3, points_per_neuron=0), r"points_per_neuron must be above zero; got 0\."),
        (lambda: Stage(1, 1, 0.3, neighbourhood="box"), r"neighbourhood must be 'gaussian' or 'flat'; got 'box'\."),
        (lambda: Schedule((), rounds=-1), r"rounds must be an integer >= 0; got -1\."),
        (lambda: Schedule((), sweeps=-1), r"sweeps must be an integer >= 0; got -1\."),
        (lambda: Schedule((), tolerance=np.nan), r"tolerance must be None or >= 0; got nan\."),
        (lambda: Schedule((), tolerance=-1e-3), r"tolerance must be None or >= 0; got -0\.001\."),
        (
            lambda: Schedule.paper((3, 10)),
            r"epochs must be three integers >= 0, for radius 2, 1 and 0; got \(3, 10\)\.",
        ),
        (lambda: Schedule.paper(learning_rate=(0.0, 0.3)), r"learning_rate must be \(first, last\), both in \(0, 1\]"),
        (lambda: Schedule.default(-5), r"nnodes must be an integer >= 0; got -5\."),
        (lambda: Schedule.default(100, radius=-3), r"radius must be an integer >= 0, or None; got -3\."),
        (
            lambda: Schedule.default(100, topology="move"),
            r"topology must be 'fixed', 'flip' or 'recycle'; got 'move'\.",
        ),
    ],
)
def test_values_out_of_range(build, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        build()


def test_stages_of_another_kind():
    with pytest.raises(ValueError, match=r"^stages of a schedule must be kohonen_adapt\.Stage; got 3\."):
        Schedule((3,))
    with pytest.raises(
        ValueError, match=r"^stages must be a sequence of kohonen_adapt\.Stage; got Stage\(.*Put it in a t"
    ):
        Schedule(Stage(1, 1, 0.3))
