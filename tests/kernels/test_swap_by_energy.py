"""Swaps lower the functional by what they say, as far as they can, and spoil nothing."""

import numpy as np
import pytest
from helpers.boxes import check, jittered, opened, qualities, ringed, within_rings
from helpers.functions_in_space import functional, functional_of, on_nodes

from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron import rings
from kohonen_adapt.kernels.tetrahedron.arrays import RING, Queue
from kohonen_adapt.kernels.tetrahedron.swap import enter_changed, enter_worse, swap_downhill

FLOOR = 0.2
EVERY = 1.0  # no element is as good as this


class Swaps:
    """A queue of a mesh's elements, and what was seen of them."""

    def __init__(self, mesh, trial):
        self.mesh, self.trial = mesh, trial
        self.queue, self.seen = Queue.of(len(mesh.elements.node)), np.zeros((len(mesh.elements.node), 2))
        self.open = np.ones(len(mesh.surfaces.shape), dtype=bool)

    def enter_all(self):
        enter_worse(self.mesh, self.queue, EVERY)
        return self

    def swap(self, limit=1000):
        swaps, lowered = 0, 0.0
        while self.queue.state[1]:
            more, gain = swap_downhill(
                self.mesh, self.trial, None, self.queue, self.seen, self.open, 0.0, FLOOR**3, limit
            )
            swaps, lowered = swaps + more, lowered + gain
        assert not self.queue.waiting.any()
        return swaps, lowered


def world(cells, amount, seed, two, named=None, **function):
    position, node = jittered(cells, amount, seed)
    mesh = opened(position, node, position[node].mean(axis=1)[:, 0] > 0.5 if two else None, named)
    return mesh, on_nodes(mesh, seed, **function)


def test_edges_between_regions_are_swapped_where_that_lowers_the_sum_of_both():
    mesh, trial = world((2, 4, 4), 0.0, 0, True, value=rough)
    before, at_first = faces_at_half(mesh), functional(mesh, trial)
    lowered = Swaps(mesh, trial).enter_all().swap()[1]
    after = faces_at_half(mesh)
    assert len(before) == len(after) == 32 and before != after
    assert at_first - functional(mesh, trial) == pytest.approx(lowered)
    check(mesh, FLOOR)


def rough(x):
    return np.random.default_rng(1).normal(size=len(x))


def faces_at_half(mesh):
    e, k = np.nonzero(mesh.elements.patch >= 0)
    nodes = (np.delete(mesh.elements.node[i], j) for i, j in zip(e, k, strict=True) if mesh.elements.node[i, 0] >= 0)
    return {tuple(sorted(face)) for face in nodes if np.all(mesh.position[face, 0] == 0.5)}


def test_edges_on_closed_patches_stay():
    mesh, trial = world((2, 4, 4), 0.0, 0, True, value=rough)
    before, swaps = faces_at_half(mesh), Swaps(mesh, trial).enter_all()
    swaps.open[np.unique(mesh.elements.patch[(mesh.elements.patch >= 0) & (mesh.elements.neighbour >= 0)])] = False
    assert swaps.swap()[0] > 0
    assert faces_at_half(mesh) == before


def test_only_elements_that_have_changed_wait_again():
    mesh, trial = world((4, 4, 4), 0.3, 2, False)
    swaps = Swaps(mesh, trial).enter_all()
    swaps.swap()
    enter_changed(mesh, trial, swaps.queue, swaps.seen, 0.0)
    assert swaps.queue.state[1] == 0
    inner = np.flatnonzero(mesh.freedom.number == 3)
    mesh.position[inner[0]] += 1e-3
    trial.value[inner[-1]] += 1e-3
    around = np.isin(mesh.elements.node, inner[[0, -1]]).any(axis=1) & (mesh.elements.node[:, 0] >= 0)
    enter_changed(mesh, trial, swaps.queue, swaps.seen, 1.0)
    assert swaps.queue.state[1] == 0
    enter_changed(mesh, trial, swaps.queue, swaps.seen, 1e-9)
    assert np.array_equal(np.flatnonzero(swaps.queue.waiting), np.flatnonzero(around))


@pytest.mark.parametrize("count", range(3, RING + 1))
def test_the_triangulation_of_a_ring_has_the_least_functional_of_all_that_may_be(count):
    """Every triangulation of the polygon is looked at, and the dynamic program finds none below the least."""
    mesh, floor = ringed(count), 0.3**3
    trial = on_nodes(mesh._replace(pool=mesh.pool._replace(anchor=np.full(len(mesh.position), -1))), count)
    found = -interpreted(rings.triangulate)(mesh, trial, 0, count, count, count + 1, rings.RULED_OUT, floor)
    allowed = [made for made in within_rings(count) if may_be(mesh, made, floor)]
    energies = [functional_of(mesh.position, trial, made, np.zeros(len(made), dtype=int)) for made in allowed]
    assert found == pytest.approx(min(energies, default=np.inf))


def may_be(mesh, made, floor):
    return qualities(mesh.position, made).min() >= np.cbrt(floor)
