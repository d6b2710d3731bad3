"""The kernels of order 1 and those of any order make the same moves and flips of affine functions."""

import numpy as np
import pytest
from skfem import MeshTri

from kohonen_adapt import Ritz, Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import WITH, WITHOUT
from kohonen_adapt.polishing.elements import without_modes
from kohonen_adapt.polishing.functional import Functional


def opened(seed):
    rng = np.random.default_rng(seed)
    mesh = MeshTri().refined(4)
    inner = mesh.interior_nodes()
    points = mesh.p.copy()
    points[:, inner] += 0.01 * rng.normal(size=(2, len(inner)))
    mesh = MeshTri(points, mesh.t)
    values, fixed = rng.normal(size=mesh.nvertices), np.zeros(mesh.nvertices, dtype=bool)
    fixed[mesh.boundary_nodes()] = True
    values[fixed] = (3.0 * mesh.p[0] - mesh.p[1])[fixed]  # nodes slide along the sides, and their values with them
    movable = MovableMesh.of(mesh, Rules().guarded())
    return movable, Functional.of(Ritz(values, fixed, 2.0, 0.7, (0.3, -0.4)), movable, mesh)


def swept(higher, seed):
    movable, functional = opened(seed)
    trial = functional.solution.copy()
    if higher:
        trial = trial._replace(modes=without_modes(len(movable.triangulation.elements.node)))
    loops, gains = functional.loops(movable, trial, movable.kernel_mesh()), []
    assert loops.higher == higher
    nodes, count = np.arange(movable.nnodes, dtype=np.int32), len(movable.triangulation.elements.node)
    for _ in range(3):
        gains.append(loops.descend_nodes(0, nodes))
        gainful = np.ones(count, dtype=np.bool_)
        gains += loops.descend_flips(0, 0, count, gainful, False)
        movable.triangulation.refill_star()
    return gains, movable.triangulation.position, trial.values, movable.triangulation.elements.node


@pytest.mark.parametrize("seed", range(3))
def test_both_paths_descend_alike(seed):
    (gains, *arrays, nodes), (other_gains, *other_arrays, other_nodes) = swept(WITHOUT, seed), swept(WITH, seed)
    assert gains[0] > 0.0 and gains[2] > 0
    np.testing.assert_allclose(gains, other_gains, rtol=1e-9)
    for found, other in zip(arrays, other_arrays, strict=True):
        np.testing.assert_allclose(found, other, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(np.sort(nodes, axis=1), np.sort(other_nodes, axis=1))
