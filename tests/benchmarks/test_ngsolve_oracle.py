"""Energy and flux of the adapted C-core agree with NGSolve's P3 elements to the discretisation error."""

import sys

import pytest

from benchmarks.peers.ngsolve_field import VACUUM_PERMEABILITY
from benchmarks.peers.ngsolve_oracle import LINEAR, c_core, compared, report
from benchmarks.problems.c_core import PERMEABILITY, REFERENCE_ENERGY, REMANENCE

MAGNET_AREA = 0.015 * 0.020


@pytest.fixture(scope="module")
def rows():
    pytest.importorskip("ngsolve")
    return compared(c_core(LINEAR, "C-core"))


def test_the_oracle_has_the_reference_energy(rows):
    """Without currents ``int nu |B - Br|^2 = int nu Br^2 - int nu |B|^2``; P2 elements gave the reference."""
    of_remanence = REMANENCE**2 / PERMEABILITY["magnet"] * MAGNET_AREA
    wanted = 0.5 * (of_remanence - REFERENCE_ENERGY) / VACUUM_PERMEABILITY
    _, _, energy, *_ = rows[0]
    assert energy == pytest.approx(wanted, rel=2e-4)


def test_the_energy_is_off_by_half_the_square_of_the_error(rows):
    """The energy is minimal, so it is too large on every mesh; the estimate is near the error."""
    *_, difference, expected = rows[0]
    assert 0.8 * expected < difference < 1.3 * expected


def test_without_currents_the_co_energy_is_minus_the_energy(rows):
    (_, ours, theirs, *_), (_, our_co, their_co, *_) = rows[:2]
    assert our_co == pytest.approx(-ours, rel=1e-9)
    assert their_co == pytest.approx(-theirs, rel=1e-9)


def test_the_flux_in_the_gap_agrees(rows):
    *_, difference, expected = rows[2]
    assert abs(difference) < min(0.4 * expected, 1.0)


def test_the_report_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    assert "install the extra 'bench'" in report([0], quick=True)
