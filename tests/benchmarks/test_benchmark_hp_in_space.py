"""Parts of the benchmark `hp --three-d` on tiny settings."""

import numpy as np
import pytest

from benchmarks.peers import hp_in_space
from benchmarks.problems.solids import EDGE
from benchmarks.problems.solids_by_order import ByOrder


def test_estimates_are_errors():
    rows = list(hp_in_space._told_rows(EDGE, (1,)))
    assert [row[:3] for row in rows] == [["E", rows[0][1], 1]]
    assert all(0.8 < float(ratio) < 1.25 for ratio in rows[0][3:6])


def test_a_tolerance_is_met():
    run = hp_in_space.run_to(EDGE, 1.0)
    assert run.settings.startswith("p 4") and 0.0 < run.error < 1.25


def test_ngsolve_refines_at_the_same_edges():
    pytest.importorskip("ngsolve")
    start, end = hp_in_space.singular_lines(EDGE)[0]
    assert np.all(start[:2] == 0.0) and np.all(end[:2] == 0.0)
    errors = [hp_in_space.hp(EDGE, 2.0, levels, 0.12, 4).error for levels in (1, 2)]
    assert errors[1] < errors[0] < 10.0
    assert ByOrder(EDGE).orders == (1, 6)
