"""`polish` of tetrahedra: the error never grows, shapes and names stay, and so do given values."""

import numpy as np
import pytest
from helpers.diffusion_solids import Diffusion, QuadraticDiffusion
from helpers.poisson_solids import fichera
from helpers.solids import halved_cube

import kohonen_adapt as ka
from kohonen_adapt import Ritz
from kohonen_adapt.problem.functional_value import functional_value


def cube(cells=(4, 3, 3), seed=None):
    return halved_cube(cells, 0, seed)


def least(mesh, problem):
    """The functional of the solution."""
    return functional_value(mesh, problem.ritz(mesh, problem.solve(mesh)))


@pytest.mark.parametrize(("kind", "most"), [(Diffusion, 0.85), (QuadraticDiffusion, 0.7)])
def test_polish_lowers_the_error_at_the_corner_of_fichera(kind, most):
    mesh = fichera(3)
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()})
    problem = kind([1.0], [1.0], np.zeros((3, 1)), {"rim": lambda x: 0.0 * x[0]})
    after, fixed = (ka.polish(mesh, problem, topology=topology) for topology in ("flip", "fixed"))
    exact = -0.1989845
    errors = [np.sqrt(2.0 * (least(each, problem) - exact)) for each in (mesh, after, fixed)]
    assert errors[1] < most * errors[0] and errors[2] < errors[0]
    assert np.all(after.p[:, after.facets[:, after.boundaries["corner"]]] > -1e-12)


class Stated(Diffusion):
    """A functional that is stated in another way."""

    def __init__(self, **stated):
        super().__init__([1.0, 1.0], [1.0, 1.0], np.zeros((3, 2)), {"side0": lambda x: 0.0 * x[0]})
        self.stated = stated

    def ritz(self, mesh, solution):
        return Ritz(solution, self.ends(mesh)[1], 1.0, **self.stated)


@pytest.mark.parametrize("stated, reason", [({"robin": {"side1": (1.0, 0.0)}}, "robin"), ({"source": 1.0}, "")])
def test_adapt_goes_on_without_a_polish_and_says_why(stated, reason):
    result = ka.adapt(cube((2, 2, 2)), Stated(**stated), passes=1)
    assert all(reason in step.unpolished and bool(reason) == bool(step.unpolished) for step in result.history)
