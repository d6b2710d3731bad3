"""Quality of triangles and tetrahedra."""

import numpy as np
import pytest
from helpers.meshes import generic_square, perturbed
from helpers.tetrahedra import REGULAR, generic_cube, lone, thrown

import kohonen_adapt as ka

MESHES = {
    "triangles": perturbed(generic_square(7), 1),
    "tetrahedra": thrown(generic_cube(4), 1),
    **{f"height {height:g}": lone(REGULAR * [[1.0], [1.0], [height]]) for height in (1e-3, 1e-9, 0.0)},
}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_quality_is_the_formula_and_0_of_a_flat_element_only(mesh):
    corners, dim = mesh.p[:, mesh.t], len(mesh.p)
    squares = sum(np.sum((corners[:, i] - corners[:, j]) ** 2, axis=0) for i in range(dim + 1) for j in range(i))
    twice = np.abs(np.linalg.det((corners[:, 1:] - corners[:, :1]).T))  # the area, or three times the volume
    wanted = (2.0 * np.sqrt(3.0) * twice if dim == 2 else 12.0 * (0.5 * twice) ** (2 / 3)) / squares
    assert ka.quality(mesh) == pytest.approx(wanted, rel=1e-6, abs=1e-15)
    assert np.array_equal(ka.quality(mesh) == 0.0, np.ptp(corners[-1], axis=0) == 0.0)
    assert ka.quality(mesh).max() <= 1.0
