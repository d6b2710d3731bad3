"""Results of a high order on layers at singular edges, in space."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.magnet_solids import blocks
from helpers.stand_ins import Without
from numpy.testing import assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Force, MagneticScalarPotential, Material

AXIS = np.linspace(-1.0, 1.0, 5)
PARTS = {"magnet": ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.0)), "iron": ((-0.5, -0.5, 0.5), (0.5, 0.5, 1.0))}
MATERIALS = {"magnet": Material(remanence=(0.0, 0.0, 1.2)), "iron": Material(500.0), "air": Material()}


@pytest.fixture(scope="module")
def problem():
    return MagneticScalarPotential(MATERIALS, {"outer": 0.0}, order=4)


@pytest.fixture(scope="module")
def adapted(problem):
    return ka.adapt(blocks([AXIS] * 3, PARTS), problem, rtol=0.03)


def test_the_result_has_the_order_and_layers(adapted):
    assert adapted.status is ka.Status.CONVERGED
    assert [each.order for each in adapted.history[:2]] == [2, 2]
    assert adapted.best.order == adapted.solution.order == 4 and not adapted.best.smooth
    assert "Solved with order 4 on 1 layer" in adapted.message
    assert adapted.mesh.nvertices > adapted.history[-2].mesh.nvertices


@pytest.mark.slow
def test_the_error_is_that_of_a_tenth_of_the_elements(problem, adapted):
    """The co-energy falls below that of order 2 on a mesh of the regular elements, eight times as many."""
    fine = blocks([np.linspace(-1.0, 1.0, 9)] * 3, PARTS)
    second = replace(problem, order=2)
    values = [each.functional_on(mesh)[0].value(solution.unknown)[0] for each, mesh, solution in (
        (second, fine, second.solve(fine)), (problem, adapted.mesh, adapted.solution)
    )]  # fmt: skip
    assert values[1] < values[0]
    assert adapted.estimate < 0.03 * adapted.best.energy_norm


@pytest.fixture(scope="module")
def better(problem, adapted):
    return replace(problem, order=6).solve(adapted.mesh)


@pytest.mark.slow
def test_the_estimate_is_the_error_beside_singular_edges(problem, adapted, better):
    values = [
        replace(problem, order=int(field.order)).functional_on(adapted.mesh)[0].value(field.unknown)[0]
        for field in (adapted.solution, better)
    ]
    assert 0.85 < adapted.estimate / np.sqrt(2.0 * (values[0] - values[1])) < 1.3  # some of the error is above order 6


@pytest.mark.slow
def test_the_error_of_a_force_is_told(problem, adapted, better):
    goal = Force("magnet", (0.0, 0.0, 1.0))
    error = goal(better) - goal(adapted.solution)
    assert 0.3 < replace(problem, goal=goal).goal_error(adapted.solution) / error < 1.5


@pytest.mark.slow
def test_the_default_order_follows_the_tolerance():
    default, start = MagneticScalarPotential(MATERIALS, {"outer": 0.0}), blocks([AXIS] * 3, PARTS)
    loose, tight = (ka.adapt(start, default, rtol=rtol) for rtol in (0.1, 0.01))
    assert loose.status is tight.status is ka.Status.CONVERGED
    assert loose.best.order == 2 and tight.best.order == 4
    assert tight.mesh.nvertices < 0.25 * 7969  # nodes that order 2 takes


@pytest.mark.slow
def test_a_goal_takes_no_order_with_more_unknowns_than_order_2():
    """Order 5 on two layers takes 103 591 unknowns to 2 %."""
    goal = Force("magnet", (0.0, 0.0, 1.0))
    default = MagneticScalarPotential(MATERIALS, {"outer": 0.0}, goal=goal)
    result = ka.adapt(blocks([AXIS] * 3, PARTS), default, goal_rtol=0.02)
    assert result.status is ka.Status.CONVERGED and result.best.order == 2
    assert result.best.unknowns < 25_000


def test_a_smooth_solution_takes_the_least_order_that_suffices():
    """Without layers orders gain more: order 4 has 0.2 % of error here, and passes for 0.1 % end early."""

    def wave(x):
        return np.sin(1.5 * x[0]) * np.sin(2.0 * x[1]) * np.exp(2.5 * x[2])

    mesh = blocks([np.linspace(-1.0, 1.0, 4)] * 3, {})
    problem = MagneticScalarPotential({"air": Material()}, {"outer": wave})
    results = [ka.adapt(mesh, problem, rtol=rtol) for rtol in (0.005, 0.001)]
    assert all(each.status is ka.Status.CONVERGED and each.history[0].smooth for each in results)
    assert [each.best.order for each in results] == [4, 5]
    assert results[1].mesh.nvertices < 250  # 459 if it might have singular edges
    unknown = ka.adapt(mesh, Without(problem, "singular_edges", "ritz"), rtol=0.005)
    assert unknown.best.order == 4 and not unknown.history[0].smooth


def test_edges_that_a_problem_does_not_name_are_those_of_its_functional():
    axis = np.linspace(-1.0, 1.0, 4)
    mesh = blocks([axis] * 3, {"magnet": ((axis[1],) * 3, (axis[2],) * 3)})
    problem = MagneticScalarPotential({name: MATERIALS[name] for name in ("magnet", "air")}, {"outer": 0.0}, order=4)
    named, found = (ka.adapt(mesh, each, passes=0) for each in (problem, Without(problem, "singular_edges")))
    assert found.solution.order == 4 and found.mesh.nvertices > mesh.nvertices
    assert_array_equal(found.mesh.p, named.mesh.p)
