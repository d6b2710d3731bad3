"""Defaults of optional attributes of problems, and problems at one of their orders."""

import numpy as np
import pytest
from skfem import MeshTri

from kohonen_adapt import NotOffered
from kohonen_adapt.problem.protocol import AutoOrder, CheckedProblem


class Bare:
    def solve(self, mesh):
        return "solved"

    def indicators(self, mesh, solution):
        return np.ones(mesh.nelements)


class OfOrders(Bare):
    orders, order, curved, pairs = (1, 8), AutoOrder(2), True, None

    def solve(self, mesh, order=None):
        return order

    def solve_from(self, mesh, old_mesh, old_solution, order=None):
        return old_solution, order


def test_a_problem_without_attributes_has_the_defaults():
    problem = CheckedProblem(Bare())
    found = [getattr(problem, name) for name in ("order", "orders", "norm", "calibrated", "curved", "goal_unit")]
    assert found == [1, None, "energy", False, None, ""]
    assert (problem.pairs, problem.nodes_on(MeshTri()), problem.is_curved, problem.has_goal) == ((), [], None, False)
    assert problem.solve(MeshTri(), MeshTri(), "old") == "solved"
    assert not problem.final_orders(True) and problem.at_grading_order is problem


def test_missing_methods_are_not_offered_and_other_names_are_those_of_the_problem():
    problem = CheckedProblem(Bare())
    with pytest.raises(NotOffered, match=r"^Bare has no method ritz\(mesh, solution\)$"):
        problem.optional("ritz")
    with pytest.raises(AttributeError):
        _ = problem.axisymmetric
    assert problem.indicators(MeshTri(), None).shape == (2,)


def test_passes_have_a_lower_order_than_the_result():
    problem = CheckedProblem(OfOrders())
    assert (list(problem.final_orders(True)), problem.final_orders(False)) == ([4, 5, 6, 7, 8], range(0))
    passes = problem.at_grading_order
    assert (passes.order, passes.solve(MeshTri()), passes.solve(MeshTri(), MeshTri(), "old")) == (2, 2, ("old", 2))
    assert not passes.takes_order and CheckedProblem(passes).order == 2 and passes.is_curved
    assert CheckedProblem(OfOrders(), 1).is_curved is False
    assert problem.pairs == ()
