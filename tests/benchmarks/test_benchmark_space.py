"""The problems on tetrahedra have the errors that others measured, and relocation beats Mmg's."""

import pytest

from benchmarks.checks.space import compared
from benchmarks.problems.solids import BUMP, EDGE


@pytest.mark.parametrize(
    ("problem", "cells", "nodes", "uniform", "mmg"),
    [
        (BUMP, 10, 1331, 0.416, 0.2050),
        (EDGE, 6, 931, 0.1109, 0.0959),
    ],
)
def test_recycling_is_better_than_mmg_at_equal_nodes(problem, cells, nodes, uniform, mmg):
    row = compared(problem, cells)
    assert row[1] == nodes and row[2] == pytest.approx(uniform, rel=2e-3)
    assert row[4] < 0.95 * mmg
