"""A mesh as arrays: tangled meshes are refused."""

import numpy as np
import pytest

from kohonen_adapt.mesh.adjacency import neighbours_of


@pytest.mark.parametrize(
    ("node", "fold"),
    [
        ([[0, 1, 2], [1, 3, 2], [0, 1, 2]], 0),  # doubled
        ([[4, 5, 6], [0, 1, 2], [1, 2, 3]], 1),  # overturned: both run along the edge from 1 to 2
        ([[0, 1, 2], [1, 0, 3], [1, 0, 4]], 0),  # three at one edge
    ],
)
def test_elements_on_one_another_are_refused(node, fold):
    with pytest.raises(ValueError, match=f"tangled: element {fold} shares an edge"):
        neighbours_of(np.array(node, dtype=np.int32), np.zeros((7, 2)))
