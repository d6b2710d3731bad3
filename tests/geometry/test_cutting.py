"""Runs of facets go straight on as far as one node after the other says, and parameters there are those of kernels."""

import numpy as np
from helpers.meshes import holed, l_shape
from hypothesis import given
from hypothesis import strategies as st

from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.cutting import TURN, bends, straight_end, turning_angles
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.triangle.arrays import OWN, SLIDING, STRAIGHT
from kohonen_adapt.kernels.triangle.chains import nearest_parameter

BENDS = (0.0, 0.0, 0.0, 0.5 * TURN, 2.0 * TURN, -0.3)


@given(turns=st.lists(st.sampled_from(BENDS), max_size=40), first=st.integers(0, 40))
def test_a_run_goes_straight_on_up_to_the_first_node_where_it_turns(turns, first):
    z = np.cumsum([0.0, *np.exp(1j * np.cumsum([0.0, *turns]))])
    last = len(z) - 1
    first %= last
    turning = (i for i in range(first + 1, last) if abs(turning_angles(z[i - 1 : i + 2])) > TURN)
    assert straight_end(bends(z), first) == next(turning, last)


def test_nodes_on_straight_chains_have_the_parameters_that_kernels_find():
    nearest = interpreted(nearest_parameter)
    for mesh in (l_shape(4), holed(3)):
        movable = MovableMesh.of(mesh, Rules())
        constraints, position = movable.constraints, movable.triangulation.position
        nodes = np.flatnonzero(constraints.kind == SLIDING)
        chain = constraints.chain[nodes, OWN]
        assert len(nodes) and (constraints.chains.shape[chain] == STRAIGHT).all()
        found = [nearest(constraints.chains, c, position[v], 0.0) for c, v in zip(chain, nodes, strict=True)]
        assert constraints.parameter[nodes].tolist() == found
