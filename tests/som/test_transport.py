"""Transport: kernels against slow twins, and what holds of every round, whatever the mesh."""

import numpy as np
import pytest
from helpers.alternatives import signed_quality
from helpers.examples import examples
from helpers.meshes import (
    SHAPES,
    generic_square,
    perturbed,
    square,
)
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Rules, Schedule
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.kernels.triangle.arrays import FREE
from kohonen_adapt.kernels.triangle.geometry import element_quality
from kohonen_adapt.kernels.triangle.transport import (
    find_directions,
    mark_spoiled,
    slow_down,
    smooth_moves,
    stop_nodes,
    sum_weights,
)
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import density_of
from kohonen_adapt.som.transport import FLOWS, clusters_of, potential, symmetric, wanted_inflow

element_quality = interpreted(element_quality)

FLOOR = 0.3


def parts_of(mesh):
    movable = MovableMesh.of(mesh, Rules())
    return movable.triangulation, movable.constraints


@pytest.mark.parametrize("kind", ["inset", "junction"])
def test_points_are_shared_by_the_elements_of_their_region_around_their_winner(kind):
    tri, _ = parts_of(SHAPES[kind])
    rng = np.random.default_rng(3)
    element = rng.integers(len(tri.elements.node), size=200)
    winners, region, weights = tri.elements.node[element, 0], tri.elements.region[element], rng.random(200)
    mass, slow = np.empty(len(tri.elements.node)), np.zeros(len(tri.elements.node))
    sum_weights(winners, region, weights, tri.elements, tri.star, mass)
    for v, r, weight in zip(winners, region, weights, strict=True):
        around = np.any(tri.elements.node == v, axis=1) & (tri.elements.region == r)
        slow[around] += weight / around.sum()
    assert_allclose(mass, slow, rtol=1e-13)
    assert mass.sum() == pytest.approx(weights.sum(), rel=1e-13)


def test_smoothing_is_the_mean_of_the_neighbours():
    tri, constraints = parts_of(generic_square(8))
    move = np.random.default_rng(1).normal(size=(tri.nnodes, 2))
    smoothed = np.empty_like(move)
    smooth_moves(tri.star, constraints, move, 0, tri.nnodes, smoothed)
    for v in np.flatnonzero(constraints.kind == FREE):
        others = np.setdiff1d(tri.elements.node[np.any(tri.elements.node == v, axis=1)], [v])
        assert_allclose(smoothed[v], move[others].mean(axis=0), rtol=1e-12)
    on_outline = constraints.kind != FREE
    x, y = tri.position[on_outline].T
    assert np.all(smoothed[on_outline, 0][(x == 0) | (x == 1)] == 0)
    assert np.all(smoothed[on_outline, 1][(y == 0) | (y == 1)] == 0)


def test_flow_balances_what_clusters_ask_for():
    row, column = np.array([0, 1, 2, 4]), np.array([1, 2, 3, 5])  # two parts, and a cluster that touches no other
    conductance, size = np.array([1.0, 2.0, 0.5, 3.0]), np.array([32.0, 30.0, 31.0, 33.0, 32.0, 32.0, 7.0])
    links = symmetric(conductance, row, column, len(size))
    inflow = wanted_inflow(np.array([90.0, 3.0, 4.0, 5.0, 1.0, 0.0, 9.0]), size, links)
    assert inflow[:4].sum() == pytest.approx(0, abs=1e-12)
    assert inflow[4:6].sum() == pytest.approx(0, abs=1e-12)
    assert inflow[6] == 0
    assert inflow[0] > 0 > inflow[1]
    height = potential(links, inflow)
    flux, balance = conductance * (height[column] - height[row]), np.zeros(7)
    np.add.at(balance, column, flux)
    np.add.at(balance, row, -flux)
    assert_allclose(balance, inflow, atol=1e-6 * np.abs(inflow).max())


@given(seed=st.integers(0, 2**32 - 1), length=st.floats(0.0, 1.0))
@examples(40)
def test_what_is_held_back_spoils_nothing(seed, length):
    mesh = perturbed(generic_square(7), seed % 7)
    tri, constraints = parts_of(mesh)
    node, n, m = tri.elements.node, tri.nnodes, len(tri.elements.node)
    free = constraints.kind == FREE
    ahead = tri.position + length * np.random.default_rng(seed).normal(size=(n, 2)) * free[:, None]
    spoiled, queue = np.empty(m, dtype=bool), np.empty(m, dtype=np.int32)
    wish = ahead.copy()
    mark_spoiled(tri.position, ahead, node, FLOOR, 0, m, spoiled)
    before = np.array([element_quality(tri.position, node, e) for e in range(m)])
    after = np.array([signed_quality(*ahead[corners]) for corners in node])
    assert np.all(spoiled[after < np.minimum(FLOOR, before) - 1e-13])
    assert not np.any(spoiled[after > np.minimum(FLOOR, before) + 1e-13])
    stop_nodes(tri.position, ahead, node, tri.star, FLOOR, spoiled, queue)
    after = np.array([element_quality(ahead, node, e) for e in range(m)])
    assert np.all(after >= np.minimum(FLOOR, before))
    stayed, went = (np.all(ahead == where, axis=1) for where in (tri.position, wish))
    assert np.all(stayed | went)


def test_around_what_stands_still_nodes_are_the_slower_the_nearer_they_are():
    tri, constraints = parts_of(square(20))
    n, node, rings = tri.nnodes, tri.elements.node, 4
    free = constraints.kind == FREE
    ahead = tri.position + np.outer(free, [0.5, 0.25])
    ring, distance = np.full(n, rings, dtype=np.int32), np.full(n, rings)
    for place in (0.5, 0.6, 0.3):  # one after the other as all at once: the nearest has the say
        spoiled = np.zeros(len(node), dtype=bool)
        spoiled[np.argmin(np.hypot(*(tri.centroids() - place).T))] = True
        slow_down(tri.position, ahead, np.zeros(n), node, tri.star, constraints, spoiled, ring, np.empty(n, np.int32))
        distance = np.minimum(distance, edges_from(node, node[spoiled].ravel(), n))
        expected = tri.position + (free * distance / rings)[:, None] * [0.5, 0.25]
        assert_allclose(ahead, expected, atol=1e-15)
        assert np.array_equal(ring, distance)


def edges_from(node, starts, n):
    """How many edges every node is from the nearest of some."""
    distance, reached, number = np.full(n, n), np.isin(np.arange(n), starts), 0
    while np.any(distance == n):
        distance[reached & (distance == n)] = number
        reached[node[reached[node].any(axis=1)]] = True
        number += 1
    return distance


def test_of_many_rounds_the_first_are_taken_together_and_reach_farther():
    mesh, far = square(16), 2.0 * np.log(10.0)

    def density(x):
        return np.exp(-far * x[0])

    draws, places = [0, 0], []
    for which, rounds in enumerate((FLOWS, 2 * FLOWS)):
        som = KohonenMap(mesh)

        def drawn(count, rng, which=which):
            draws[which] += 1
            x = rng.random((2, 50 * count))
            return x[:, rng.random(x.shape[1]) < density(x)][:, :count], None

        som.train(drawn, Schedule((), rounds=rounds))
        places.append(som.mesh.p[0].mean())
    assert draws == [FLOWS, FLOWS]
    assert places[1] < places[0] - 0.01


def wins_per_element(mesh, density, seed=5):
    """Mass of many training points in every element, as transport sums it up."""
    movable = MovableMesh.of(mesh, Rules())
    tri = movable.triangulation
    shown = density_of(tri, density).draw(40 * tri.nnodes, np.random.default_rng(seed))
    winners = winners_of(movable, shown)
    mass = np.empty(len(tri.elements.node))
    sum_weights(winners, shown.region, shown.weights, tri.elements, tri.star, mass)
    return mass


def winners_of(movable, shown):
    """The winners of training points that were drawn from the mesh as it is."""
    return Trainer.of(movable).search(shown, movable.triangulation.elements.node[shown.element, 0])[0]


def test_one_round_evens_out_more_than_half_of_what_is_wanted():
    mesh = square(48)

    def density(x):
        return 1.0 + 3.0 * x[0]

    columns = []
    for state in (mesh, ka.relocate(mesh, density, schedule=Schedule((), rounds=1))):
        mass, x = wins_per_element(state, density), state.p[0, state.t].mean(axis=0)
        columns.append([mass[np.abs(x - place) < 0.1].mean() for place in (0.1, 0.5, 0.9)])
    spread = [np.ptp(np.log(column)) for column in columns]
    assert spread[0] > 0.9
    assert spread[1] < 0.5 * spread[0]


def rank_of(tri):
    return np.argsort(along_curve(tri.position))


def test_clusters_on_outlines_flow_along_them():
    mesh = square(24)
    tri, constraints = parts_of(mesh)
    cluster = clusters_of(tri, rank_of(tri))
    along = np.empty((cluster.max() + 1, 3))
    find_directions(tri.elements.node, constraints, cluster, np.empty(len(along)), along)
    seen = set()
    for c, matrix in enumerate(along.tolist()):
        x, y = tri.position[np.unique(tri.elements.node[cluster == c])].T
        upright, level = bool(np.any((x == 0) | (x == 1))), bool(np.any((y == 0) | (y == 1)))
        seen.add((upright, level))
        if not (upright and level):
            assert matrix == [0.0 if level < upright else 1.0, 0.0, 0.0 if upright < level else 1.0]
        else:
            assert 0 < matrix[0] + matrix[2] < 1
    assert len(seen) == 4
