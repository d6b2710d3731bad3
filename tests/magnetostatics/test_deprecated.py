"""Functions that will be removed in 1.2 warn, say what to use, and give the same numbers as what they name."""

import pytest
from helpers.devices import CIRCUIT, TURNS, actuator

from kohonen_adapt.magnetostatics import (
    apparent_inductance,
    arkkio_torque,
    circuit_current,
    energy_inductance,
    lorentz_torque,
)

CURRENT = TURNS / CIRCUIT["go"]


@pytest.fixture(scope="module")
def field():
    """Of two coil sides beside steel."""
    mesh, problem = actuator(depth=None, order=2)
    return problem.solve(mesh)


def linkage(field):
    return sum(field.flux_linkage(name, turns) for name, turns in CIRCUIT.items())


DEPRECATED = {  # what is to be used instead: what is deprecated, and its value
    "the current that you": (lambda field: circuit_current(field, CIRCUIT), lambda field: CURRENT),
    r"field\.flux_linkage\(coil, ": (
        lambda field: apparent_inductance(field, CIRCUIT),
        lambda field: linkage(field) / CURRENT,
    ),
    r"2 \* field\.energy / current": (
        lambda field: energy_inductance(field, CIRCUIT),
        lambda field: 2 * field.energy / CURRENT**2,
    ),
    r"field\.torque\(coil, centre\)\.$": (
        lambda field: lorentz_torque(field, "go", (0.0, 0.01)),
        lambda field: pytest.approx(field.torque("go", (0.0, 0.01)), rel=0.05),
    ),
}


@pytest.mark.parametrize("instead", DEPRECATED)
def test_what_is_deprecated_names_what_to_use_and_has_its_value(instead, field):
    old, new = DEPRECATED[instead]
    with pytest.warns(DeprecationWarning, match=rf"^\w+ is deprecated .* 1\.2; use {instead}"):
        found = old(field)
    wanted = new(field)
    assert found == (pytest.approx(wanted, rel=1e-12) if isinstance(wanted, float) else wanted)


def test_the_torque_over_a_ring_of_air_is_deprecated(field):
    with (
        pytest.warns(DeprecationWarning, match=r"^arkkio_torque is .* 1\.2; use field\.torque\(body, centre\) of "),
        pytest.raises(ValueError, match="must be bounded by two circles"),
    ):
        arkkio_torque(field, "air")
