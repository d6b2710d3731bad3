"""Recycling of periodic pairs: nodes come and go on both sides at once, wherever the density wants them."""

import numpy as np
import pytest
from helpers.meshes import square
from numpy.testing import assert_array_equal
from scipy.spatial import KDTree
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.triangle.arrays import SLIDING
from kohonen_adapt.som.recycling import recycle_nodes

LINES = {"left": (0, 0), "right": (0, 1), "low": (1, 0), "top": (1, 1)}
SIDES = {name: lambda x, i=i, at=at: x[i] == at for name, (i, at) in LINES.items()}
BOTH = [("left", "right"), ("low", "top")]


def cell(n=16):
    mesh = square(n).with_boundaries(SIDES)
    return mesh.with_subdomains({"band": lambda x: np.abs(x[1] - 0.5) < 0.25})


def sector(n=12):
    """A sixth of a ring about (2, 1)."""
    unit = square(n)
    radius, turn = 0.4 + 0.6 * unit.p[0], unit.p[1] * np.pi / 3 + 0.3
    mesh = MeshTri(np.stack([2.0 + radius * np.cos(turn), 1.0 + radius * np.sin(turn)]), unit.t)
    sides = {name: unit.facets_satisfying(lambda x, y=y: x[1] == y) for name, y in (("first", 0), ("last", 1))}
    return mesh.with_boundaries(sides)


def turned(x):
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    return np.array([[c, -s], [s, c]]) @ (x - [[2.0], [1.0]]) + [[2.0], [1.0]]


MOTIONS = {
    "cell": (
        cell,
        BOTH,
        [("left", "right", lambda x: x + [[1.0], [0.0]]), ("low", "top", lambda x: x + [[0.0], [1.0]])],
    ),
    "sector": (sector, [("first", "last")], [("first", "last", turned)]),
}


def nodes_of(mesh, name):
    return np.unique(mesh.facets[:, np.asarray(mesh.boundaries[name])])


def mismatch(mesh, one, other, motion):
    """How far the moved nodes of one boundary are from those of the other; each is to have one of its own."""
    nodes, others = nodes_of(mesh, one), nodes_of(mesh, other)
    far, partner = KDTree(mesh.p[:, others].T).query(motion(mesh.p[:, nodes]).T)
    assert len(nodes) == len(others) == len(np.unique(partner))
    return far.max()


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
