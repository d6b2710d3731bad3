"""The map: equation 1 of the paper with its neighbourhoods, regions, errors and guard."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from helpers.alternatives import SlowMap, barycentre, circumcentre, nearest_node, rings, slow_sweep
from helpers.meshes import generic_square, holed, inset, outline_nodes, perturbed, square
from helpers.processes import output_with
from helpers.solids import box
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

import kohonen_adapt as ka
from kohonen_adapt import KohonenMap, Rules, Schedule, Stage
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.kernels.ordering import mark_interior, shuffle, sorted_into_tiles
from kohonen_adapt.kernels.triangle.smooth import RELAXATION
from kohonen_adapt.mesh.measures import signed_area
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import density_of

NOTHING = 1e-300  # a learning rate that moves no node


def one(radius, rate, neighbourhood="flat"):
    return Schedule((Stage(radius, 1, rate, neighbourhood=neighbourhood),))


def points_of(mesh, number, seed):
    rng = np.random.default_rng(seed)
    element = rng.integers(0, mesh.t.shape[1], number)
    return np.einsum("ke,dke->de", rng.dirichlet(np.ones(3), number).T, mesh.p[:, mesh.t[:, element]]), element


def moved_nodes(mesh, other):
    return set(np.flatnonzero((mesh.p != other.p).any(axis=0)).tolist())


@pytest.mark.parametrize(
    ("radius", "rate", "min_quality"), [(0, 0.9, 0.0), (0, 0.6, 0.4), (1, 0.03, 0.0), (2, 0.02, 0.0)]
)
@pytest.mark.parametrize(("kind", "neighbourhood"), [("square", "flat"), ("inset", "gaussian"), ("bad", "gaussian")])
def test_training_is_equation_1_under_the_guard(kind, neighbourhood, radius, rate, min_quality):
    mesh = {"square": generic_square(6), "inset": inset(8), "bad": perturbed(holed(6), 2)}[kind]
    held = np.union1d(mesh.boundary_nodes(), outline_nodes(mesh))
    som = KohonenMap(mesh, topology="fixed", min_quality=min_quality, pinned=held)
    elements = Triangulation.of(mesh).elements
    movable = ~np.isin(np.arange(mesh.p.shape[1]), held)
    slow = SlowMap(mesh.p.T, elements.node, elements.neighbour, elements.region, movable, min_quality)
    points, element = points_of(mesh, 120, radius)
    strength = Stage(radius, 1, rate, neighbourhood=neighbourhood).strength()
    for x, e in zip(points.T, element, strict=True):
        (error,) = som.train(x[:, None], one(radius, rate, neighbourhood))
        assert error == pytest.approx(slow.present(x, elements.region[e], rate, strength), rel=1e-12)
    assert np.abs(som.mesh.p.T - slow.position).max() < 1e-12
    # where nodes of a ring are refused their order decides, and that is the kernel's own affair
    assert slow.refused == 0 if radius else slow.refused > 0
    assert len(moved_nodes(mesh, som.mesh)) > 0.4 * movable.sum()


@pytest.mark.parametrize("radius", [0, 1, 3])
def test_deep_inside_a_part_nothing_reaches_another(radius):
    tri = Triangulation.of(generic_square(16))
    part = (tri.position[:, 0] > 0.4).astype(np.int32) + (tri.position[:, 1] > 0.6)
    interior, queue = np.empty(tri.nnodes, dtype=np.bool_), np.empty(tri.nnodes, dtype=np.int32)
    mark_interior(tri.star.start, tri.star.link, part, radius + 1, interior, queue)
    for v in range(tri.nnodes):
        near = np.concatenate(rings(tri.elements.node, v, radius + 1))
        assert interior[v] == np.all(part[near.astype(int)] == part[v])


def test_points_are_sorted_by_tile_and_by_how_deep_their_winners_are():
    rng = np.random.default_rng(3)
    winners, rank, interior = rng.integers(0, 40, 200), rng.permutation(40), rng.random(40) < 0.7
    cuts, order = sorted_into_tiles(winners, rank, interior, 5)
    assert all(np.all(np.diff(order[first:last]) > 0) for first, last in pairwise(cuts))
    shuffle(cuts, order, rng)
    assert sorted(order) == list(range(200))
    for i, (first, last) in enumerate(pairwise(cuts)):
        found = winners[order[first:last]]
        assert np.all(rank[found] // 8 == i % 5)
        assert np.all(interior[found] == (i < 5))


@pytest.mark.parametrize("weight", [4.0, 1e9])
def test_learning_rate_times_weight_is_capped_at_1(weight):
    mesh, x = square(4), np.array([[0.3], [0.27]])
    som = KohonenMap(mesh, topology="fixed", min_quality=0.0)
    som.train(x, one(0, 0.5), weights=[weight])
    winner = nearest_node(mesh.p.T, x[:, 0])[0]
    assert_allclose(som.mesh.p[:, winner], x[:, 0], rtol=1e-15)


@pytest.mark.parametrize("mesh", [square(4), box(3)], ids=["plane", "space"])
def test_a_map_trains_alike_in_another_process(mesh):
    som, points = KohonenMap(mesh), np.random.default_rng(1).random((len(mesh.p), 50))
    copied = pickle.loads(pickle.dumps(som))
    for each in (som, copied):
        each.train(points, one(1, 0.1))
    assert_array_equal(copied.mesh.p, som.mesh.p)


def test_training_stops_when_the_error_is_below_the_tolerance():
    mesh = square(10)
    points = np.random.default_rng(0).random((2, 300)) ** 2
    errors = KohonenMap(mesh).train(points, Schedule.paper())
    reached = sorted(errors)[len(errors) // 2]
    stop = next(k for k, error in enumerate(errors) if error < reached)
    stages = Schedule.paper().stages
    stopped = KohonenMap(mesh).train(points, Schedule(stages, tolerance=reached, fresh=False))
    assert stopped == errors[: stop + 1]
    assert len(KohonenMap(mesh).train(points, Schedule(stages, tolerance=0.0, fresh=False))) == 18


@pytest.mark.parametrize(("fresh", "calls"), [(True, [50, 50, 100]), (False, [100])])
def test_a_callable_is_asked_once_per_epoch_or_once(fresh, calls):
    asked = []

    def draw(number, rng):
        asked.append(number)
        return rng.random((2, number)), None

    stages = (Stage(1, 2, 0.2, points_per_neuron=2.0), Stage(0, 1, 0.1, points_per_neuron=4.0))
    errors = KohonenMap(square(4)).train(draw, Schedule(stages, fresh=fresh))
    assert len(errors) == 3
    assert asked == calls


@pytest.mark.parametrize("mesh", [square(10), box(5)], ids=["plane", "space"])
def test_the_error_of_an_epoch_is_the_mean_distance_to_the_nearest_nodes_and_falls(mesh):
    points = np.random.default_rng(0).random((len(mesh.p), 400)) ** 2
    mean = cKDTree(mesh.p.T).query(points.T)[0].mean()
    som = KohonenMap(mesh, topology="fixed")
    assert som.train(points, Schedule((Stage(0, 2, NOTHING), Stage(1, 1, NOTHING)))) == pytest.approx([mean] * 3)
    assert_array_equal(som.mesh.p, mesh.p)
    for topology in ("fixed", "flip"):
        som = KohonenMap(mesh, topology=topology, min_quality=0.1)
        errors = som.train(points, Schedule.paper())
        assert len(errors) == 18 and errors[-1] < 0.9 * mean
        assert cKDTree(som.mesh.p.T).query(points.T)[0].mean() < 0.9 * mean


@pytest.mark.parametrize("mesh", [square(8), box(4)], ids=["plane", "space"])
def test_the_guard_keeps_every_element_and_without_it_elements_overlap(mesh):
    points = 0.3 + 0.1 * np.random.default_rng(4).random((len(mesh.p), 100))
    schedule = Schedule((Stage(2, 3, 0.9, neighbourhood="flat"),))
    for min_quality in (0.0, 0.3, 0.6, None):
        som = KohonenMap(mesh, topology="fixed", min_quality=min_quality)
        som.train(points, schedule)
        turned = np.sign(signed_area(som.mesh)) != np.sign(signed_area(mesh))
        assert turned.any() == (min_quality is None)
        assert turned.any() or ka.quality(som.mesh).min() >= min(min_quality, ka.quality(mesh).min()) - 1e-14


@pytest.mark.parametrize("min_quality", [0.0, 0.5])
@pytest.mark.parametrize("topology", ["flip", "fixed"])
def test_a_sweep_moves_nodes_towards_the_weighted_centres_of_their_elements(topology, min_quality):
    mesh = perturbed(square(6), 4, worst=0.3)
    movable = MovableMesh.of(mesh, Rules(topology, min_quality))
    movable.flip()
    tri, trainer = movable.triangulation, Trainer.of(movable)
    density = density_of(tri, np.random.default_rng(0).uniform(1, 3, mesh.t.shape[1]))
    x, y = mesh.p
    axes = {v: [k for k, at in enumerate((x[v], y[v])) if at not in (0, 1)] for v in range(mesh.p.shape[1])}
    axes = {v: axes[v] for v in trainer.order if axes[v]}
    centre = circumcentre if topology == "flip" else barycentre
    squares = density.means(tri.position[tri.elements.node]) ** 2
    wanted = slow_sweep(tri.position, tri.elements.node, squares, axes, centre, RELAXATION, min_quality)
    trainer.smooth(density, 1)
    assert np.abs(tri.position - wanted).max() < 1e-12
    assert np.all((wanted != mesh.p.T).any(axis=1).sum() > 0.8 * len(axes))


SCRIPT = """
import numpy as np, kohonen_adapt as ka
from helpers.meshes import inset, centres
mesh = inset(4)
density = 1 / (0.02 + np.hypot(*(centres(mesh) - 0.3)))
for topology in ("fixed", "flip"):
    schedule = ka.Schedule((ka.Stage(2, 1, 0.3), ka.Stage(0, 1, 0.3)), sweeps=2)
    result = ka.relocate(mesh, density, topology=topology, schedule=schedule)
    print(result.p.tobytes().hex(), result.t.tobytes().hex())
"""


def arrays_with(**variables):
    fields = output_with(SCRIPT, **variables).split()
    assert len(fields) == 4
    return [np.frombuffer(bytes.fromhex(field), dtype) for field, dtype in zip(fields, "didi", strict=True)]


@pytest.mark.slow
def test_kernels_do_the_same_as_plain_python():
    for compiled, plain in zip(arrays_with(), arrays_with(NUMBA_DISABLE_JIT="1"), strict=True):
        assert_allclose(plain, compiled, rtol=1e-9, atol=1e-9)  # numpy's exp and libm's differ in a bit
