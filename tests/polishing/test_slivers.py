"""What facets leave out of arcs: joining facets stops before it costs more than it saves, told by a magnet's field."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.meshes import circle, disk, shells
from numpy.testing import assert_allclose

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.magnetostatics import Magnetostatics, Material
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.polishing.chords import longest_on_arcs, shift_per_area

CIRCLES = np.array([1.0, 5.0, 10.0, 40.0])  # radii: the magnet is between the second and the third


def magnet_potential(x):
    """A of a ring that is magnetised along x, 1 T / mu0: that of a whole cylinder less that of its hole."""
    squared = np.sum(x**2, axis=0)
    inner, outer = (0.5 * x[1] * np.minimum(1.0, radius**2 / squared) for radius in CIRCLES[1:3])
    return outer - inner


PROBLEM = Magnetostatics(
    {"magnet": Material(remanence=(1.0, 0.0)), "air": Material()},
    potential={"inner": magnet_potential, "outer": magnet_potential},
    order=1,
)


def magnet_ring(around, layers):
    """So many nodes on every circle, in far fewer layers than would suit them."""
    ratios = CIRCLES[1:] / CIRCLES[:-1]
    steps = [np.full(round(layers * np.log(ratio)), ratio ** (1 / round(layers * np.log(ratio)))) for ratio in ratios]
    radii = CIRCLES[0] * np.cumprod(np.concatenate([[1.0], *steps]))
    mesh = shells([radius * circle(around) for radius in radii], 1)
    radius = np.hypot(*mesh.p)[mesh.t]
    magnet = (radius.min(axis=0) > CIRCLES[1] * (1 - 1e-9)) & (radius.max(axis=0) < CIRCLES[2] * (1 + 1e-9))
    mesh = mesh.with_subdomains({"magnet": np.flatnonzero(magnet), "air": np.flatnonzero(~magnet)})
    ends = {"inner": lambda x: np.hypot(*x) < 2.0, "outer": lambda x: np.hypot(*x) > 30.0}
    return mesh.with_boundaries(ends, boundaries_only=True)


def cut_off(mesh, radius):
    """The area between a circle and the facets on it, the number of facets, and the length of the longest."""
    on = np.abs(np.hypot(*mesh.p) - radius) < 1e-6 * radius
    a, b = mesh.facets[:, on[mesh.facets].all(axis=0)]
    half = np.arcsin(0.5 * np.hypot(*(mesh.p[:, a] - mesh.p[:, b])) / radius)
    half = half[half < 0.5]
    return np.sum(radius**2 * (half - 0.5 * np.sin(2.0 * half))), len(half), 2.0 * radius * np.sin(half.max())


@pytest.fixture(scope="module")
def adapted():
    return ka.adapt(magnet_ring(160, 6), PROBLEM, passes=3)


def test_facets_are_joined_where_that_costs_little(adapted):
    """There is hardly a field in the hole."""
    _, facets, _ = cut_off(adapted.mesh, CIRCLES[0])
    assert facets < 50
    for radius in CIRCLES[1:3]:
        area, facets, _ = cut_off(adapted.mesh, radius)
        assert facets >= 140
        assert area < 1.6 * cut_off(adapted.history[0].mesh, radius)[0]


def iron(x, k):
    """A cylinder of another coefficient in a uniform field."""
    return 2.0 / (k + 1.0) * x[1], x[1] - (k - 1.0) / (k + 1.0) * x[1] / np.sum(x**2, axis=0)


def magnet(x, k):
    """A cylinder with a flux along x."""
    return 0.5 * x[0], 0.5 * x[0] / np.sum(x**2, axis=0)


@pytest.mark.parametrize(
    ("exact", "k", "flux", "expected"),
    [
        (iron, 1000.0, None, lambda t: 2.0 * 999.0 / 1001.0**2 * (np.cos(t) ** 2 + 1000.0 * np.sin(t) ** 2)),
        (iron, 0.001, None, lambda t: 2.0 * 0.999 / 1.001**2 * (np.cos(t) ** 2 + 0.001 * np.sin(t) ** 2)),
        (iron, 1.0, None, lambda t: 0.0 * t),
        (magnet, 1.0, [[0.0, 1.0], [0.0, 0.0]], lambda t: 0.5 * np.sin(t) ** 2),
        (magnet, 1.0, lambda x, number: np.stack([number, 0.0 * x[1]]), lambda t: 0.5 * np.sin(t) ** 2),
    ],
    ids=["iron in air", "air in iron", "nothing", "magnet", "magnet by a function"],
)
def test_the_energy_that_a_moved_circle_makes_is_the_exact_one(exact, k, flux, expected):
    mesh = shells([radius * circle(400) for radius in (0.5, 1.0, 2.0)], 60)
    inside = np.hypot(*mesh.p)[mesh.t].max(axis=0) < 1.0 + 1e-9
    mesh = mesh.with_subdomains({"core": np.flatnonzero(inside)})
    values = np.where(np.hypot(*mesh.p) < 1.0, *exact(mesh.p, k))
    tables = np.array([1.0, k]), np.zeros(2), flux or np.zeros((2, 2))
    ritz = ka.Ritz(values, np.zeros(values.size, dtype=bool), *tables, inside.astype(int))
    movable = MovableMesh.of(mesh, Rules())
    elements, position = movable.triangulation.elements, movable.triangulation.position
    e, k = np.nonzero((elements.chain >= 0) & (elements.neighbour > np.arange(len(elements.node))[:, None]))
    x, y = position[np.stack(elements.ends(e, k))].mean(axis=0).T
    shift = shift_per_area(ritz, movable.triangulation, e, k)
    assert_allclose(shift, expected(np.arctan2(y, x)), atol=0.03 * shift.max(initial=1e-9))


def test_curved_sides_may_be_longer_by_what_a_parabola_follows_of_an_arc():
    """Both leave out as much: ``l^3 / 12 r`` beside chords of length l, ``l^5 / 960 r^3`` beside parabolas."""
    mesh, problem = magnet_ring(160, 6), replace(PROBLEM, order=2)
    ritz = problem.ritz(mesh, problem.solve(mesh))
    chords, curved = (longest_on_arcs(ritz, MovableMesh.of(mesh, Rules(), bent), 0.01) for bent in (False, True))
    radius, on = np.hypot(*mesh.p), (chords > 0.0) & np.isfinite(chords)
    assert_allclose(curved[on] ** 5 / (960 * radius[on] ** 3), chords[on] ** 3 / (12 * radius[on]), rtol=1e-9)
    missing = np.pi - area(MovableMesh.of(disk(4, 1.0), Rules(), curved=True).mesh()).sum()
    assert missing == pytest.approx(24 * (2 * np.sin(np.pi / 24)) ** 5 / 960, rel=0.03)
