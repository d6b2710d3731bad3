"""Lengths, qualities, swaps and winners in a metric are those of the mesh that the metric makes round."""

import numpy as np
import pytest
from helpers.boxes import jittered, opened, qualities, random_shapes, swaps
from helpers.solids import box
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.kernels.arrays import Metric, SearchScratch
from kohonen_adapt.kernels.numba.compilation import interpreted
from kohonen_adapt.kernels.tetrahedron import metric as metric_kernels
from kohonen_adapt.kernels.tetrahedron.locate import find_winners
from kohonen_adapt.kernels.tetrahedron.surgery import prepare_split, split
from kohonen_adapt.kernels.vectors import mapped
from kohonen_adapt.mesh.shapes import packed, unpacked

both_of_element, cholesky, effective_quality, squared_length = (
    interpreted(getattr(metric_kernels, name))
    for name in ("both_of_element", "cholesky", "effective_quality", "squared_length")
)
mapped = interpreted(mapped)


def same_everywhere(rows, ratio, seed):
    """A shape for all nodes, and the linear map that makes this metric round."""
    turn, values = Rotation.random(random_state=seed).as_matrix(), np.array([1.0, 1.0, ratio]) / ratio ** (1 / 3)
    return np.tile(packed(((turn * values**2) @ turn.T)[None]), (rows, 1)), (turn * values) @ turn.T


@pytest.mark.parametrize("ratio", [1.0, 3.0, 50.0])
def test_quality_and_length_are_those_after_the_map(ratio):
    position, node = jittered((2, 2, 2), 0.5, 1)
    shape, stretch = same_everywhere(len(position), ratio, 3)
    found = np.array([both_of_element(position, shape, node, e) for e in range(len(node))])
    assert_allclose(found[:, 0], qualities(position, node) ** 3, rtol=1e-12)
    assert_allclose(found[:, 1], qualities(position @ stretch.T, node) ** 3, rtol=1e-9)
    lengths = [squared_length(position, Metric(shape, 1.0), a, b) for a, b in node[:, :2]]
    assert_allclose(np.sum(((position[node[:, 1]] - position[node[:, 0]]) @ stretch.T) ** 2, axis=1), lengths)


def test_the_factor_maps_to_the_metric():
    for shape in random_shapes(20, 30.0, 0):
        factor, e, f = cholesky(tuple(shape)), *np.random.default_rng(1).normal(size=(2, 3))
        assert np.dot(mapped(factor, e), mapped(factor, f)) == pytest.approx(e @ unpacked(shape[None])[0] @ f)


def test_effective_quality_is_relieved_in_the_metric_only():
    position, node = jittered((2, 2, 2), 0.5, 1)
    shape = random_shapes(len(position), 4.0, 0)
    for e in range(len(node)):
        euclidean, in_metric = both_of_element(position, shape, node, e)
        assert effective_quality(position, Metric(shape, 1.0), node, e) == pytest.approx(euclidean)
        assert effective_quality(position, Metric(shape, 2.0), node, e) == pytest.approx(min(in_metric, 8 * euclidean))


@pytest.mark.parametrize("seed", range(3))
def test_swaps_are_those_of_the_round_mesh(seed):
    position, node = jittered((4, 4, 4), 0.7, seed)
    shape, stretch = same_everywhere(len(position) + 8, 3.0, seed)
    meshes = (opened(position, node)._replace(metric=Metric(shape, 10.0)), opened(position, node))
    meshes[1].position[:] = meshes[1].position @ stretch.T
    found = [swaps(mesh) for mesh in meshes]
    assert found[0] == found[1] > 50
    assert_array_equal(meshes[0].elements.node, meshes[1].elements.node)


def test_a_new_node_has_the_mean_shape_of_the_ends():
    position, node = jittered((2, 2, 2), 0.3, 1)
    shape = random_shapes(len(position) + 8, 4.0, 5)
    mesh = opened(position, node)._replace(metric=Metric(shape, 10.0))
    a, b = next((a, b) for a, b in node[:, :2] if interpreted(prepare_split)(mesh, a, b, 0.0) > 0)
    p = interpreted(split)(mesh, a, b, interpreted(prepare_split)(mesh, a, b, 0.0))
    found, mean = unpacked(shape[[p]])[0], 0.5 * unpacked(shape[[a, b]]).sum(axis=0)
    assert np.linalg.det(found) == pytest.approx(1.0)
    assert_allclose(found * np.cbrt(np.linalg.det(mean)), mean)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 5.0])
def test_the_winner_is_nearest_in_the_metric(ratio):
    solid, rng = MovableSolid.of(box(4), Rules()), np.random.default_rng(2)
    tet = solid.tetrahedralization
    shape, stretch = same_everywhere(200, ratio, 1)
    points = rng.uniform(0.0, 1.0, (200, 3))
    region, start, winners = (np.zeros(len(points), dtype=np.int32) for _ in range(3))
    distances, scratch = np.empty(len(points)), SearchScratch.of(solid.nnodes, len(tet.elements.node))
    find_winners(solid.kernel_mesh(), points, shape, region, start, winners, distances, scratch)
    every = np.linalg.norm((tet.position[None] - points[:, None]) @ stretch.T, axis=2)
    assert_array_equal(winners, every.argmin(axis=1))
    assert_allclose(distances, every.min(axis=1))
