"""The loop with recycling and the polish: what it gains, how it tells the best pass, and what it says."""

import re
from functools import cache

import numpy as np
import pytest
from helpers.meshes import l_shape, on_rim
from helpers.scalar_problems import Load, Scalar, magnet, magnet_mesh
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.problem.functional_value import functional_value


class Plain(Load):
    """Without a functional."""

    ritz = None


class Saddle(Scalar):
    """Laplace with values on the boundary that no straight line follows."""

    def given(self, x):
        return x[0] ** 3 - 3 * x[0] * x[1] ** 2


class Striped(Load):
    """A functional whose coefficient changes inside the one region."""

    def ritz(self, mesh, solution):
        return ka.Ritz(solution, on_rim(mesh), (1.0, 2.0), region=np.arange(mesh.nelements) % 2)


@cache
def adapted(topology, polish=True, passes=3):
    return ka.adapt(l_shape(8), Load(), passes=passes, topology=topology, polish=polish)


def functional_of(problem, mesh):
    return functional_value(mesh, problem.ritz(mesh, problem.solve(mesh)))


TOPOLOGIES = pytest.mark.parametrize("topology", ["fixed", "flip", "recycle"])


@TOPOLOGIES
def test_the_result_is_the_pass_of_the_lowest_functional(topology):
    result = adapted(topology)
    values = [functional_of(Load(), step.mesh) for step in result.history]
    assert [step.functional for step in result.history] == pytest.approx(values, rel=1e-12)
    assert result.mesh is result.history[int(np.argmin(values))].mesh


def test_the_default_recycles_and_counts():
    result = adapted("recycle")
    same = ka.adapt(l_shape(8), Load(), passes=3)
    assert np.array_equal(same.mesh.p, result.mesh.p)
    assert all(step.splits == step.collapses for step in result.history)
    assert result.history[1].splits >= 5
    assert [step.splits for step in adapted("flip").history] == [0, 0, 0, 0]


def test_density_recycles_in_three_passes_and_energy_in_all():
    """From the fourth on the map trains on nodes that the energy alone has put where they are."""
    result = ka.adapt(magnet_mesh(20), magnet(), passes=5)
    splits = [step.splits for step in result.history]
    assert splits[1] > splits[2] > splits[3] > sum(splits[4:])
    assert all(step.quantization_errors and step.splits == step.collapses for step in result.history[1:])


def test_nodes_of_recycling_by_energy_are_counted_and_named():
    """Nothing else makes or moves a node where the last pass has no map: old ones know where they come from."""
    mesh = l_shape(8)
    result = ka.adapt(mesh, Load(), passes=1, schedule=ka.Schedule(()))
    step = result.history[1]
    kept = step.nodes >= 0
    assert 0 < np.count_nonzero(~kept) <= step.splits == step.collapses
    assert step.polish_gain > 0.0
    way = np.sqrt(((step.mesh.p[:, kept] - mesh.p[:, step.nodes[kept]]) ** 2).sum(axis=0))
    assert step.max_displacement == pytest.approx(way.max())
    assert step.moved == np.count_nonzero(way) + np.count_nonzero(~kept)


@pytest.mark.parametrize(
    ("problem", "remark"),
    [
        (Plain(), r"No polish: Plain has no method ritz\(mesh, solution\)"),
        (Striped(), "No polish: coefficients vary inside a region of the mesh"),
        (Load(order=2), "No polish: the order of Ritz is 1, the order of the problem is 2"),
        (Load(norm="L2"), "No polish: the norm 'L2' requires `calibrated` indicators"),
        (
            Saddle(),
            r"Passes were compared by the estimate, because the polish held \d+ nodes \(Dirichlet values that are not "
            r"linear along the outer boundary\)",
        ),
    ],
)
def test_the_message_says_where_the_polish_ends(problem, remark):
    result = ka.adapt(l_shape(4), problem, passes=1)
    assert re.search(rf" to continue\. {remark}\.$", result.message)
    assert (result.history[1].functional is None) == remark.startswith("No polish")
    assert ka.adapt(l_shape(4), problem, passes=1, polish=False).message.endswith(" to continue.")


@pytest.mark.parametrize("topology", ["fixed", "flip"])
def test_without_recycling_a_mesh_that_grows_keeps_its_nodes(topology):
    mesh = l_shape(3)
    grown = ka.adapt(mesh, Load(), passes=3, target_nodes=400, topology=topology)
    assert grown.mesh.nvertices == 400 and all(step.collapses == 0 for step in grown.history)
    assert np.array_equal(np.sort(grown.nodes)[-mesh.nvertices :], np.arange(mesh.nvertices))


def test_elements_too_thin_to_be_halved_do_not_stop_growth():
    thin = MeshTri.init_tensor(np.linspace(0, 1, 4), np.linspace(0, 0.2, 13))
    result = ka.adapt(thin, Load(), passes=2, target_nodes=208)
    assert result.mesh.nvertices == 208
    assert result.best.min_quality >= min(0.02, result.history[0].min_quality)


def test_growth_from_a_mesh_in_which_nothing_can_move():
    result = ka.adapt(MeshTri(), Load(), target_nodes=50, passes=4)
    assert result.history[-1].mesh.nvertices == 50


def test_the_message_says_where_growth_ends():
    thin = MeshTri(np.array([[0.0, 4.0, 0.0], [0.0, 0.0, 0.75]]), np.array([[0, 1, 2]]).T)
    result = ka.adapt(thin, Load(), passes=1, target_nodes=208)
    assert "The mesh has 3 of 208 nodes" in result.message
    stopped = ka.adapt(l_shape(4), Load(), target_nodes=500, callback=lambda step: True)
    assert stopped.message.startswith("Stopped by the callback") and "500" not in stopped.message


def test_values_given_on_an_edge_that_turn_out_not_to_be_linear():
    """The input has no node on the left side but its ends: only new ones see the bump there."""

    class Bump(Scalar):
        def given(self, x):
            return np.where(x[0] == 0.0, x[1] * (1 - x[1]), 0.0)

    result = ka.adapt(MeshTri(), Bump(source=1.0), passes=4, target_nodes=300)
    assert result.mesh.nvertices == 300
    text = r"because the polish held \d+ nodes? \(Dirichlet values that are not linear along .*\)\.$"
    assert re.search(f" compared by the estimate, {text}", result.message)


def test_the_functional_is_asked_for_once_on_every_mesh_with_its_own_solution():
    class Noted(Load):
        asked = ()

        def solve(self, mesh):
            self.last = super().solve(mesh)
            return self.last

        def ritz(self, mesh, solution):
            assert solution is self.last
            self.asked = (*self.asked, mesh)
            return super().ritz(mesh, solution)

    problem = Noted()
    result = ka.adapt(l_shape(4), problem, passes=2)
    assert [mesh is step.mesh for mesh, step in zip(problem.asked, result.history, strict=True)] == [True] * 3
