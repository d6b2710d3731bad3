"""The sweeps of the examples, one killed in the middle and resumed, and what their curves must be."""

import csv
import importlib
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from helpers.places import EXAMPLES
from helpers.processes import wait_until
from scipy.interpolate import CubicSpline

pytestmark = pytest.mark.slow

EVERY = {"motor": 3, "actuator": 5}  # of the 30 cases


def begin(name, folder):
    environment = {**os.environ, "PYTHONPATH": str(EXAMPLES.parent)}
    command = [sys.executable, str(EXAMPLES / f"{name}_sweep.py"), "--out", str(folder)]
    command += ["--every", str(EVERY[name])]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE)


def killed(name, folder):
    """The cases that were computed before the kill, by file."""
    cases = folder / f"{name}_cases"
    process = begin(name, folder)
    wait_until(lambda: len(list(cases.glob("case-*"))) >= 3, seconds=900)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=30)
    kept = {file: file.read_bytes() for file in cases.glob("case-*")}
    assert 3 <= len(kept) < 30 // EVERY[name] and not (folder / f"{name}_sweep.csv").exists()
    return kept


def table(name, folder):
    """The table as columns of floats by name."""
    process = begin(name, folder)
    process.communicate(timeout=1800)
    assert process.returncode == 0
    with (folder / f"{name}_sweep.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 30 // EVERY[name] and not any(row.pop("error") for row in rows)
    assert (folder / f"{name}_sweep.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def straight(name, number, monkeypatch):
    """What the function of an example gives for the case of that number, in this process."""
    monkeypatch.syspath_prepend(EXAMPLES)
    example = importlib.import_module(f"{name}_sweep")
    ((parameter, values),) = example.CASES.items()
    return example.adapted(**{parameter: values[:: EVERY[name]][number]})


@pytest.fixture(scope="module")
def motor(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motor")
    kept = killed("motor", folder)
    columns = table("motor", folder)
    assert all(file.read_bytes() == content for file, content in kept.items())
    return columns


@pytest.fixture(scope="module")
def actuator(tmp_path_factory):
    return table("actuator", tmp_path_factory.mktemp("actuator"))


@pytest.mark.parametrize("number", [0, -1])
def test_killed_and_resumed_it_is_the_table_without_a_break(number, motor, monkeypatch):
    """To the last bit: a case from before the kill, and one from after it."""
    for output, value in straight("motor", number, monkeypatch).items():
        assert motor[output][number] == value


def test_torque_repeats_after_a_slot_pitch(motor):
    """On other meshes, for each angle is adapted by itself."""
    torque, idle = motor["torque (N m/m)"], motor["torque without currents (N m/m)"]
    pitch = 24 // EVERY["motor"]
    np.testing.assert_allclose(torque[pitch:], torque[: 6 // EVERY["motor"]], rtol=2e-3)
    np.testing.assert_allclose(idle[pitch:], idle[: 6 // EVERY["motor"]], rtol=0, atol=0.01 * np.ptp(idle))
    np.testing.assert_allclose(
        idle[1:pitch], -idle[pitch - 1 : 0 : -1], rtol=0, atol=0.02 * np.ptp(idle)
    )  # mirrored slots
    assert torque[:pitch].mean() == pytest.approx(41.98, rel=2e-3)  # the electric power of examples/motor.py


def test_force_is_the_slope_of_the_co_energy(actuator):
    """F = dW'/dgap at constant current, though one is told by the field around the plunger, the other by all of it."""
    gap, force, coenergy = actuator["gap_mm"], actuator["force (N)"], actuator["co-energy (J)"]
    slope = CubicSpline(np.log(gap), coenergy)(np.log(gap), 1) / (gap * 1e-3)
    np.testing.assert_allclose(force[2:-2], slope[2:-2], rtol=0.02)
    assert np.all(force < 0) and np.all(np.diff(force) > 0)
