"""Magnets in air against magpylib, which integrates over charges and currents and knows no mesh."""

import numpy as np
import pytest
from helpers.sheets import MU0, rectangle_potential
from helpers.tensor_meshes import box

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

magpylib = pytest.importorskip("magpylib", reason="magpylib is the oracle; it is in the test extra")

# Centre and half sides in m, magnetisation in A/m: side by side, one above the other, magnetised askew.
MAGNETS = {
    "left": ((-0.010, -0.002), (0.004, 0.003), (0.0, 9e5)),
    "right": ((0.008, 0.000), (0.003, 0.005), (7e5, -4e5)),
    "top": ((-0.004, 0.010), (0.005, 0.002), (-8e5, 2e5)),
}


def potential(x):
    """A of all magnets: what is magnetised along x is what is magnetised along y, turned by a right angle."""
    total = np.zeros(x.shape[1])
    for (right, up), (width, height), (along_x, along_y) in MAGNETS.values():
        total += rectangle_potential(x, (right, up), (width, height), along_y)
        total += rectangle_potential(np.stack((-x[1], x[0])), (-up, right), (height, width), along_x)
    return total


def sides(centre, half):
    return centre[0] - half[0], centre[0] + half[0], centre[1] - half[1], centre[1] + half[1]


def cuboid(name, length):
    centre, half, magnetisation = MAGNETS[name]
    return magpylib.magnet.Cuboid(
        dimension=(2 * half[0], 2 * half[1], length), magnetization=(*magnetisation, 0.0), position=(*centre, 0.0)
    )


@pytest.fixture(scope="module")
def field():
    places = {name: sides(centre, half) for name, (centre, half, _) in MAGNETS.items()}
    mesh = box(*2 * [np.linspace(-0.03, 0.03, 61)], places)
    materials = {name: Material(remanence=(MU0 * m[0], MU0 * m[1])) for name, (_, _, m) in MAGNETS.items()}
    problem = Magnetostatics({**materials, "air": Material()}, potential={"outer": potential})
    return ka.adapt(mesh, problem, passes=2).solution


def test_flux_density(field):
    x = np.random.default_rng(0).uniform(-0.028, 0.028, (2, 4000))
    for centre, half, _ in MAGNETS.values():
        corners = [(centre[0] + a * half[0], centre[1] + b * half[1]) for a in (-1, 1) for b in (-1, 1)]
        x = x[:, np.min([np.hypot(x[0] - a, x[1] - b) for a, b in corners], axis=0) > 0.001]
    exact = sum(cuboid(name, 200.0).getB(np.c_[x.T, np.zeros(x.shape[1])]) for name in MAGNETS)[:, :2].T
    difference = field.flux_density_at(x, recovered=True) - exact
    assert np.linalg.norm(difference) < 0.01 * np.linalg.norm(exact)
