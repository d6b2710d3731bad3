"""How many nodes every pass has: all in the end, never fewer than before, and by when."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.meshes import l_shape
from helpers.scalar_problems import Corner
from hypothesis import given
from hypothesis import strategies as st

import kohonen_adapt as ka
from kohonen_adapt.loop.growth import MAX_LAST_FACTOR, MIN_PLACING_NODES, Growth, GrowthByTolerance


class Plain:
    """Laplace on the L-shape without a functional."""

    def __init__(self):
        problem = Corner()
        self.solve, self.indicators = problem.solve, problem.indicators


class Varying(Corner):
    """The same with a functional whose coefficient is told for every other element on its own."""

    def ritz(self, mesh, solution):
        return replace(
            super().ritz(mesh, solution), coefficient=np.ones(2), flux=0.0, region=np.arange(mesh.nelements) % 2
        )


@given(st.integers(1, 10**6), st.integers(0, 10**7), st.integers(0, 12), st.booleans())
def test_growth_comes_to_its_target_and_never_goes_back(start, more, passes, corrected):
    growth = Growth.of(start, start + more, passes, corrected)
    nodes = [growth.nodes(number) for number in range(passes + 1)]
    assert nodes == sorted(nodes) and nodes[-1] == growth.target == start + more
    assert nodes[0] == start or not passes
    assert [growth.grows_after(number) for number in range(passes + 1)] == [count < growth.target for count in nodes]


@given(st.integers(1, 10**6), st.integers(0, 10**7), st.integers(2, 12))
def test_the_mesh_before_the_last_knows_enough_to_place_its_nodes(start, more, passes):
    every = Growth.of(start, start + more, passes, corrected=False)
    some = Growth.of(start, start + more, passes, corrected=True)
    assert every.nodes(passes - 1) == some.nodes(passes - 1, polished=False) == every.target
    assert some.nodes(passes - 1) >= min(some.target, max(MIN_PLACING_NODES, some.target / MAX_LAST_FACTOR))


@given(
    st.sampled_from([(1, 2), (2, 2), (3, 2), (1, 3), (2, 3)]),
    st.integers(2, 11),
    st.lists(st.floats(1e-6, 1.0), min_size=8, max_size=40),
    st.floats(1.001, 50.0),
    st.floats(0.3, 1.0),
)
def test_nodes_are_not_taken_away_above_the_tolerance(degree, number, indicators, excess, kept):
    # Few large indicators predict fewer nodes than the mesh has: so would passes take nodes away and add them in turns.
    (order, dim), count = degree, len(indicators)
    splits, estimate = round((1.0 - kept) * count), float(np.linalg.norm(indicators))
    last = SimpleNamespace(
        mesh=SimpleNamespace(nvertices=count),
        number=number,
        estimate=estimate,
        indicators=np.array(indicators),
        splits=splits,
        collapses=0,
    )
    growth = GrowthByTolerance(count, 10**6, lambda _: estimate / excess, order, dim, removes=True)
    assert growth.nodes(number + 1, True, last) >= count


def test_without_a_target_nodes_stay_as_many():
    growth = Growth.of(25, None, 4, corrected=True)
    assert [growth.nodes(number) for number in range(5)] == [25] * 5


@pytest.mark.parametrize(
    ("problem", "options", "before_last"),
    [
        (Corner(), {}, 500),
        (Corner(), {"topology": "flip"}, 500),
        (Corner(), {"polish": False}, 900),
        (Plain(), {}, 900),
        (Varying(), {}, 900),
        (Corner(2), {}, 900),
    ],
    ids=["polished", "flip", "not polished", "without a functional", "not to be polished", "of order 2"],
)
def test_what_a_polish_puts_right_may_come_last(problem, options, before_last):
    result = ka.adapt(l_shape(4), problem, passes=2, target_nodes=900, **options)
    assert [step.mesh.nvertices for step in result.history] == [65, before_last, 900]
    assert result.mesh.nvertices == 900


def test_a_pass_over_all_nodes_more_takes_off_a_hundredth():
    problem = Corner()
    grown = ka.adapt(l_shape(2), problem, passes=3, target_nodes=2000)
    more = ka.adapt(grown.mesh, problem, passes=1)
    least = ka.adapt(more.mesh, problem, passes=1)
    errors = [problem.error(result.mesh, result.solution) for result in (grown, more, least)]
    assert errors[0] < 1.015 * errors[-1]
