"""Parts of open meshes of tetrahedra: changed side by side, and in the end as one thread would leave the whole."""

import threading

import numpy as np
import pytest
from helpers.solids import box, cut, two_regions, volumes
from numba import config
from skfem import MeshTet

from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.geometry.space.open_solid import OpenSolid
from kohonen_adapt.geometry.space.thread_parts import STRIPS
from kohonen_adapt.kernels.tetrahedron.swap import enter_worse, swap_waiting
from kohonen_adapt.kernels.threads import by_turns, parts_for

CELLS = 14  # 3375 nodes: two parts


def shaken(mesh, seed=0):
    """The mesh with inner nodes moved, such that nearly every third element wants to be swapped."""
    p, rng = mesh.p.copy(), np.random.default_rng(seed)
    inner = ~np.isin(p, [0.0, 0.5, 1.0]).any(axis=0)
    p[:, inner] += rng.uniform(-0.25, 0.25, (3, inner.sum())) / CELLS
    return MeshTet(p, mesh.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)


def opened(build=box):
    mesh = shaken(build(CELLS))
    return OpenSolid.of(MovableSolid.of(mesh, Rules()), np.ones(mesh.nvertices))


@pytest.mark.parametrize("build", [box, two_regions, cut], ids=["box", "regions", "sheet"])
def test_in_the_end_no_swap_is_left_to_do_and_no_row_is_lost(build):
    """Not at the cuts either: all that was in the way of a swap there has had its turn."""
    solid = opened(build)
    mesh, queue = solid.mesh, solid.queue
    volume = volumes_of(solid)
    assert len(solid.parts().partitions) == 2
    assert solid.swap() > 1000
    assert not queue.waiting.any() and queue.state[1] == 0
    used, free = solid.elements(), mesh.pool.free_elements[: mesh.pool.height[1]]
    assert np.array_equal(np.sort(np.append(used, free)), np.arange(len(mesh.elements.node)))
    assert volumes_of(solid) == pytest.approx(volume, rel=1e-12)
    enter_worse(mesh, queue, 1.0)
    assert swap_waiting(mesh, queue, 1.0, 0.0, len(used)) == 0 and queue.state[1] == 0


def volumes_of(solid):
    node = solid.mesh.elements.node[solid.elements()]
    return np.abs(volumes(MeshTet(solid.mesh.position.T, node.T))).sum()


def test_few_nodes_are_one_part_and_many_are_more_of_no_less_than_a_thousand():
    assert parts_for(1999, 1, 3, STRIPS) == 1 and parts_for(3375, 1, 3, STRIPS) == 2
    for nodes in (10_000, 100_000, 1_000_000):
        parts = parts_for(nodes, 1, 3, STRIPS)
        assert parts > 2 and nodes / parts >= 1000


def test_nodes_deep_in_a_part_of_either_way_come_before_those_that_are_not():
    solid, seen = opened(), []
    parts, star = solid.parts(), solid.star()

    def task(thread, nodes):
        seen.append(nodes)
        return float(len(nodes))

    assert parts.sweep(star, task) == len(solid.nodes())
    assert sorted(np.concatenate(seen).tolist()) == solid.nodes().tolist()
    last = seen[-1]
    assert len(seen) == 5 and 0 < len(last) < 0.05 * len(solid.nodes())
    for way, group in ((0, seen[:2]), (1, seen[2:4])):
        for nodes in group:
            around = np.concatenate([star.link[star.start[v] : star.start[v + 1]].ravel() for v in nodes])
            assert len(set(parts.partitions[way][around].tolist())) == 1


def test_no_turn_is_taken_after_one_has_failed(monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 2)
    failed, taken = threading.Event(), []

    def task(thread, i):
        if i == 0:
            failed.set()
            raise KeyboardInterrupt
        failed.wait(10.0)
        taken.append(i)

    with pytest.raises(KeyboardInterrupt):
        by_turns(task, 1000)
    assert len(taken) < 1000
    assert by_turns(lambda thread, i: 2 * i, 5) == [0, 2, 4, 6, 8] and by_turns(lambda thread, i: i, 0) == []
