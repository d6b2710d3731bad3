"""Surfaces that are known by projections only, as loops know them: the nearest sample, and the paraboloid there."""

import numpy as np
from helpers.solids import ball

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron.surfaces import signed_distance


class Projection:
    """A surface of which nothing is known but how points are projected on it."""

    def __init__(self, surface):
        self.project = surface.project


def from_mesh(cells):
    """A ball of radius 1 by the projections on its rim."""
    mesh = ball(cells)
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()})
    return MovableSolid.of(mesh, Rules(surfaces={"rim": Projection(ka.Sphere((0.0, 0.0, 0.0), 1.0))}))


def near_rim(count, reach, seed=0):
    """Points no farther than that from the sphere, (count, 3)."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(count, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True) * (1.0 + rng.uniform(-reach, reach, (count, 1)))


def test_distances_are_of_third_order_and_their_gradients_of_second():
    lengths, gradients = [], []
    for cells in (3, 6, 12):
        solid, x = from_mesh(cells), near_rim(100, 0.1 / cells)
        distance = interpreted(signed_distance)
        found = np.array([np.hstack(distance(solid.surfaces, 0, tuple(row))) for row in x])
        radius = np.linalg.norm(x, axis=1)
        lengths.append(np.abs(found[:, 0] - (radius - 1.0)).max())
        gradients.append(np.abs(found[:, 1:] - x / radius[:, None]).max())  # outward all of them
    assert np.log2(lengths[0] / lengths[2]) / 2 > 2.7 and lengths[2] < 1e-4
    assert np.log2(gradients[0] / gradients[2]) / 2 > 1.8
