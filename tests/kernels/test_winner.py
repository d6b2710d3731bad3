"""The winner of a training point: the nearest node that it reaches within its own region."""

import numpy as np
import pytest
from helpers.alternatives import canonical_winner, nearest_node
from helpers.meshes import areas_of, comb, generic_square, holed, inset, junction, l_shape, perturbed, slit, square

from kohonen_adapt import Rules, Schedule, Stage
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.arrays import KernelMesh, SearchScratch
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.search import depth_in_element, walk
from kohonen_adapt.kernels.triangle.arrays import Elements
from kohonen_adapt.kernels.triangle.locate import find_winner, find_winners
from kohonen_adapt.mesh.locate import Locator
from kohonen_adapt.mesh.shapes import round_shapes
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import Draw

find_winner = interpreted(find_winner)

CONVEX = {"regular": lambda seed: square(6), "delaunay": lambda seed: generic_square(7, seed)}
MESHES = CONVEX | {
    "slit": lambda seed: slit(8),
    "bad slit": lambda seed: perturbed(slit(6), seed),
    "comb": lambda seed: perturbed(comb(10), seed),
    "hole": lambda seed: perturbed(holed(6), seed),
    "inset": lambda seed: perturbed(inset(4), seed),
    "junction": lambda seed: perturbed(junction(4), seed),
    "l": lambda seed: perturbed(l_shape(3), seed),
}


def amid_an_epoch(mesh, seed):
    """A map whose nodes went far since its elements were made, as in the middle of an epoch."""
    movable = untrained(mesh, min_quality=0.05)
    rng = np.random.default_rng(seed)
    element = rng.choice(mesh.nelements, 150, p=(weights := rng.random(mesh.nelements) ** 6) / weights.sum())
    learn(movable, points_in(mesh.p, mesh.t, element, rng), element, Schedule((Stage(2, 2, 0.8),)), rng)
    return movable


def untrained(mesh, min_quality=0.3):
    """A map whose elements stay, no point of which was presented yet."""
    return MovableMesh.of(mesh, Rules("fixed", min_quality))


def learn(movable, points, element, schedule, rng):
    """Present the points (2, k), whose elements in the mesh as it is are given, in every epoch."""
    region = movable.triangulation.elements.region[element]
    shown = Draw(points.T, element.astype(np.int32), region, np.ones(len(element)))
    Trainer.of(movable).learn(lambda number, rng: shown, schedule, rng)


def points_in(p, t, element, rng):
    return np.einsum("ke,dke->de", rng.dirichlet(np.ones(3), len(element)).T, p[:, t[:, element]])


def search(movable, start, x, region, alike=True):
    """Winner and distance by the kernel for one point; the one for many finds them too."""
    tri = movable.triangulation
    neurons = KernelMesh(tri.position, tri.elements, tri.star, movable.constraints)
    scratch = SearchScratch.of(tri.nnodes, len(tri.elements.node))
    winner, distance = find_winner(neurons, start, x, (1.0, 0.0, 1.0), region, scratch)
    winners, distances = np.empty(1, dtype=np.int32), np.empty(1)
    arrays = x[None], round_shapes(1, 2), np.array([region], dtype=np.int32), np.array([start], dtype=np.int32)
    find_winners(neurons, *arrays, winners, distances, scratch)
    if alike:
        assert winners[0] == winner
        assert distances[0] == pytest.approx(distance, rel=1e-14)
    return winner, distance


def searches(movable, number, seed):
    """Random points of a map with the element that holds each, and the node of their region to start from."""
    rng = np.random.default_rng(seed)
    tri = movable.triangulation
    node, region = tri.elements.node, tri.elements.region
    for e in rng.integers(0, len(node), number):
        x = rng.dirichlet(np.ones(3)) @ tri.position[node[e]]
        yield x, int(e), rng.choice(node[region == region[e]].ravel()), region[e]


def test_on_a_tangled_map_the_search_ends_at_a_node():
    movable, rng = untrained(square(6), min_quality=None), np.random.default_rng(0)
    tri, cluster = movable.triangulation, 0.4 + 0.1 * rng.random((2, 100))
    learn(movable, cluster, Locator(tri).find(cluster.T), Schedule((Stage(2, 3, 0.9, neighbourhood="flat"),)), rng)
    assert np.any(areas_of(tri) < 0)
    for x, _, start, region in searches(movable, 100, 1):
        winner, distance = search(movable, start, x, region, alike=False)
        assert distance == pytest.approx(np.hypot(*(tri.position[winner] - x)), rel=1e-14)


def test_ties_go_to_the_lowest_index():
    movable = untrained(square(4))
    position = movable.triangulation.position
    ticks = np.arange(0, 9) / 8  # cell centres and midpoints of edges are as near to four or two nodes
    for x in np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2):
        for start in range(0, len(position), 5):
            assert search(movable, start, x, 0)[0] == nearest_node(position, x)[0]


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("moved", [False, True])
def test_it_is_the_nearest_node_that_the_flooded_disc_reaches(kind, moved):
    hidden = 0
    for seed in range(2):
        mesh = MESHES[kind](seed)
        movable = amid_an_epoch(mesh, seed) if moved else untrained(mesh)
        tri = movable.triangulation
        arrays = tri.position, tri.elements.node, tri.elements.neighbour, tri.elements.region
        for x, holder, start, region in searches(movable, 80, seed):
            nearest = nearest_node(tri.position, x)
            want, shortest = nearest if kind in CONVEX else canonical_winner(*arrays, holder, x)
            winner, distance = search(movable, start, x, region)
            assert winner == want
            assert distance == pytest.approx(shortest, rel=1e-14)
            hidden += shortest > nearest[1] * (1 + 1e-12)
    if "slit" in kind and moved:
        assert hidden > 0, "no nearer node was ever out of reach: the meshes show nothing"


def test_a_flat_element_contains_no_point_and_divides_by_nothing():
    position, node = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), np.array([[0, 1, 2]])
    elements = Elements(node, np.full((1, 3), -1), np.zeros(1, int), np.full((1, 3), -1), np.zeros(3, int), np.zeros(1))
    for x in ((0.5, 0.0), (0.5, 1.0), (3.0, -1.0)):
        with np.errstate(all="raise"):
            assert interpreted(walk)(position, elements, 0, x) == (0, False)
            assert interpreted(depth_in_element)(position, node, 0, x) == -np.inf
