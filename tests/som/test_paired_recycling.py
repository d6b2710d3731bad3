"""Recycling of periodic pairs: nodes come and go on both sides at once, wherever the density wants them."""

import numpy as np
import pytest
from helpers.meshes import BOTH, cell
from helpers.paired import mismatch, nodes_of, sector, turned
from numpy.testing import assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import SLIDING
from kohonen_adapt.som.recycling import recycle_nodes

MOTIONS = {
    "cell": (
        lambda: cell(16),
        BOTH,
        [("left", "right", lambda x: x + [[1.0], [0.0]]), ("bottom", "top", lambda x: x + [[0.0], [1.0]])],
    ),
    "sector": (lambda: sector(12, np.pi / 3), [("first", "last")], [("first", "last", turned(np.pi / 3))]),
}


@pytest.mark.parametrize("world", MOTIONS)
@pytest.mark.parametrize("target", [1.0, 2.5])
def test_pairs_match_after_every_change(world, target):
    build, periodic, motions = MOTIONS[world]
    mesh = build()
    movable = MovableMesh.of(mesh, Rules("recycle", periodic=periodic))
    x = movable.triangulation.position
    density, nodes = 1.0 / (0.05 + np.hypot(*(x - x[0]).T)) ** 2, round(target * len(x))
    done = recycle_nodes(movable, density, nodes, True)
    now = movable.mesh()
    for one, other, motion in motions:
        assert mismatch(now, one, other, motion) < 1e-15
        assert len(nodes_of(now, one)) != len(nodes_of(mesh, one))
    assert now.p.shape[1] == nodes == len(x) + done.splits - done.collapses
    periodic, constraints = movable.constraints.periodic, movable.constraints
    v = np.flatnonzero((constraints.kind == SLIDING) & (periodic.partner >= 0))
    assert_array_equal(periodic.partner[periodic.partner[v]], v)
    assert_array_equal(periodic.motion[periodic.partner[v]], periodic.motion[v] ^ 1)
    assert_array_equal(constraints.parameter[periodic.partner[v]], constraints.parameter[v])
    assert ka.quality(now).min() >= 0.3
    old = done.old >= 0
    assert len(np.unique(done.old[old])) == old.sum()


def test_growth_without_recycling_takes_nothing_away():
    mesh = cell(6)
    for more in (1, 2, 40):
        movable = MovableMesh.of(mesh, Rules("flip", periodic=BOTH))
        done = recycle_nodes(movable, np.ones(movable.nnodes), movable.nnodes + more, False)
        assert (done.splits, done.collapses) == (more, 0)
        assert mismatch(movable.mesh(), *MOTIONS["cell"][2][0]) < 1e-15
