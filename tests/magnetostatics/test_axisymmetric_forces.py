"""Force and flux linkage around an axis: exact answers, agreement of the methods, and what has none."""

import numpy as np
import pytest
from helpers.devices import CIRCUIT, MM, actuator, coil, coil_mesh, rings_mesh
from scipy.special import ellipe, ellipkm1

from kohonen_adapt.magnetostatics import (
    Magnetostatics,
    Material,
    apparent_inductance,
    energy_inductance,
    lorentz_force,
    lorentz_torque,
)

pytestmark = pytest.mark.filterwarnings("ignore:.*removed in 1.2:DeprecationWarning")

MU0 = 4e-7 * np.pi


def mutual(a, b, d):
    """Mutual inductance of two coaxial loops (Maxwell)."""
    m = 4 * a * b / ((a + b) ** 2 + d**2)
    k = np.sqrt(m)
    return MU0 * np.sqrt(a * b) * ((2 / k - k) * ellipkm1(1 - m) - 2 / k * ellipe(m))


def test_two_coaxial_coils():
    """Attract with I1 I2 dM/dz; filaments in the middle stand for squares of 2 mm but for half a per cent."""
    mesh = rings_mesh({"low": (9, 11, -5, -3), "high": (7, 9, 3, 5)})
    turns = {"low": 1000.0, "high": 500.0}
    parts = dict.fromkeys(("low", "high", "air"), Material())
    problem = Magnetostatics(parts, potential={"far": 0.0}, ampere_turns=turns, axisymmetric=True)
    field = problem.solve(mesh)
    a, b, d, h = 10 * MM, 8 * MM, 8 * MM, 1e-6
    wanted = 5e5 * (mutual(a, b, d + h) - mutual(a, b, d - h)) / (2 * h)
    assert wanted < 0.0
    for force in (field.force, lambda body: lorentz_force(field, body)):
        assert force("high")[0] == force("low")[0] == 0.0
        assert force("high")[1] == pytest.approx(wanted, rel=0.01)
        assert force("low")[1] == pytest.approx(-wanted, rel=0.01)


@pytest.mark.parametrize(("order", "fineness", "bound"), [(1, 3, 0.003), (2, 1, 5e-5), (3, 1, 2e-5)])
def test_inductance_by_linkage_is_that_by_energy(order, fineness, bound):
    """2 W = int J A around the axis: an identity of the discrete solution; FEMM's coil has 22.945 mH."""
    field = coil(order=order).solve(coil_mesh(fineness, 3.0))
    assert apparent_inductance(field, {"coil": 1000}) == pytest.approx(
        energy_inductance(field, {"coil": 1000}), rel=1e-9
    )
    assert field.flux_linkage("coil", turns=1000) == pytest.approx(22.945e-3, rel=bound)


def test_depth_multiplies_what_is_per_metre():
    metre, deep = (problem.solve(mesh) for mesh, problem in (actuator(depth=None), actuator(depth=0.02)))
    for quantity in (
        lambda field: field.force("bar"),
        lambda field: field.torque("go", centre=(0.1, 0.2)),
        lambda field: lorentz_force(field, "go"),
        lambda field: lorentz_torque(field, "go", centre=(0.1, 0.2)),
        lambda field: field.flux_linkage("go", turns=7),
        lambda field: apparent_inductance(field, CIRCUIT),
        lambda field: energy_inductance(field, CIRCUIT),
        lambda field: field.energy,
        lambda field: field.coenergy,
    ):
        np.testing.assert_allclose(quantity(deep), 0.02 * np.asarray(quantity(metre)), rtol=1e-12)
