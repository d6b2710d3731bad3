"""Surfaces that are known by projections only, as loops know them: the nearest sample, and the paraboloid there."""

import numpy as np
import pytest
from helpers.solids import ball, cut
from scipy.spatial import cKDTree

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron.arrays import PROJECTED
from kohonen_adapt.kernels.tetrahedron.surfaces import nearest_sample, signed_distance


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


def test_the_nearest_sample_is_found():
    samples, search = from_mesh(4).surfaces.samples, interpreted(nearest_sample)
    points = np.vstack([near_rim(200, 0.3), near_rim(20, 0.9), samples.point[::50]])
    rows = [search(samples, 0, tuple(x)) for x in points]
    found = np.linalg.norm(points - samples.point[rows], axis=1)
    assert np.array_equal(
        found, np.linalg.norm(points - samples.point[cKDTree(samples.point).query(points)[1]], axis=1)
    )


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


def test_normals_of_a_sheet_look_to_one_side():
    mesh = cut()
    (name,) = mesh.boundaries
    facet = np.asarray(mesh.boundaries[name])
    across = np.ptp(mesh.p[:, mesh.facets[:, facet]].reshape(3, -1), axis=1) < 1e-12
    plane = ka.Plane(mesh.p[:, mesh.facets[0, facet[0]]], across.astype(float))
    solid = MovableSolid.of(mesh, Rules(surfaces={name: Projection(plane)}))
    (p,) = np.flatnonzero(solid.surfaces.shape == PROJECTED)
    samples = solid.surfaces.samples
    own = slice(samples.start[p], samples.start[p + 1])
    assert own.stop > own.start and len(samples.point) == own.stop - own.start
    assert np.abs(samples.normal[own] @ across) == pytest.approx(1.0)
    assert np.ptp(samples.normal[own], axis=0) == pytest.approx(0.0)
