"""When the last passes count as having gained nothing: by estimates, and of tetrahedra by the functional."""

from types import SimpleNamespace

import numpy as np
import pytest
from skfem import MeshTri

from kohonen_adapt.loop.state import STALL_GAIN, stalls_by_estimate, stalls_by_functional

MESH = MeshTri()


def passes(levels, worths, comparable=True):
    common = {"comparable": comparable, "calibrated": False, "mesh": MESH, "order": 1, "share": None}
    return tuple(
        SimpleNamespace(functional=level, worth=worth, estimate=worth, indicators=np.full(2, worth), **common)
        for level, worth in zip(levels, worths, strict=True)
    )


RISING = [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("last", "stalled"), [(-1.0, False), (-0.9 - 2 * STALL_GAIN, False), (-0.9 - 0.5 * STALL_GAIN, True), (-0.8, True)]
)
def test_estimates_have_no_say_where_the_functional_compares(last, stalled):
    """It fell by 0.9 until the last two passes."""
    history = passes([0.0, -0.9, -0.85, last], RISING)
    assert stalls_by_functional(history) is stalled
    assert stalls_by_estimate(history)


@pytest.mark.parametrize("level", [None, -1.0])
def test_where_it_does_not_compare_estimates_have(level):
    for worths in (RISING, RISING[::-1]):
        history = passes([level] * 4, worths, comparable=False)
        assert stalls_by_functional(history) is stalls_by_estimate(history) is (worths is RISING)


def test_two_passes_say_nothing():
    for count in (1, 2):
        assert not stalls_by_functional(passes([0.0] * count, [1.0] * count))
    assert stalls_by_functional(passes([0.0] * 3, [1.0] * 3))
