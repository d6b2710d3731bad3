"""Nonlinear material: refinement never raises the functional, which is integrated well enough to say so."""

from pathlib import Path

import pytest
from helpers.examples import examples
from helpers.random_steel import by_degree, fall_of, random_steel
from hypothesis import given
from hypothesis import strategies as st

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material
from kohonen_adapt.problem.functional_value import functional_value

EXAMPLES = Path(__file__).parents[2] / "examples"
EXACT = -139.436893  # of the saturated C-core, by orders 6 and 7


@pytest.mark.slow
@examples(40, deadline=None)
@given(st.integers(0, 10**6))
def test_refinement_never_raises_the_functional_and_quadrature_is_a_hundredth_of_its_fall(seed):
    steel = random_steel(seed)
    found, ritz = fall_of(steel.problem, steel.mesh), steel.problem.ritz(steel.mesh, steel.problem.solve(steel.mesh))
    assert not found.rises, steel.kind
    assert found.misjudged < 0.01, steel.kind
    assert functional_value(steel.mesh, ritz) == pytest.approx(found.used, abs=1e-5 * (found.used - found.refined))


def saturated_core(order):
    parts = {"iron": Material(bh=Froehlich(2000.0, 0.8)), "magnet": Material(1.05, remanence=(0.0, 1.2))}
    return Magnetostatics(parts | {"air": Material()}, {"outer": 0.0}, order=order)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 3])
def test_the_polish_of_a_saturated_core_does_not_go_where_the_quadrature_flatters(order):
    problem = saturated_core(order)
    result = ka.adapt(ka.read_mesh(EXAMPLES / "c_core.msh", scale=1e-3), problem, passes=2)
    for one in result.history[1:]:
        told, fine = one.functional, by_degree(one.mesh, problem.ritz(one.mesh, problem.solve(one.mesh)))
        assert told > EXACT
        assert abs(told - fine) < 0.02 * (told - EXACT)
