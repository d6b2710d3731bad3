"""Incremental inductance: that of linear material, and the slope of the linkage of any."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.devices import CIRCUIT, TURNS, actuator, machine, plunger

from kohonen_adapt.magnetostatics import FluxLinkage, Material, apparent_inductance, energy_inductance

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")


@pytest.mark.parametrize("order", [1, 2])
def test_of_linear_material_it_is_the_inductance(order):
    """By linkage, by energy and by the slope: identities of the discrete solution, of either order."""
    mesh, problem = actuator(order=order)
    problem = replace(problem, materials=problem.materials | {"bar": Material(500.0)})
    field = problem.solve(mesh)
    wanted = apparent_inductance(field, CIRCUIT)
    assert energy_inductance(field, CIRCUIT) == pytest.approx(wanted, rel=1e-9)
    assert problem.incremental_inductance(field, CIRCUIT) == pytest.approx(wanted, rel=1e-9)


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


def test_it_needs_no_current():
    """At rest it is the limit of the apparent one for a small current."""
    mesh, problem = actuator()
    rest, small = (with_current(problem, CIRCUIT, current) for current in (0.0, 1e-3))
    wanted = apparent_inductance(small.solve(mesh), CIRCUIT)
    assert rest.incremental_inductance(rest.solve(mesh), CIRCUIT) == pytest.approx(wanted, rel=1e-6)


def test_with_antiperiodic_sides_it_counts_the_pole():
    mesh, problem = machine()
    linkage, turns = FluxLinkage({"coil": 20}), {"coil": 20}
    size = problem.solve(mesh).volume[mesh.subdomains["coil"]].sum()

    def at(amperes):
        coil = Material(current_density=20 * amperes / size)
        return replace(problem, materials=problem.materials | {"coil": coil})

    values = [linkage(at(current).solve(mesh)) for current in (9995.0, 10005.0)]
    found = at(1e4).incremental_inductance(at(1e4).solve(mesh), turns)
    assert found == pytest.approx(np.diff(values)[0] / 10.0, rel=1e-4)
