"""Runs of facets go straight on as far as one node after the other says, and parameters there are those of kernels."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kohonen_adapt.geometry.plane.cutting import TURN, bends, straight_end, turning_angles

BENDS = (0.0, 0.0, 0.0, 0.5 * TURN, 2.0 * TURN, -0.3)


@given(turns=st.lists(st.sampled_from(BENDS), max_size=40), first=st.integers(0, 40))
def test_a_run_goes_straight_on_up_to_the_first_node_where_it_turns(turns, first):
    z = np.cumsum([0.0, *np.exp(1j * np.cumsum([0.0, *turns]))])
    last = len(z) - 1
    first %= last
    turning = (i for i in range(first + 1, last) if abs(turning_angles(z[i - 1 : i + 2])) > TURN)
    assert straight_end(bends(z), first) == next(turning, last)
