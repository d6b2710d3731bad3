"""The sweeps of the examples, and what their curves must be."""

import csv

import numpy as np
import pytest
from helpers.places import EXAMPLES
from helpers.processes import python
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

pytestmark = pytest.mark.slow

EVERY = {"motor": 3, "actuator": 5}  # of the 30 cases


def table(name, folder):
    """The table as columns of floats by name."""
    python(EXAMPLES / f"{name}_sweep.py", "--out", folder, "--every", EVERY[name])
    with (folder / f"{name}_sweep.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 30 // EVERY[name] and not any(row.pop("error") for row in rows)
    assert (folder / f"{name}_sweep.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def test_torque_repeats_after_a_slot_pitch(tmp_path):
    """On other meshes, for each angle is adapted by itself."""
    motor = table("motor", tmp_path)
    torque, idle = motor["torque (N m/m)"], motor["torque without currents (N m/m)"]
    pitch = 24 // EVERY["motor"]
    assert_allclose(torque[pitch:], torque[: 6 // EVERY["motor"]], rtol=2e-3)
    assert_allclose(idle[pitch:], idle[: 6 // EVERY["motor"]], rtol=0, atol=0.01 * np.ptp(idle))
    assert_allclose(idle[1:pitch], -idle[pitch - 1 : 0 : -1], rtol=0, atol=0.02 * np.ptp(idle))  # mirrored slots
    assert torque[:pitch].mean() == pytest.approx(41.98, rel=2e-3)  # the electric power of examples/motor.py


def test_force_is_the_slope_of_the_co_energy(tmp_path):
    """F = dW'/dgap at constant current, though one is told by the field around the plunger, the other by all of it."""
    actuator = table("actuator", tmp_path)
    gap, force, coenergy = actuator["gap_mm"], actuator["force (N)"], actuator["co-energy (J)"]
    slope = CubicSpline(np.log(gap), coenergy)(np.log(gap), 1) / (gap * 1e-3)
    assert_allclose(force[2:-2], slope[2:-2], rtol=0.02)
    assert np.all(force < 0) and np.all(np.diff(force) > 0)
