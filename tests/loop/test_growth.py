"""How many nodes every pass has: all in the end, never fewer than before, and by when."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.meshes import l_shape
from helpers.scalar_problems import Corner
from helpers.stand_ins import Without
from hypothesis import given
from hypothesis import strategies as st

import kohonen_adapt as ka
from kohonen_adapt.loop.growth import (
    MAX_LAST_FACTOR,
    MIN_PLACING_NODES,
    Growth,
    GrowthByTolerance,
)


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


def nodes_after(indicators, number, excess, *degree):
    """Wanted after a pass of this number whose estimate is `excess` of the tolerance."""
    mesh, estimate = SimpleNamespace(nvertices=len(indicators)), float(np.linalg.norm(indicators))
    told = {"estimate": estimate, "indicators": np.array(indicators), "splits": 0, "collapses": 0}
    growth = GrowthByTolerance(len(indicators), 10**6, lambda _: estimate / excess, *degree, True)
    return growth.nodes(number + 1, True, SimpleNamespace(mesh=mesh, number=number, **told))


@pytest.mark.parametrize("degree", [(1, 2), (3, 2), (2, 3)])
def test_predictions_that_fail_again_count_less(degree):
    # few large indicators ask for fewer nodes than there are, in every pass
    indicators = [1.0, *[1e-4] * 999]
    nodes = [nodes_after(indicators, number, 1.5, *degree) for number in range(2, 8)]
    assert nodes == [round(1000 * 1.1**power) for power in range(1, 7)]


@pytest.mark.parametrize(
    ("problem", "options", "before_last"),
    [
        (Corner(), {}, 500),
        (Corner(), {"topology": "flip"}, 500),
        (Corner(), {"polish": False}, 900),
        (Without(Corner(), "ritz"), {}, 900),
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
