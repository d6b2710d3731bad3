"""`adapt` for orders above 3: passes of order 2, layers at corners, and a result of the order."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.curved_meshes import curved_annulus
from helpers.devices import two_magnets
from helpers.exact_fields import RECTANGLE, rectangle_mesh, sheet_field, smooth_field, smooth_potential, true_error
from helpers.meshes import square
from helpers.round_magnet import CENTRED_CURVES, CENTRED_SQUARED_NORM, crowded_magnet_mesh, magnet_problem
from helpers.scalar_problems import Scalar
from numpy.testing import assert_array_equal
from skfem import MeshTri

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Force, Magnetostatics, Material
from kohonen_adapt.mesh.measures import area


def problem_of(order, **more):
    return Magnetostatics(RECTANGLE.materials, RECTANGLE.potential, order=order, **more)


def test_the_result_has_the_order_and_layers_and_its_error_is_told():
    mesh = rectangle_mesh(1)
    before = mesh.p.copy()
    result = ka.adapt(mesh, problem_of(5), passes=1, rtol=0.01)
    assert result.status is ka.Status.CONVERGED
    assert result.solution.order == 5 and result.best is result.history[-1] and len(result.history) == 3
    assert result.mesh.nvertices > mesh.nvertices and result.nodes.shape == (result.mesh.nvertices,)
    assert 0.9 < result.estimate / true_error(result.solution, sheet_field) < 1.2
    assert "Solved with order 5 on 2 layers at 4 corners" in result.message
    assert_array_equal(mesh.p, before)


def test_a_missed_tolerance_is_no_convergence():
    result = ka.adapt(rectangle_mesh(1), problem_of(4), passes=1, rtol=1e-6)
    assert result.status is ka.Status.MAX_PASSES and result.solution.order == 4


def test_the_callback_that_stops_the_passes_leaves_their_result():
    result = ka.adapt(rectangle_mesh(1), problem_of(4), passes=3, callback=lambda step: True)
    assert result.status is ka.Status.STOPPED and result.solution.order == 2


def test_the_error_of_a_force_is_told():
    mesh, problem = two_magnets(1)
    exact = ka.adapt(mesh, replace(problem, order=7), passes=1).solution.force("a")[0]
    result = ka.adapt(mesh, replace(problem, order=4, goal=Force("a", (1, 0))), passes=1)
    error = exact - result.best.goal
    assert abs(error) < 1e-6 * abs(exact)
    assert result.best.goal_error == pytest.approx(error, rel=0.1)
    assert "8 corners" in result.message


def test_smooth_fields_get_no_layers():
    mesh = square(4).with_subdomains({"air": lambda x: x[0] > -1})
    mesh = mesh.with_boundaries({"rim": lambda x: x[0] > -1}, boundaries_only=True)
    result = ka.adapt(mesh, Magnetostatics({"air": Material()}, {"rim": smooth_potential}, order=6), passes=1)
    assert result.best is result.history[-1] and "layers at" not in result.message
    assert true_error(result.solution, smooth_field) < 1e-5 * np.sqrt(result.solution.squared_norm)


class Poisson(Scalar):
    """-lap u = 1 by scikit-fem's elements of order 1 to 4, with the order in the solution."""

    orders, energy_norm = (1, 4), None

    def __init__(self, order):
        super().__init__(order, source=1.0)

    def solve(self, mesh, order=None):
        return order or self.order, self.solved(mesh, order or self.order)

    def indicators(self, mesh, solution):
        return np.sqrt(area(mesh)) / solution[0] ** 2

    def ritz(self, mesh, solution):
        order, u = solution
        return ka.Ritz(u, self.fixed(self.basis(mesh, order)), 1.0, 1.0, order=order)


def test_a_problem_of_ones_own_with_orders():
    problem = Poisson(4)
    result = ka.adapt(MeshTri.init_lshaped().refined(3), problem, passes=1)
    order, u = result.solution
    assert order == 4 and "2 layers at 1 corner," in result.message
    assert u @ problem.matrix(problem.basis(result.mesh, 4)) @ u == pytest.approx(0.2140758, abs=2e-5)


def test_a_problem_may_have_orders_above_those_of_the_package():
    class Spectral(Poisson):
        orders = (1, 12)

        def solve(self, mesh, order=None):
            return super().solve(mesh, min(order or self.order, 4))

    result = ka.adapt(MeshTri.init_lshaped().refined(2), Spectral(9), passes=1)
    assert result.best.order == 9 and "Solved with order 9 on 4 layers at 1 corner," in result.message


def test_corners_at_coarse_curves_lose_their_layers_and_not_the_order():
    mesh = curved_annulus(9)
    spoke = mesh.boundaries["spoke"]
    materials = {"core": Material(1000.0, remanence=(0.3, 0.0)), "shell": Material()}
    problem = Magnetostatics(materials, {"outer": 0.0}, order=5)
    result = ka.adapt(mesh, problem, passes=1)
    assert spoke.size and result.solution.order == 5, result.message


@pytest.mark.parametrize("close", [1.15, 1.1])
def test_sides_on_curves_stay_there_where_others_are_close(close):
    problem = magnet_problem(6)
    result = ka.adapt(crowded_magnet_mesh(close), problem, passes=0, curves=CENTRED_CURVES)
    lacking = np.sqrt(1.0 - result.solution.squared_norm / CENTRED_SQUARED_NORM)
    assert lacking < 1e-3 and "off their curves" not in result.message
    norm = problem.energy_norm(result.mesh, result.solution)
    assert result.estimate / norm == pytest.approx(lacking, rel=0.1)
