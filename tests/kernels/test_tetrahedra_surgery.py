"""No sequence of swaps, exchanges and sweeps spoils a mesh of tetrahedra; each does what it says."""

from itertools import pairwise

import numpy as np
import pytest
from helpers.boxes import (
    ball,
    check,
    drum,
    jittered,
    opened,
    qualities,
    qualities_of,
    random_shapes,
    ringed,
    swaps,
    volumes,
    within_rings,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from kohonen_adapt.kernels.arrays import KernelMesh, Metric
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron import rings, smooth
from kohonen_adapt.kernels.tetrahedron.arrays import INSIDE, INTERSECTION, RING, ROUND_METRIC, Constraints, Queue, Star
from kohonen_adapt.kernels.tetrahedron.geometry import fill_star, mark_non_manifold
from kohonen_adapt.kernels.tetrahedron.recycle import fill_heaps, recycle
from kohonen_adapt.kernels.tetrahedron.smooth import smooth_nodes
from kohonen_adapt.kernels.tetrahedron.surfaces import measure_sagittas

FLOOR = 0.2


def exchange(mesh, missing=0, ratio=2.2, limit=10):
    queue, rows = Queue.of(len(mesh.elements.node)), len(mesh.elements.node)
    heaps, net, total, done = (Heap.of(4 * rows), Heap.of(4 * rows)), 0, 0, False
    fill_heaps(mesh, *heaps, 0, len(mesh.position))
    while not done:
        splits, collapses, done = recycle(mesh, queue, *heaps, missing - net, ratio, FLOOR**3, limit)
        net, total = net + splits - collapses, total + splits
    return net, total


def sweep(mesh, density):
    node, n = mesh.elements.node, len(mesh.position)
    star = Star.of(n, len(node))
    fill_star(node, star)
    weight = density(mesh.position[node].mean(axis=1)) ** (5 / 3)
    order = np.flatnonzero(mesh.pool.anchor >= 0).astype(np.int32)
    constraints = Constraints(mesh.freedom, mesh.surfaces, mesh.freedom.number == INSIDE)
    before = mesh.position.copy()
    neurons = KernelMesh(mesh.position, mesh.elements, star, constraints)
    smooth_nodes(neurons, weight, FLOOR**3, order)
    return int(np.count_nonzero(np.any(mesh.position != before, axis=1)))


def bump(centre, height):
    return lambda x: 1.0 + height * np.exp(-20.0 * ((x - centre) ** 2).sum(axis=1))


def half_named(middle):
    return abs(middle[2] - 0.5) < 1e-9 and middle[0] < 0.5


@st.composite
def worlds(draw):
    cells = draw(st.sampled_from([(2, 2, 2), (2, 3, 4), (4, 2, 2), (4, 4, 2)]))
    position, node = jittered(cells, draw(st.sampled_from([0.0, 0.3, 0.7])), draw(st.integers(0, 1000)))
    region = position[node].mean(axis=1)[:, 0] > 0.5 if draw(st.booleans()) and cells[0] % 2 == 0 else None
    named = half_named if draw(st.booleans()) and cells[2] % 2 == 0 else None
    density = bump(draw(st.sampled_from([0.0, 0.4, 1.0])), draw(st.sampled_from([0.0, 30.0, 1000.0])))
    return opened(position, node, region, named, density), density


@settings(max_examples=12)
@given(worlds(), st.lists(st.sampled_from(["swap", "recycle", "more", "fewer", "smooth"]), min_size=2, max_size=5))
def test_what_a_mesh_promises_holds_after_anything(world, steps):
    mesh, density = world
    count, by_region, by_patch = check(mesh)
    floor = min(FLOOR, qualities_of(mesh).min())
    for step in steps:
        if step == "swap":
            swaps(mesh)
        elif step == "smooth":
            sweep(mesh, density)
        else:
            missing = {"more": 1, "fewer": -1}.get(step, 0)
            net, _ = exchange(mesh, missing)
            count += net
            assert net == missing or (missing < 0 and net == 0)  # it may be that nothing can go
        now, regions, patches = check(mesh, floor)
        assert now == count
        assert regions == pytest.approx(by_region, rel=1e-12)
        assert patches == pytest.approx(by_patch, rel=1e-12)


@pytest.mark.parametrize("body", [ball(4), drum(4), drum(4, INTERSECTION)], ids=["ball", "drum", "intersections"])
def test_nodes_stay_on_curved_patches_and_ridges(body):
    """New nodes, too; and what chords cut off grows by no swap and no collapse."""
    measure_sagittas(body, body.origins.sagitta)
    sagitta = body.origins.sagitta.copy()
    density = bump(np.array([1.0, 0.0, 0.0]), 30.0)
    body.origins.fineness[:] = np.cbrt(density(body.position))
    count, floor = check(body)[0], min(FLOOR, qualities_of(body).min())
    swaps(body)
    check(body, floor)
    net, number = exchange(body, ratio=1.9)
    assert net == 0 and number > 3
    assert check(body, floor)[0] == count
    found = np.zeros_like(sagitta)
    measure_sagittas(body, found)
    assert np.all(found <= sagitta * (1 + 1e-9))
    for _ in range(2):
        assert sweep(body, density) > 10
        swaps(body)
        check(body, floor)


def test_exchanging_brings_nodes_to_where_they_are_wanted():
    position, node = jittered((6, 6, 6), 0.0, 0)
    density = bump(0.5, 100.0)
    mesh = opened(position, node, density=density)
    before = nodes_near(mesh)
    net, number = exchange(mesh)
    assert net == 0 and number > 20 and nodes_near(mesh) > 2 * before
    check(mesh, FLOOR)


def nodes_near(mesh):
    used = mesh.position[mesh.pool.anchor >= 0]
    return int(np.sum(np.abs(used - 0.5).max(axis=1) < 0.2))


def test_when_no_element_waits_no_swap_is_left():
    mesh = opened(*jittered((4, 4, 4), 0.7, 3))
    before = qualities_of(mesh).min()
    assert swaps(mesh, limit=7) > 50
    assert swaps(mesh) == 0
    assert qualities_of(mesh).min() > before


@pytest.mark.parametrize("count", range(3, RING + 1))
def test_the_best_triangulation_of_a_ring_is_that_of_brute_force(count):
    """Every triangulation of the polygon is looked at, and the dynamic program finds none worse than the best."""
    mesh = ringed(count)
    found = interpreted(rings.triangulate)(mesh, None, 0, count, count, count + 1, 0.0, 0.0)
    best = max(qualities(mesh.position, made).min() for made in within_rings(count))
    assert found == pytest.approx(max(best, 0.0) ** 3 if best > 0 else rings.RULED_OUT)
    if found > 0:
        new = interpreted(rings.write_triangulation)(mesh, 0, count, count, count + 1, -1, 0)
        made = mesh.cavity.new[:new]
        assert new == 2 * (count - 2)
        assert qualities(mesh.position, made).min() ** 3 == pytest.approx(found)
        around = np.array([(count, count + 1, a, b) for a, b in pairwise([*range(count), 0])])
        assert volumes(mesh.position, made).sum() == pytest.approx(volumes(mesh.position, around).sum())


@pytest.mark.parametrize("ratio", [1.0, 5.0])
def test_the_derivatives_of_the_sum_that_is_smoothed_are_those_of_differences(ratio):
    position, node = jittered((2, 2, 2), 0.5, 1)
    star, v, step = Star.of(len(position), len(node)), 13, 1e-5
    fill_star(node, star)
    weight = np.random.default_rng(0).uniform(0.5, 2.0, len(node))
    metric = ROUND_METRIC if ratio == 1.0 else Metric(random_shapes(len(position), ratio, 2), 1.0)

    def derivatives(way):
        moved = position.copy()
        moved[v] += way
        return np.concatenate(interpreted(smooth.derivatives)(moved, star, metric, weight, v))

    def energy(way):
        return interpreted(smooth.star_energy)(position, star, metric, weight, v, position[v] + way)[0]

    found, units = derivatives(np.zeros(3)), step * np.eye(3)
    slopes = np.array([energy(way) - energy(-way) for way in units]) / (2 * step)
    assert found[:3] == pytest.approx(slopes, rel=1e-6, abs=1e-6 * np.abs(slopes).max())
    hessian = np.array([derivatives(way)[:3] - derivatives(-way)[:3] for way in units]) / (2 * step)
    upper = hessian[np.triu_indices(3)]
    assert found[3:] == pytest.approx(upper, rel=1e-6, abs=1e-6 * np.abs(upper).max())
    assert np.linalg.eigvalsh(hessian).min() > 0


def test_smoothing_lowers_what_it_says():
    mesh = opened(*jittered((3, 3, 3), 0.7, 5))
    before = [qualities_of(mesh)]
    for _ in range(4):
        assert sweep(mesh, bump(0.5, 0.0)) > 0
    after = qualities_of(mesh)
    assert after.mean() > before[0].mean() and after.min() >= min(FLOOR, before[0].min())


def test_nodes_between_elements_that_share_no_face_are_known():
    """Two boxes that have one edge in common: its nodes hold two fans each."""
    position, node = jittered((2, 2, 1), 0.0, 0)
    middle = position[node].mean(axis=1)
    node = node[(middle[:, 0] < 0.5) == (middle[:, 1] < 0.5)]
    used = np.unique(node)
    mesh = opened(position[used], np.searchsorted(used, node).astype(np.int32))
    star, non_manifold = Star.of(len(used), len(node)), np.zeros(len(used), dtype=bool)
    fill_star(mesh.elements.node[: len(node)], star)
    mark_non_manifold(mesh, star, non_manifold)
    assert np.array_equal(non_manifold, (position[used][:, :2] == 0.5).all(axis=1))
