"""`adapt` told the error: the number of nodes and the order follow the tolerance."""

import numpy as np
import pytest
from helpers.devices import two_magnets
from helpers.exact_fields import RECTANGLE, rectangle_mesh
from helpers.meshes import l_shape
from helpers.scalar_problems import Corner
from helpers.solids import box
from helpers.stand_ins import MESH, Script, adapt
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.display import by_error
from kohonen_adapt.magnetostatics import FluxDensityAt, Force, MagneticScalarPotential, Magnetostatics, Material
from kohonen_adapt.problem.protocol import AutoOrder


def magnets(**more):
    """Two magnets of a size, and their problem with these options."""
    mesh, problem = two_magnets(1)
    return mesh, Magnetostatics(problem.materials, problem.potential, **more)


def magnet(**more):
    return Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, **more)


@pytest.mark.parametrize(
    ("order", "rtol"),
    [(1, 0.05), (2, 0.01), ("auto", 3e-3), pytest.param("auto", 3e-4, marks=pytest.mark.slow)],
)
def test_a_tolerance_is_met_and_told(order, rtol):
    mesh, problem = magnets(order=order)
    result = ka.adapt(mesh, problem, rtol=rtol)
    assert result.status is ka.Status.CONVERGED
    assert result.estimate <= rtol * result.best.energy_norm
    exact = magnets(order=8 if order == "auto" else 4)[1].solve(
        ka.refined_at(result.mesh, problem.singular_nodes(result.mesh, result.solution), layers=4)
    )
    x = np.random.default_rng(0).uniform([[-0.02], [-0.015]], [[0.02], [0.015]], (2, 4000))
    difference = result.solution.flux_density_at(x) - exact.flux_density_at(x)
    assert np.linalg.norm(difference) < 1.5 * rtol * np.linalg.norm(exact.flux_density_at(x))


def test_a_fine_mesh_gives_nodes_away():
    mesh = rectangle_mesh(6)
    result = ka.adapt(mesh, magnet(order=2), rtol=0.01)
    assert result.status is ka.Status.CONVERGED
    assert ka.adapt(mesh, magnet(order=2), passes=0).estimate > result.best.energy_norm * 0.01
    assert result.mesh.nvertices < 0.5 * mesh.nvertices


@pytest.mark.parametrize("rtol", [0.06, 0.04])
def test_tetrahedra_of_order_2_grow_no_more_than_the_tolerance_asks(rtol):
    def inside(x):
        return np.all(np.abs(x - 0.5) < 0.26, axis=0)

    mesh = box(4).with_subdomains({"magnet": inside, "air": lambda x: ~inside(x)})
    mesh = mesh.with_boundaries({"outer": mesh.boundary_facets()})
    materials = {"magnet": Material(1.05, remanence=(0.0, 0.0, 1.0)), "air": Material()}
    problem = MagneticScalarPotential(materials, {"outer": 0.0}, order=2)
    result = ka.adapt(mesh, problem, rtol=rtol)
    assert result.status is ka.Status.CONVERGED
    assert 0.6 * rtol < result.estimate / result.best.energy_norm <= rtol


@pytest.mark.parametrize("topology", ["flip", "fixed"])
def test_without_recycling_the_mesh_only_grows(topology):
    result = ka.adapt(l_shape(4), Corner(), rtol=0.08, topology=topology)
    nodes = [step.mesh.nvertices for step in result.history]
    assert nodes == sorted(nodes) and nodes[-1] > nodes[0]


def test_the_largest_number_of_nodes_ends_the_run():
    result = ka.adapt(l_shape(4), Corner(), rtol=1e-4, max_nodes=300)
    assert result.status is ka.Status.MAX_NODES
    assert result.mesh.nvertices <= 300
    assert "(`max_nodes` 300)" in result.message and "times smaller: increase `max_nodes`" in result.message


FORCE = -129.20757  # N/m, by orders 7 and 8 on different meshes


@pytest.mark.parametrize(
    ("order", "tolerance"),
    [(2, 2e-3), ("auto", 1e-3), pytest.param("auto", 1e-6, marks=pytest.mark.slow)],
)
def test_the_error_of_an_output_is_told(order, tolerance):
    mesh, problem = magnets(order=order)
    outputs = {"force": lambda field: float(field.force("a")[0]), "calm": lambda field: 1.0}
    result = ka.adapt(mesh, problem, outputs=outputs, output_rtol={"force": tolerance})
    assert result.status is ka.Status.CONVERGED
    force = result.outputs["force"]
    assert abs(force.value - FORCE) <= 1.25 * tolerance * abs(FORCE)
    assert abs(force.corrected - FORCE) < 0.5 * tolerance * abs(FORCE)
    assert result.outputs["calm"].value == 1.0
    assert (
        f"force {by_error(force.value, force.error)}, estimated error" in result.message and "(asked" in result.message
    )


def test_the_error_of_a_goal_is_told():
    mesh, problem = magnets(goal=Force("a", (1, 0)), order="auto")
    result = ka.adapt(mesh, problem, goal_rtol=1e-4)
    assert result.status is ka.Status.CONVERGED
    assert abs(result.outputs["goal"].value - FORCE) <= 1e-4 * abs(FORCE)
    assert "goal -129." in result.message and "(asked 0.01 %)" in result.message


def test_an_output_beside_a_goal_has_another_name():
    mesh, problem = magnets(goal=Force("a", (1, 0)))
    with pytest.raises(ValueError, match="outputs must not have the name 'goal' beside a goal of the problem"):
        ka.adapt(mesh, problem, outputs={"goal": problem.goal}, passes=0)
    assert "goal" in ka.adapt(mesh, problem, outputs={"force": problem.goal}, passes=0).outputs


def test_a_goal_that_is_zero_by_symmetry_asks_for_atol():
    problem = magnet(goal=Force("magnet", (1, 0)), order=1)
    result = ka.adapt(rectangle_mesh(1), problem, goal_rtol=1e-3)
    assert result.status is ka.Status.STALLED
    assert "Give atol instead, the root of the allowed error." in result.message


@pytest.mark.slow
def test_an_output_that_is_zero_by_symmetry_asks_for_a_mapping():
    mesh, problem = rectangle_mesh(1), magnet(order="auto")
    outputs = {"across": Force("magnet", (1, 0)), "at": FluxDensityAt((0.0, 0.0), (0, 1), 0.001)}
    result = ka.adapt(mesh, problem, outputs=outputs, output_rtol=1e-3)
    assert result.status is ka.Status.STALLED and result.best.order == 2
    assert "the estimated errors of 'across' remain as large as the values" in result.message
    assert result.mesh.nvertices < 5000
    named = ka.adapt(mesh, problem, outputs=outputs, output_rtol={"at": 1e-2})
    assert named.status is ka.Status.CONVERGED


class Aimed(Script):
    """A goal whose error falls while the estimate rises, as where errors of both signs cancelled."""

    def goal(self, solution):
        return 1.0

    def goal_error(self, solution):
        return [0.5, 0.4, 0.1, 0.1][solution]


def test_the_pass_that_meets_the_tolerance_is_the_result():
    result = adapt(MESH, Aimed([1.0, 1.1, 1.2, 1.3]), goal_rtol=0.2, passes=3)
    assert result.status is ka.Status.CONVERGED and result.best is result.history[2]
    assert abs(result.outputs["goal"].error) <= 0.2
    assert "Best: pass 2" in result.message


class Raising(Aimed):
    """The same, of an order that follows the tolerance."""

    order, orders = AutoOrder(2), (1, 8)

    def solve(self, mesh, order=2):
        assert order == 2
        return super().solve(mesh)


def test_no_higher_order_follows_a_pass_that_meets_the_tolerance():
    result = adapt(MESH, Raising([1.0, 1.1]), goal_rtol=0.45, max_nodes=26)
    assert result.status is ka.Status.CONVERGED and result.best is result.history[1]
    assert result.best.order == 2 and abs(result.outputs["goal"].error) <= 0.45


class Changing:
    """Indicators that have nothing to do with one another from pass to pass."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)

    def solve(self, mesh):
        return None

    def indicators(self, mesh, solution):
        size = self.random.uniform(1.8, 3.6)
        return size * self.random.uniform(0.0, 1.0, mesh.nelements) ** 4 / np.sqrt(mesh.nelements)


@pytest.mark.parametrize("seed", [31, 106, 158, 165, 0])
def test_the_result_of_a_converged_run_meets_its_tolerance(seed):
    result = ka.adapt(MeshTri().refined(3), Changing(seed), atol=0.9, passes=3)
    assert result.status is not ka.Status.CONVERGED or result.estimate <= 0.9
