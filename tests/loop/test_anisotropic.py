"""Adaptation with a metric: directions of a layer, of a problem's own metric, and of nothing."""

import numpy as np
import pytest
from helpers.layer import Layer
from helpers.meshes import l_shape
from helpers.scalar_problems import Corner
from numpy.testing import assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka


class Plain(Layer):
    """The problem without its functional."""

    ritz = None


def median_error(problem, seeds=(0,), **arguments):
    results = [ka.adapt(MeshTri().refined(4), problem, seed=seed, passes=3, **arguments) for seed in seeds]
    return np.median([problem.error(result.mesh) for result in results])


@pytest.mark.parametrize(("kind", "most"), [(Plain, 0.85), (Layer, 0.95)])
def test_elements_along_a_layer_have_a_smaller_error(kind, most):
    problem = kind(60.0)
    assert median_error(problem) < most * median_error(problem, anisotropic=False)


def test_directions_that_promise_little_are_left_out():
    mesh, problem = l_shape(8), Corner()  # singular, with curvatures that are equal and opposite
    found = {choice: ka.adapt(mesh, problem, passes=2, anisotropic=choice).mesh for choice in ("auto", True, False)}
    assert_array_equal(found["auto"].p, found[False].p)
    assert not np.array_equal(found[True].p, found[False].p)


class Own(Plain):
    """A problem with a metric of its own, the same everywhere."""

    def __init__(self, *eigenvalues):
        super().__init__(30.0)
        self.eigenvalues = eigenvalues

    def metric(self, mesh, solution):
        return np.tile(np.diag(self.eigenvalues), (mesh.nelements, 1, 1))


def test_a_problem_may_have_a_metric_of_its_own_which_is_checked():
    moved = ka.adapt(MeshTri().refined(4), Own(64.0, 1.0), passes=1).history[1].mesh
    extent = np.ptp(moved.p[:, moved.t], axis=1).mean(axis=1)
    assert extent[1] > 3.0 * extent[0]
    result = ka.adapt(MeshTri().refined(3), Own(1.0, -1.0), passes=2)
    assert result.status is ka.Status.FAILED
    assert "metric of the problem must be positive definite" in str(result.error)


class Wrapped(Plain):
    """A problem whose solutions are no arrays."""

    def solve(self, mesh):
        return {"values": super().solve(mesh)}

    def indicators(self, mesh, solution):
        return super().indicators(mesh, solution["values"])

    def energy_norm(self, mesh, solution):
        return super().energy_norm(mesh, solution["values"])


def test_solutions_without_known_values_have_round_elements():
    mesh, problem = MeshTri().refined(4), Wrapped(30.0)
    wrapped = ka.adapt(mesh, problem, passes=2)
    plain = ka.adapt(mesh, Plain(30.0), passes=2, anisotropic=False)
    assert_array_equal(wrapped.mesh.p, plain.mesh.p)
    forced = ka.adapt(mesh, problem, passes=2, anisotropic=True)
    assert forced.status is ka.Status.FAILED
    assert "anisotropic=True needs" in str(forced.error)
