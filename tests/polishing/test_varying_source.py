"""A source that varies inside regions is polished at orders 1 to 3, and judged by the function itself."""

from functools import cache

import numpy as np
import pytest
from helpers.scalar_problems import Gaussians
from skfem import MeshTri

import kohonen_adapt as ka

PROBLEM = Gaussians(np.array([[0.3, 0.4], [0.8, 0.7]]), np.array([0.15, 0.3]))
LINE = np.linspace(0.0, 1.0, 14)
SQUARE = MeshTri.init_tensor(LINE, LINE).with_boundaries({"right": lambda x: x[0] == 1.0})


def of_order(order):
    return Gaussians(PROBLEM.centres, PROBLEM.widths, order, "right")


@cache
def exact():
    return of_order(3).energy(SQUARE.refined(2), 3)


def error(problem, mesh):
    return np.sqrt(max(0.0, exact() - problem.energy(mesh, problem.order)))


@pytest.mark.parametrize("order", [1, 2, 3])
def test_adapt_recycles_nodes_by_it_and_compares_passes(order):
    problem = of_order(order)
    result = ka.adapt(SQUARE, problem, passes=2)
    assert result.error is None and not any(step.unpolished for step in result.history)
    assert all(step.polish_gain > 0.0 for step in result.history[1:])
    assert result.best.functional == min(step.functional for step in result.history)
    assert error(problem, result.mesh) < 0.8 * error(problem, SQUARE)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (lambda x, region: np.ones((2, x.shape[1])), r"^source of Ritz must have shape \(n,\) = "),
        (
            lambda x, region: np.where(x[0] > 0.5, np.nan, 1.0),
            r"^source of Ritz must be finite; it is not at \d+ of \d+ points",
        ),
    ],
)
def test_functions_that_return_something_else(source, message):
    class Wrong(Gaussians):
        def ritz(self, mesh, solution):
            return ka.Ritz(solution, self.fixed(self.basis(mesh, 1)), 1.0, source)

    with pytest.raises(ValueError, match=message):
        ka.polish(SQUARE, Wrong(PROBLEM.centres, PROBLEM.widths))
