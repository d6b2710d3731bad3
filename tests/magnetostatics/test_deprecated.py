"""Functions that will be removed in 1.2 warn, say what to use, and give the same numbers as what they name."""

import numpy as np
import pytest
from skfem import MeshTri

from kohonen_adapt.magnetostatics import (
    Magnetostatics,
    Material,
    apparent_inductance,
    arkkio_torque,
    circuit_current,
    energy_inductance,
    lorentz_torque,
)
from kohonen_adapt.mesh.measures import area

CIRCUIT = {"go": 10, "back": -10}


@pytest.fixture(scope="module")
def field():
    """Of 10 turns there and back, with A = 0 around."""
    ticks = np.linspace(-1.0, 1.0, 17)
    mesh = MeshTri.init_tensor(ticks, ticks)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    go, back = ((np.hypot(x - at, y) < 0.3) for at in (-0.4, 0.4))
    parts = {"go": np.flatnonzero(go), "back": np.flatnonzero(back), "air": np.flatnonzero(~go & ~back)}
    mesh = mesh.with_subdomains(parts).with_defaults()
    rim = dict.fromkeys(("left", "right", "bottom", "top"), 0.0)
    turns = {name: 3.0 * count for name, count in CIRCUIT.items()}
    return Magnetostatics(dict.fromkeys(parts, Material()), rim, ampere_turns=turns, order=2).solve(mesh)


def test_a_current_is_what_the_problem_was_given(field):
    with pytest.warns(DeprecationWarning, match=r"^circuit_current is deprecated .* in 1\.2; use the current that you"):
        found = circuit_current(field, CIRCUIT)
    assert found == pytest.approx(3.0, rel=1e-12)
    side = field.mesh.subdomains["go"]
    assert found == pytest.approx(np.sum((area(field.mesh) * field.current_density)[side]) / 10, rel=1e-12)


def test_an_inductance_is_linkage_or_energy_by_current(field):
    linkage = sum(field.flux_linkage(name, turns) for name, turns in CIRCUIT.items())
    with pytest.warns(DeprecationWarning, match=r"^apparent_inductance is .* 1\.2; use field\.flux_linkage\(coil, "):
        assert apparent_inductance(field, CIRCUIT) == pytest.approx(linkage / 3.0, rel=1e-12)
    with pytest.warns(DeprecationWarning, match=r"^energy_inductance is .* in 1\.2; use 2 \* field\.energy / current"):
        assert energy_inductance(field, CIRCUIT) == pytest.approx(2 * field.energy / 3.0**2, rel=1e-12)


def test_a_torque_is_that_of_the_field(field):
    with pytest.warns(DeprecationWarning, match=r"^lorentz_torque is .* 1\.2; use field\.torque\(coil, centre\)\.$"):
        found = lorentz_torque(field, "go", (0.0, 0.5))
    assert found == pytest.approx(field.torque("go", (0.0, 0.5)), rel=0.05)
    with (
        pytest.warns(DeprecationWarning, match=r"^arkkio_torque is .* 1\.2; use field\.torque\(body, centre\) of "),
        pytest.raises(ValueError, match="must be bounded by two circles"),
    ):
        arkkio_torque(field, "air")
