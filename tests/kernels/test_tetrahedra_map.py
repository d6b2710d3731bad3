"""The compiled loops of the map in space: winners, equation 1, what slides and what stays."""

import numpy as np
import pytest
from helpers.alternatives import canonical_winner, distance_to_simplex, rings
from helpers.slow_solids import SlowSolidMap
from helpers.solids import box, l_shape, two_regions
from helpers.tetrahedra import slit
from numpy.testing import assert_allclose, assert_array_equal

from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels import ordering
from kohonen_adapt.kernels.arrays import Lesson, SearchScratch
from kohonen_adapt.kernels.draw import draw_points
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.search import squared_distance_to_side
from kohonen_adapt.kernels.tetrahedron.arrays import (
    HELD,
    INSIDE,
    ON_PATCH,
    ON_RIDGE,
)
from kohonen_adapt.kernels.tetrahedron.guard import mark_valid
from kohonen_adapt.kernels.tetrahedron.locate import find_winners
from kohonen_adapt.kernels.tetrahedron.metric import ROUND
from kohonen_adapt.kernels.tetrahedron.train import learn
from kohonen_adapt.mesh.shapes import round_shapes


class Map:
    """A mesh of tetrahedra that learns by the kernels alone."""

    def __init__(self, mesh, floor=0.2):
        self.solid, self.floor = MovableSolid.of(mesh, Rules("fixed")), floor
        self.neurons = self.solid.kernel_mesh()
        self.position, self.elements = self.neurons.position, self.neurons.elements
        self.scratch = SearchScratch.of(len(self.position), len(self.elements.node))

    def search(self, points, region, hints):
        winners, distances = np.empty(len(points), dtype=np.int32), np.empty(len(points))
        rows = np.asarray(region, dtype=np.int32), np.asarray(hints, dtype=np.int32)
        find_winners(self.neurons, points, round_shapes(*points.shape), *rows, winners, distances, self.scratch)
        return winners, distances

    def learn(self, points, region, rate, strength=(1.0,)):
        """Points one after the other, each with its winner in the mesh that the one before left."""
        is_valid, found = np.empty(len(self.position), dtype=np.bool_), []
        for x, r in zip(points[:, None], np.asarray(region, dtype=np.int32)[:, None], strict=True):
            start = self.elements.node[self.elements.region == r[0]][0, :1]
            winners, distances = self.search(x, r, start)
            mark_valid(self.position, self.neurons.star, self.floor, 0, len(is_valid), is_valid)
            lesson = Lesson(x, r, np.ones(1), winners, np.array(strength))
            learn(self.neurons, lesson, rate, self.floor, is_valid, self.scratch)
            found.append(distances[0])
        return found

    def points(self, number, seed):
        """Random points in random elements, with the element."""
        rng = np.random.default_rng(seed)
        e = rng.integers(0, len(self.elements.node), number)
        shares = rng.dirichlet(np.ones(4), number)
        return np.einsum("tk,tkd->td", shares, self.position[self.elements.node[e]]), e


def tossed(mesh, seed, floor=0.05):
    """A map whose nodes went far, as in the middle of an epoch."""
    made = Map(mesh, floor=floor)
    points, e = made.points(60, seed)
    made.learn(points, made.elements.region[e], 0.6, (1.0, 0.5))
    return made


def test_the_curve_in_space_goes_from_cell_to_cell():
    n = 8
    cells = np.stack(np.meshgrid(*[np.arange(n)] * 3), axis=-1).reshape(-1, 3) + 0.5
    keys = np.empty(len(cells), dtype=np.int64)
    ordering.hilbert_keys_in_space(cells, np.zeros(3), float(n), keys)
    assert len(np.unique(keys)) == n**3
    assert np.all(np.abs(np.diff(cells[np.argsort(keys)], axis=0)).sum(axis=1) == 1.0)


def test_stretches_of_equal_mass_get_a_point_each_and_elements_are_filled_evenly():
    mesh = Map(box(1))
    node, order = mesh.elements.node, np.arange(6, dtype=np.int32)
    masses = np.array([1.0, 0.0, 3.0, 0.5, 0.5, 7.0])
    number, rng = 24_000, np.random.default_rng(0)
    points, element = np.empty((number, 3)), np.empty(number, dtype=np.int32)
    draw_points(mesh.position, node, order, np.cumsum(masses), rng.random((number, 4)), points, element)
    assert_array_equal(np.bincount(element, minlength=6), 2000 * masses)
    corners = mesh.position[node[element]]
    shares = np.linalg.solve((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1), (points - corners[:, 0])[..., None])
    shares = np.column_stack([1 - shares.sum(axis=1), shares[..., 0]])
    assert shares.min() > -1e-12
    # moments of the even distribution over a simplex: 1/4, and 1/10 or 1/20 of the products
    assert_allclose(shares.mean(axis=0), 0.25, atol=0.006)
    assert_allclose(shares.T @ shares / number, 0.05 + 0.05 * np.eye(4), atol=0.004)


def test_ties_go_to_the_lowest_number():
    made = Map(box(2))
    points = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 3), axis=-1).reshape(-1, 3)
    for start in (0, 13, 26):
        winners, _ = made.search(points, np.zeros(len(points)), np.full(len(points), start))
        squares = np.sum((points[:, None] - made.position) ** 2, axis=2)
        assert_array_equal(winners, squares.argmin(axis=1))


@pytest.mark.parametrize("kind", ["box", "slit", "l", "regions"])
def test_the_winner_is_the_nearest_node_that_the_flooded_ball_reaches(kind):
    """In a convex region that is the nearest of all."""
    mesh = {
        "box": lambda: box(4),
        "slit": lambda: slit(4, 0.5),
        "l": lambda: l_shape(1),
        "regions": lambda: two_regions(2),
    }[kind]()
    made, hidden = tossed(mesh, 3), 0
    node, neighbour, region = made.elements.node, made.elements.neighbour, made.elements.region
    points, element = made.points(300 if kind == "box" else 60, 4)
    starts = [np.random.default_rng(e).choice(node[region == region[e]].ravel()) for e in element]
    winners, distances = made.search(points, region[element], starts)
    for x, e, winner, distance in zip(points, element, winners, distances, strict=True):
        every = np.linalg.norm(made.position - x, axis=1)
        nearest = every.argmin(), every.min()
        arrays = made.position, node, neighbour, region
        want, shortest = nearest if kind == "box" else canonical_winner(*arrays, int(e), x)
        assert winner == want
        assert distance == pytest.approx(shortest, rel=1e-13)
        hidden += shortest > every.min() * (1 + 1e-12)
    assert kind != "slit" or hidden > 0, "no nearer node was ever out of reach: the mesh shows nothing"


def test_distances_to_faces_are_those_of_the_slow_twin():
    rng, distance = np.random.default_rng(0), interpreted(squared_distance_to_side)
    node = np.array([[0, 1, 2, 3]])
    for _ in range(60):
        position, x = rng.normal(size=(4, 3)), 2.0 * rng.normal(size=3)
        for k in range(4):
            slow = distance_to_simplex(np.delete(position, k, axis=0), x)
            assert np.sqrt(distance(position, node, ROUND, 0, k, x)) == pytest.approx(slow, rel=1e-9)


@pytest.mark.parametrize(("radius", "rate", "floor"), [(0, 0.9, 0.0), (0, 0.6, 0.4), (1, 0.05, 0.0)])
def test_training_is_equation_1_under_the_guard(radius, rate, floor):
    made = Map(box(3), floor=floor)
    freedom, surfaces = made.solid.freedom, made.solid.surfaces
    assert {INSIDE, ON_PATCH, ON_RIDGE, HELD} == set(freedom.number)
    ways = surfaces.axis, surfaces.ridge_axis
    slow = SlowSolidMap(made.position, made.elements.node, freedom.number, freedom.place, *ways, floor)
    points, _ = made.points(80, radius)
    strength = np.exp(-0.5 * 1.5**2 * np.arange(radius + 1))
    errors = made.learn(points, np.zeros(80), rate, strength)
    assert errors == pytest.approx([slow.present(x, rate, strength) for x in points], rel=1e-11)
    assert np.abs(made.position - slow.position).max() < 1e-12
    # where nodes of a ring are refused their order decides, and that is the kernel's own affair
    assert slow.refused == 0 if radius else slow.refused > 0


def test_deep_inside_a_part_nothing_reaches_another():
    made = Map(box(6))
    part = (made.position[:, 0] > 0.4).astype(np.int32) + (made.position[:, 1] > 0.6)
    interior, queue = np.empty(len(part), dtype=np.bool_), np.empty(len(part), dtype=np.int32)
    star = made.neurons.star
    ordering.mark_interior(star.start, star.link, part, 2, interior, queue)
    assert 0 < interior.sum() < len(part)
    for v in range(len(part)):
        near = np.concatenate(rings(made.elements.node, v, 2)).astype(int)
        assert interior[v] == np.all(part[near] == part[v])
