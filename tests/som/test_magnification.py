"""The density of nodes that a map makes of a density p of training points (d = 2), and how to get a prescribed one.

Radius 0 is vector quantisation: nodes come to p^(d / (d + 2)) = p^(1/2) (Zador, IEEE Trans. Inf. Theory 28, 1982).
Weights change that: training points of density rho, each of weight rho^(2/d), act as p = rho^((d + 2) / d) would, so
that the nodes come to rho itself. A wide radius on fixed elements gives p^(2/3) where the map is one-dimensional
(Ritter and Schulten, Biol. Cybern. 54, 1986) and p where ln p is harmonic, because the map is conformal there.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from skfem import MeshTri

from kohonen_adapt import KohonenMap, Schedule, Stage
from kohonen_adapt.mesh.measures import area

TOLERANCE = 0.1  # of slopes; the exponents of theory are farther apart
STEEPNESS = 2.0  # the ramp is exp(2 x)
SIDES, ANGLE = 32, np.pi / 2  # of an annular sector with radii 1 to e
STILL = Schedule(tuple(Stage(0, 200, rate, points_per_neuron=20.0) for rate in (0.3, (0.3, 0.01))))
WIDE = Schedule((Stage(3, 100, (0.2, 0.01), points_per_neuron=5.0),))


@dataclass(frozen=True)
class Trial:
    """A map, its training points, the logarithm of their density, and the exponent of theory."""

    mesh: MeshTri
    points: Callable
    log_density: Callable
    schedule: Schedule
    inner: Callable  # true for points far enough from the boundary for theory to hold
    exponent: float

    def trained(self):
        """Return the trained mesh, without the quality rule, which theory does not contain."""
        som = KohonenMap(self.mesh, topology="flip" if self.schedule is STILL else "fixed", min_quality=0.0)
        som.train(self.points, self.schedule, seed=0)
        return som.mesh

    def slope(self, mesh):
        """Return the slope of the logarithm of the density of nodes over that of the training points."""
        node = mesh.interior_nodes()
        node = node[self.inner(mesh.p[:, node])]
        share = np.bincount(mesh.t.ravel(), np.tile(area(mesh) / 3, 3))
        return np.polyfit(self.log_density(mesh.p[:, node]), -np.log(share[node]), 1)[0]


def inner(u):
    return np.abs(u - 0.5) < 0.5 - 1 / 7


def log_ramp(x):
    return STEEPNESS * x[0]


def ramp(height):
    def points(number, rng):
        u, v = stratified(number, height, rng)
        return np.stack((np.log1p(u * np.expm1(STEEPNESS)) / STEEPNESS, height * v)), None

    return points


def weighted_ramp(number, rng):
    x, _ = ramp(1.0)(number, rng)
    return x, np.exp(log_ramp(x) - STEEPNESS)


def square(cells):
    return MeshTri.init_tensor(*2 * [np.linspace(0, 1, cells + 1)])


def sector():
    grid = square(SIDES)
    radius, angle = 1 + (np.e - 1) * grid.p[0], ANGLE * grid.p[1]
    return MeshTri(radius * np.array((np.cos(angle), np.sin(angle))), grid.t)


def sector_points(number, rng):
    """Draw points of density r^-2, except between chords and the outer arc."""
    u, v = stratified(number, 1.0, rng)
    radius, angle, side = np.exp(u), ANGLE * v, ANGLE / SIDES
    chord = np.e * np.cos(side / 2) / np.cos(angle % side - side / 2)
    inside = radius < (1 - 1e-9) * chord
    return (radius * np.array((np.cos(angle), np.sin(angle))))[:, inside], None


def stratified(number, aspect, rng):
    """Draw points of the unit square, one in every cell of a grid with cells of an aspect ratio, in random order."""
    cells = np.array([np.ceil(np.sqrt(number / aspect)), np.ceil(np.sqrt(number * aspect))], dtype=int)
    corner = np.indices(cells).reshape(2, -1)
    return ((corner + rng.random(corner.shape)) / cells[:, None])[:, rng.permutation(corner.shape[1])]


def off_border(x):
    return inner(x[0]) & inner(x[1])


def off_sides(x):
    return inner(np.log(np.hypot(*x))) & inner(np.arctan2(x[1], x[0]) / ANGLE)


STRIP = MeshTri.init_tensor(np.linspace(0, 1, 41), np.linspace(0, 0.05, 3))
TRIALS = {
    "radius 0": Trial(square(12), ramp(1.0), log_ramp, STILL, off_border, 1 / 2),
    "radius 0, weighted": Trial(square(12), weighted_ramp, log_ramp, STILL, off_border, 1.0),
    "radius 3, strip": Trial(STRIP, ramp(0.05), log_ramp, WIDE, lambda x: inner(x[0]), 2 / 3),
    "radius 3, sector": Trial(sector(), sector_points, lambda x: -2 * np.log(np.hypot(*x)), WIDE, off_sides, 1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIALS)
def test_the_density_of_nodes_is_a_power_of_that_of_the_training_points(name):
    trial = TRIALS[name]
    assert abs(trial.slope(trial.trained()) - trial.exponent) < TOLERANCE
    assert abs(trial.slope(trial.mesh) - trial.exponent) > 2 * TOLERANCE
