"""`polish` of tetrahedra: the error never grows, shapes and names stay, and so do given values."""

import numpy as np
import pytest
from helpers.descents import descent_of
from helpers.diffusion_solids import Diffusion
from helpers.poisson_solids import fichera
from helpers.quadratic_solids import QuadraticDiffusion
from helpers.solids import ball, halved_cube
from numpy.testing import assert_allclose, assert_array_equal

import kohonen_adapt as ka
from kohonen_adapt import Ritz, Rules
from kohonen_adapt.geometry.movable import unchanged
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.polishing.polish import descend_and_recycle
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional
from kohonen_adapt.problem.functional_value import functional_value


def cube(cells=(4, 3, 3), seed=None):
    return halved_cube(cells, 0, seed)


def least(mesh, problem):
    """The functional of the solution."""
    return functional_value(mesh, problem.ritz(mesh, problem.solve(mesh)))


def test_a_plan_of_one_number_keeps_all_nodes():
    mesh, problem = cube(seed=3), Diffusion.random(3)
    movable = MovableSolid.of(mesh, Rules())
    functional = SolidFunctional.of(problem.ritz(mesh, problem.solve(mesh)), movable, mesh)
    start = unchanged(movable.tetrahedralization)
    recycled, gain = descend_and_recycle(descent_of(movable, functional), (3,))
    assert gain > 0.0 and recycled.splits == 0
    assert_array_equal(recycled.old, start.old)
    assert_array_equal(recycled.start_element, start.start_element)


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


@pytest.mark.parametrize("kind", [Diffusion, QuadraticDiffusion])
def test_nodes_with_linear_given_values_slide_and_others_stay(kind):
    mesh = halved_cube((4, 4, 4), 0)
    on, moved = mesh.p[0] == 0.0, []
    for value in (lambda x: x[1] - 2.0 * x[2], lambda x: x[1] * x[2]):
        problem = kind([1.0, 5.0], [3.0, -2.0], np.zeros((3, 2)), {"side0": value})
        moved.append(np.any(ka.polish(mesh, problem, topology="fixed").p != mesh.p, axis=0))
    assert moved[0][on].sum() >= 9 and not moved[1][on].any() and moved[1].any()


def test_nodes_slide_on_curved_surfaces():
    mesh = ball(6)
    mesh = mesh.with_boundaries({"rim": mesh.boundary_facets()})
    problem = Diffusion([1.0], [1.0], np.zeros((3, 1)), {"rim": lambda x: 0.0 * x[0]})
    after, rim = ka.polish(mesh, problem, topology="fixed"), mesh.boundary_nodes()
    assert np.abs(after.p - mesh.p)[:, rim].max() > 1e-3
    assert_allclose(np.linalg.norm(after.p[:, rim], axis=0), 1.0, rtol=1e-12)
    assert least(after, problem) < least(mesh, problem)


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
