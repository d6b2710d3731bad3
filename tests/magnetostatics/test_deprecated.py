"""Functions that will be removed in 1.2 warn, say what to use, and give the same numbers as what they name."""

import numpy as np
import pytest
from helpers.devices import CIRCUIT, TURNS, actuator

from kohonen_adapt.magnetostatics import (
    apparent_inductance,
    arkkio_torque,
    circuit_current,
    energy_inductance,
    lorentz_torque,
)
from kohonen_adapt.mesh.measures import area

CURRENT = TURNS / CIRCUIT["go"]


@pytest.fixture(scope="module")
def field():
    """Of two coil sides beside steel."""
    mesh, problem = actuator(depth=None, order=2)
    return problem.solve(mesh)


def test_a_current_is_what_the_problem_was_given(field):
    with pytest.warns(DeprecationWarning, match=r"^circuit_current is deprecated .* in 1\.2; use the current that you"):
        found = circuit_current(field, CIRCUIT)
    assert found == pytest.approx(CURRENT, rel=1e-12)
    side = field.mesh.subdomains["go"]
    assert found == pytest.approx(np.sum((area(field.mesh) * field.current_density)[side]) / CIRCUIT["go"], rel=1e-12)


def test_an_inductance_is_linkage_or_energy_by_current(field):
    linkage = sum(field.flux_linkage(name, turns) for name, turns in CIRCUIT.items())
    with pytest.warns(DeprecationWarning, match=r"^apparent_inductance is .* 1\.2; use field\.flux_linkage\(coil, "):
        assert apparent_inductance(field, CIRCUIT) == pytest.approx(linkage / CURRENT, rel=1e-12)
    with pytest.warns(DeprecationWarning, match=r"^energy_inductance is .* in 1\.2; use 2 \* field\.energy / current"):
        assert energy_inductance(field, CIRCUIT) == pytest.approx(2 * field.energy / CURRENT**2, rel=1e-12)


def test_a_torque_is_that_of_the_field(field):
    with pytest.warns(DeprecationWarning, match=r"^lorentz_torque is .* 1\.2; use field\.torque\(coil, centre\)\.$"):
        found = lorentz_torque(field, "go", (0.0, 0.01))
    assert found == pytest.approx(field.torque("go", (0.0, 0.01)), rel=0.05)
    with (
        pytest.warns(DeprecationWarning, match=r"^arkkio_torque is .* 1\.2; use field\.torque\(body, centre\) of "),
        pytest.raises(ValueError, match="must be bounded by two circles"),
    ):
        arkkio_torque(field, "air")
