"""The density of nodes that a map makes of a density p of training points (d = 2), and how to get a prescribed one.

Radius 0 is vector quantisation: nodes come to p^(d / (d + 2)) = p^(1/2) (Zador, IEEE Trans. Inf. Theory 28, 1982).
Weights change that: training points of density rho, each of weight rho^(2/d), act as p = rho^((d + 2) / d) would, so
that the nodes come to rho itself.
"""

import numpy as np
import pytest
from helpers.meshes import square

from kohonen_adapt import KohonenMap, Schedule, Stage
from kohonen_adapt.mesh.measures import area

TOLERANCE = 0.1  # of slopes; the exponents of theory are farther apart
STEEPNESS = 2.0  # the ramp is exp(2 x)
STILL = Schedule(tuple(Stage(0, 200, rate, points_per_neuron=20.0) for rate in (0.3, (0.3, 0.01))))


def ramp(number, rng):
    """Draw points of a density, one in every part of a grid of equal mass, in random order."""
    cells = int(np.ceil(np.sqrt(number)))
    corner = np.indices((cells, cells)).reshape(2, -1)
    u, v = ((corner + rng.random(corner.shape)) / cells)[:, rng.permutation(corner.shape[1])]
    return np.stack((np.log1p(u * np.expm1(STEEPNESS)) / STEEPNESS, v)), None


def weighted_ramp(number, rng):
    x, _ = ramp(number, rng)
    return x, np.exp(STEEPNESS * (x[0] - 1.0))


def slope(mesh):
    """Return the slope of the logarithm of the density of nodes over that of the points, away from the boundary."""
    node = np.flatnonzero(np.all(np.abs(mesh.p - 0.5) < 0.5 - 1 / 7, axis=0))
    share = np.bincount(mesh.t.ravel(), np.tile(area(mesh) / 3, 3))
    return np.polyfit(STEEPNESS * mesh.p[0, node], -np.log(share[node]), 1)[0]


@pytest.mark.slow
@pytest.mark.parametrize(("points", "exponent"), [(ramp, 1 / 2), (weighted_ramp, 1.0)])
def test_the_density_of_nodes_is_a_power_of_that_of_the_training_points(points, exponent):
    som = KohonenMap(square(12), min_quality=0.0)  # without the quality rule, which theory does not contain
    som.train(points, STILL, seed=0)
    assert abs(slope(som.mesh) - exponent) < TOLERANCE
    assert abs(slope(square(12)) - exponent) > 2 * TOLERANCE
