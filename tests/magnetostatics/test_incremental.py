"""Incremental inductance: that of linear material, and the slope of the linkage of any."""

from dataclasses import replace

import pytest
from helpers.devices import CIRCUIT, TURNS, actuator, plunger

from kohonen_adapt.magnetostatics import FluxLinkage, apparent_inductance

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")


CASES = {
    "plane": (actuator, CIRCUIT),
    "order 2": (lambda: actuator(order=2), CIRCUIT),
    "around an axis": (plunger, {"coil": 100}),
}


def with_current(problem, circuit, current):
    return replace(problem, ampere_turns={name: turns * current for name, turns in circuit.items()})


@pytest.mark.parametrize("case", CASES)
def test_it_is_the_slope_of_the_linkage_over_the_current(case):
    make, circuit = CASES[case]
    mesh, problem = make()
    linkage, current = FluxLinkage(circuit), TURNS / abs(min(circuit.values()))

    def linked(amperes):
        return linkage(with_current(problem, circuit, amperes).solve(mesh))

    problem = with_current(problem, circuit, current)
    field, step = problem.solve(mesh), 1e-3 * current
    slope = (linked(current + step) - linked(current - step)) / (2.0 * step)
    incremental = problem.incremental_inductance(field, circuit)
    assert incremental == pytest.approx(slope, rel=1e-5)
    assert incremental < 0.98 * apparent_inductance(field, circuit)  # the steel saturates
