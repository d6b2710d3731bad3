"""The loop on real problems: what holds for every result."""

from functools import cache

import numpy as np
import pytest
from skfem import Basis, ElementTriP1, MeshTri, condense, solve
from skfem.models.poisson import laplace

from kohonen_adapt import Status, adapt, interpolate
from kohonen_adapt.estimators import residual


class Corner:
    """Laplace on an L (the upper right quadrant is missing) with the singular solution r^(2/3) sin(2 theta / 3)."""

    def __init__(self, norm="energy"):
        self.norm = norm
        self.solves = 0

    def solve(self, mesh):
        self.solves += 1
        matrix, edge = laplace.assemble(Basis(mesh, ElementTriP1())), mesh.boundary_nodes()
        return solve(*condense(matrix, x=singular(mesh.p), D=edge))

    def indicators(self, mesh, solution):
        return residual(mesh, solution, np.ones(mesh.t.shape[1]))

    def energy_norm(self, mesh, solution):
        return np.sqrt(solution @ laplace.assemble(Basis(mesh, ElementTriP1())) @ solution)


def singular(x):
    theta = np.arctan2(x[0] - x[1], -x[0] - x[1]) + 0.75 * np.pi
    return np.hypot(*x) ** (2 / 3) * np.sin(2 / 3 * theta)


class Warm(Corner):
    """Carries every solution to the next mesh and notes how near it is to the one that is then solved for."""

    def __init__(self):
        super().__init__()
        self.distances = []

    def solve_from(self, mesh, old_mesh, old_solution):
        solution = self.solve(mesh)
        carried = interpolate(old_mesh, old_solution, mesh.p)
        self.distances.append(np.abs(carried - solution).max() / solution.max())
        return solution


def named_l_shape():
    mesh = MeshTri.init_lshaped().refined(3)
    mesh = mesh.with_boundaries({"left": lambda x: x[0] == -1.0, "top": lambda x: x[1] == 1.0})
    return mesh.with_subdomains({"core": lambda x: (np.abs(x[0]) < 0.5) & (np.abs(x[1]) < 0.5)})


@cache
def adapted(seed=0, topology=None):
    return adapt(named_l_shape(), Corner(), passes=3, seed=seed, topology=topology)


def test_the_error_falls_at_a_constant_number_of_nodes():
    result = adapted()
    first = result.history[0]
    assert result.estimate < 0.8 * first.estimate
    assert result.estimate == min(step.estimate for step in result.history)
    assert {step.mesh.p.shape[1] for step in result.history} == {first.mesh.p.shape[1]}
    assert result.status in (Status.MAX_PASSES, Status.STALLED)
    assert result.solution.shape == (first.mesh.p.shape[1],)


def test_the_same_seed_gives_the_same_mesh_bit_for_bit():
    again = adapt(named_l_shape(), Corner(), passes=3)
    np.testing.assert_array_equal(again.mesh.p, adapted().mesh.p)
    np.testing.assert_array_equal(again.mesh.t, adapted().mesh.t)
    assert not np.array_equal(adapted(seed=1).mesh.p, adapted().mesh.p)


def test_the_history_tells_of_the_map():
    first, *rest = adapted().history
    assert first.quantization_errors == ()
    for step in rest:
        assert all(0.0 < distance < 1.0 for distance in step.quantization_errors)
        assert len(step.quantization_errors) > 0
        assert 0.0 < step.max_displacement < 2.0


def test_a_solution_carried_to_the_new_mesh_is_a_warm_start():
    problem = Warm()
    adapt(named_l_shape(), problem, passes=2)
    assert len(problem.distances) == 2
    assert max(problem.distances) < 0.1


def indicators(mesh):
    problem = Corner()
    return problem.indicators(mesh, problem.solve(mesh))


@pytest.mark.parametrize("topology", ["fixed", "flip"])
def test_nothing_moves_where_everything_is_pinned(topology):
    mesh = named_l_shape()
    result = adapt(mesh, Corner(), pinned=np.arange(mesh.p.shape[1]), topology=topology)
    assert result.status is Status.NOT_MOVED
    assert result.message.startswith("No node moved: ")
    np.testing.assert_array_equal(result.mesh.p, mesh.p)


@pytest.mark.parametrize(
    ("mesh", "arguments"),
    [
        (MeshTri().refined(2), {"pinned": ("nowhere",)}),
        (MeshTri().refined(2), {"topology": "sideways"}),
        (MeshTri().refined(2), {"min_quality": 2.0}),
        (MeshTri().refined(2), {"schedule": "fast"}),
        (MeshTri(np.array([[0.0, 1.0, np.nan], [0.0, 0.0, 1.0]]), np.array([[0], [1], [2]])), {}),
    ],
)
def test_what_the_map_refuses_is_refused_before_anything_is_solved(mesh, arguments):
    problem = Corner()
    with pytest.raises(ValueError):
        adapt(mesh, problem, **arguments)
    assert problem.solves == 0
