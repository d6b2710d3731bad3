"""Flux linkage and inductance: exact answers, identities, and what has none."""

import re

import numpy as np
import pytest
from helpers.meshes import area_of
from helpers.sheets import MU0
from helpers.tensor_meshes import disk, equal_rings

from kohonen_adapt.magnetostatics import (
    FluxLinkage,
    Magnetostatics,
    Material,
    apparent_inductance,
    circuit_current,
    energy_inductance,
)

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")

AIR = Material()


def wire(rings):
    """100 turns of 0.5 A in a round wire of 5 mm, A = 0 at 20 mm."""
    mesh = disk(equal_rings(rings, 0.02), {"wire": rings // 4, "air": rings})
    parts = {"wire": Material(current_density=50.0 / area_of(mesh, mesh.subdomains["wire"])), "air": AIR}
    return Magnetostatics(parts, potential={"outer": 0.0}, order=1).solve(mesh)


def test_linkage_of_a_round_wire():
    """Turns times mu0 I (ln(R / a) / (2 pi) + 1 / (8 pi)), of second order."""
    wanted = 100 * MU0 * 50.0 * (np.log(4.0) / (2 * np.pi) + 1 / (8 * np.pi))
    rings = (8, 16, 32)
    errors = [abs(wire(number).flux_linkage("wire", turns=100) / wanted - 1.0) for number in rings]
    assert errors[2] < 2e-3
    assert 1.8 < -np.polyfit(np.log(rings), np.log(errors), 1)[0] < 2.2


FIELD = wire(8)


@pytest.mark.parametrize("turns", [0, np.nan, np.inf, "100", None, True])
def test_turns(turns):
    with pytest.raises(ValueError, match=f"^turns of 'wire' must be a finite number other than 0; got {turns!r}\\.$"):
        FIELD.flux_linkage("wire", turns=turns)


@pytest.mark.parametrize(
    ("circuit", "message"),
    [
        ("wire", "circuit must map subdomains to turns, for instance {'coil': 100}; got 'wire'."),
        ({"coil": 1}, "subdomain 'coil' is not in the mesh; it has 'air', 'wire'."),
        ({"wire": 0}, "turns of 'wire' must be a finite number other than 0; got 0."),
        (
            {"wire": 100, "air": -100},
            "the sides of a circuit must carry one current; got 'wire' 0.5 A, 'air' -0 A. Check the signs: turns are "
            "negative for return sides.",
        ),
        (
            {"air": 1},
            "the sides of a circuit must carry one current; got 'air' 0 A. Check the signs: turns are negative for "
            "return sides.",
        ),
    ],
)
def test_circuits_that_are_none(circuit, message):
    for function in (circuit_current, apparent_inductance, energy_inductance):
        with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
            function(FIELD, circuit)


def test_a_coil_without_elements():
    mesh = FIELD.mesh.with_subdomains({"coil": np.array([], dtype=int)})
    problem = Magnetostatics({"wire": Material(current_density=1e6), "air": AIR}, {"outer": 0.0}, order=1)
    field, circuit = problem.solve(mesh), {"coil": 10}
    for linkage in (
        lambda: field.flux_linkage("coil", turns=10),
        lambda: apparent_inductance(field, circuit),
        lambda: problem.incremental_inductance(field, circuit),
        lambda: FluxLinkage(circuit).derivative(field),
    ):
        with pytest.raises(ValueError, match=r"^subdomain 'coil' has no elements; name one that has\.$"):
            linkage()
