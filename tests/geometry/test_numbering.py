"""Numbers along a curve for a while: neighbours are near in memory then, and nothing is another mesh afterwards."""

import numpy as np
import pytest
from helpers.meshes import square
from skfem import MeshTri

from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.plane.surgery import numbered_along_curve

SIDES = {"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0}
HALVES = {"low": lambda x: x[1] < 0.5, "high": lambda x: x[1] > 0.5}
PAIR = {"periodic": [("left", "right")]}


def scattered(mesh, seed=0):
    """The mesh with its nodes and elements in any order, in two halves, and with two sides that have names."""
    rng = np.random.default_rng(seed)
    nodes = rng.permutation(mesh.p.shape[1])
    t = np.argsort(nodes)[mesh.t][:, rng.permutation(mesh.t.shape[1])]
    return MeshTri(mesh.p[:, nodes], t).with_subdomains(HALVES).with_boundaries(SIDES), nodes


@pytest.fixture(scope="module")
def mesh():
    return scattered(square(104))[0]


def everything(movable):
    """All arrays that change when nodes move, by name, with those of stars."""
    return {**movable.state(), **movable.triangulation.star._asdict()}


def test_neighbours_have_near_numbers_for_a_while_and_their_own_afterwards(mesh):
    movable = MovableMesh.of(mesh, Rules(pinned="left", **PAIR))
    before, middle = movable.copy(), movable.triangulation.centroids()
    partners = pairs_of(movable)
    assert len(partners) == 210
    with numbered_along_curve(movable) as row:
        tri = movable.triangulation
        node = tri.elements.node
        assert np.median(np.abs(node[:, 0] - node[:, 1])) < 10
        assert np.array_equal(np.sort(row), np.arange(len(node)))
        assert np.array_equal(tri.centroids(), middle[row])
        assert np.array_equal(tri.elements.region, before.triangulation.elements.region[row])
        assert pairs_of(movable) == partners
        for k in range(3):  # a neighbour lies beyond the edge opposite to corner k
            beyond = tri.elements.neighbour[:, k]
            edge, other = np.delete(node, k, axis=1)[beyond >= 0], node[beyond[beyond >= 0]]
            assert np.all((edge[:, :, None] == other[:, None, :]).any(axis=2))
    after, expected = everything(movable), everything(before)
    assert all(np.array_equal(after[name], expected[name]) for name in expected)


def pairs_of(movable):
    """Where the nodes of pairs are."""
    place, partner = movable.triangulation.position, movable.constraints.periodic.partner
    paired = partner >= 0
    return {(*one, *other) for one, other in zip(place[paired].tolist(), place[partner[paired]].tolist(), strict=True)}
