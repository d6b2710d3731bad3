"""Star lists and what is averaged over them, filled in pieces as threads do, against slow twins."""

import numpy as np
import pytest
from helpers.meshes import areas_of, generic_square, inset, junction, perturbed
from numpy.testing import assert_array_equal

from kohonen_adapt.kernels.triangle.arrays import Star
from kohonen_adapt.kernels.triangle.geometry import fill_star, find_starts
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.som.training_points import ElementDensity

MESHES = {
    "generic": lambda: generic_square(6),
    "regions": lambda: perturbed(inset(8), 1),
    "junction": lambda: perturbed(junction(6), 2),
}


@pytest.fixture(params=MESHES.values(), ids=MESHES)
def tri(request):
    return Triangulation.of(request.param())


def pieces(tri):
    n = tri.nnodes
    return ((0, n // 3), (n // 3, n // 2), (n // 2, n))


def test_stars_list_the_elements_around_every_node_in_order(tri):
    node, cursor = tri.elements.node, np.empty(tri.nnodes, dtype=np.int32)
    star = Star(*(np.full_like(array, -1) for array in tri.star))
    find_starts(node, star.start)
    assert_array_equal(np.diff(star.start), np.bincount(node.ravel()))
    for first, last in pieces(tri):
        fill_star(node, star, first, last, cursor)
    for v in range(tri.nnodes):
        e, k = np.nonzero(node == v)
        rows = slice(star.start[v], star.start[v + 1])
        assert_array_equal(star.element[rows], e)
        assert_array_equal(star.ahead[rows], node[e, (k + 1) % 3])
        assert_array_equal(star.behind[rows], node[e, (k + 2) % 3])
    for mine, theirs in zip(star, tri.star, strict=True):
        assert_array_equal(mine, theirs)


def test_densities_are_averaged_by_area_around_every_node_region_by_region(tri):
    elements, area = tri.elements, areas_of(tri)
    density = np.random.default_rng(0).random(len(area)) + 0.1
    found = ElementDensity(tri, density)._logs
    for e, k in np.ndindex(*found.shape):
        around = np.any(elements.node == elements.node[e, k], axis=1) & (elements.region == elements.region[e])
        mean = np.sum((area * density)[around]) / np.sum(area[around]) / density.max()
        assert found[e, k] == pytest.approx(np.log(mean), rel=1e-12, abs=1e-12)
