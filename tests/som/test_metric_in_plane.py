"""Relocation of triangles to a metric: shapes, bits of round metrics, names, and winners."""

import numpy as np
import pytest
from helpers.examples import examples
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.shapes import density_and_shape, unpacked
from kohonen_adapt.som.training import Trainer
from kohonen_adapt.som.training_points import Draw

HALVES = {"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5}
MESH = MeshTri().refined(4).with_subdomains(HALVES).with_boundaries({"floor": lambda x: x[1] == 0.0})


def turned(ratio, angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn @ np.diag([ratio**2, 1.0]) @ turn.T


def everywhere(mesh, tensor):
    return np.tile(tensor, (mesh.nelements, 1, 1))


def in_metric(mesh, tensor):
    return MeshTri(np.linalg.cholesky(tensor).T @ mesh.p, mesh.t)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.1])
@pytest.mark.parametrize("ratio", [2.0, 8.0])
def test_elements_are_regular_in_a_constant_metric(ratio, angle):
    tensor = turned(ratio, angle)
    qualities = []
    for seed in range(3):
        mesh = MESH
        for _ in range(2):
            mesh = ka.relocate(mesh, everywhere(mesh, tensor), topology="recycle", seed=seed)
        qualities.append(ka.quality(in_metric(mesh, tensor)).mean())
    assert np.median(qualities) > 0.8


@examples(30)
@given(st.integers(0, 2**32 - 1))
def test_the_winner_is_the_nearest_node_in_the_metric_of_the_point(seed):
    rng = np.random.default_rng(seed)
    movable = MovableMesh.of(MeshTri().refined(3), ka.Rules("fixed"))
    trainer, count = Trainer.of(movable), 40
    points = rng.uniform(0.35, 0.65, (count, 2))  # far from the boundary, behind which no ellipse hides a node
    tensors = np.stack([turned(rng.uniform(1.0, 3.0), angle) for angle in rng.uniform(0.0, np.pi, count)])
    shape = density_and_shape(tensors)[1]
    region, start = np.zeros(count, dtype=np.int32), rng.integers(0, movable.nnodes, count).astype(np.int32)
    found, distances = trainer.search(Draw(points, region, region, np.ones(count), shape), start)
    offset = movable.triangulation.position[None] - points[:, None]
    squared = np.einsum("tni,tij,tnj->tn", offset, unpacked(shape), offset)
    assert_allclose(distances, np.sqrt(squared.min(axis=1)), rtol=1e-12)
    assert_allclose(squared[np.arange(count), found], squared.min(axis=1), rtol=1e-12)


def test_a_function_may_return_tensors():
    def tensors(x):
        return np.tile(turned(5.0, 0.7), (x.shape[1], 1, 1)) * (1.0 + x[0])[:, None, None]

    mesh = ka.relocate(MESH, tensors, topology="recycle")
    assert ka.quality(in_metric(mesh, turned(5.0, 0.7))).mean() > 0.8
