"""Accuracy of the solutions that estimates by neighbouring orders take."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from helpers.magnet_solids import blocks

from kohonen_adapt.magnetostatics import MagneticScalarPotential, Material
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.magnetostatics.equations.system import Solver
from kohonen_adapt.magnetostatics.error_by_orders import indicators_beside_edges

MATERIALS = {"iron": Material(500.0), "air": Material()}
BAR = {"iron": ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))}


@dataclass(frozen=True)
class Recording(Solver):
    """A solver by stars on every mesh that lists the residuals it is asked for."""

    large: int = 0
    asked: list = field(default_factory=list)

    def solve(self, matrix, right, subspaces=None):
        self.asked.append(self.rtol)
        return super().solve(matrix, right, subspaces)


@pytest.fixture
def mesh():
    return blocks([np.linspace(-1.0, 1.0, 5)] * 3, BAR)


@pytest.mark.parametrize("order", [3, 4])
def test_solutions_for_differences_are_rough_and_estimates_are_the_same(mesh, order):
    problem = MagneticScalarPotential(MATERIALS, {"z-": 0.0, "z+": 1.0}, order=order)
    solved, edges, solver = problem.solve(mesh), problem.singular_edges(mesh, problem.solve(mesh)), Recording()

    def energies(each):
        return replace(problem, order=each).functional_on(mesh)[0]

    given = solved.unknown, order, mesh, energies
    found = indicators_beside_edges(*given, Newton(solver=solver), edges)
    assert set(solver.asked) == {1e-3}
    exact = indicators_beside_edges(*given, Newton(solver=Solver(large=10**9)), edges)
    assert np.linalg.norm(found - exact) < 1e-3 * np.linalg.norm(exact)
