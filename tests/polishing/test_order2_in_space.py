"""Polish of tetrahedra at order 2: the functional, its certificate, and what a polish keeps."""

import numpy as np
import pytest
from helpers.descents import descent_of
from helpers.diffusion_solids import NonlinearQuadratic, QuadraticDiffusion
from helpers.poisson_solids import fichera
from helpers.solids import halved_cube

import kohonen_adapt as ka
from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.polishing.space.solid_functional import SolidFunctional


def cube(cells=(3, 3, 2), seed=None):
    return halved_cube(cells, 2, seed)


@pytest.mark.parametrize(("kind", "seed"), [(QuadraticDiffusion, 0), (QuadraticDiffusion, 1), (NonlinearQuadratic, 1)])
def test_a_solution_is_stationary_and_others_are_refused(kind, seed):
    mesh, problem = cube(seed=seed), kind.random(seed)
    solution, movable = problem.solve(mesh), MovableSolid.of(mesh, Rules())
    SolidFunctional.of_solution(problem.ritz(mesh, solution), movable, mesh)
    free = np.flatnonzero(~problem.ends(mesh)[1])
    for row in (free[0], free[-1]):  # a node, and an edge
        wrong = solution.copy()
        wrong[row] += 0.5 * np.ptp(solution) + 1.0
        with pytest.raises(ValueError, match=r"not stationary for its Ritz: at \("):
            SolidFunctional.of_solution(problem.ritz(mesh, wrong), movable, mesh)


def corner_problem(source=1.0):
    mesh = fichera(3).with_subdomains({"low": lambda x: x[2] < 0.0})
    problem = QuadraticDiffusion([1.0, 1.0], [source] * 2, np.zeros((3, 2)), {"rim": lambda x: 0.0 * x[0]})
    return mesh.with_boundaries({"rim": mesh.boundary_facets()}), problem


def test_adapt_polishes_order_2_and_keeps_the_number_of_unknowns():
    mesh, problem = corner_problem()
    result = ka.adapt(mesh, problem, passes=2)
    exact, first, last = -0.1989845, result.history[0], result.best
    assert all(step.unpolished == "" and step.comparable for step in result.history)
    assert abs(last.unknowns - first.unknowns) < 0.1 * first.unknowns
    errors = [np.sqrt(2.0 * (step.functional - exact)) for step in (first, last)]
    assert errors[1] < 0.5 * errors[0]
    assert "further splits" not in result.message


def test_the_price_of_a_sample_is_near_the_price_of_all_nodes():
    mesh, problem = cube((13, 13, 12), 1), QuadraticDiffusion.random(1)
    solid = MovableSolid.of(mesh, Rules())
    descent = descent_of(solid, SolidFunctional.of(problem.ritz(mesh, np.zeros(count_unknowns(mesh, 2))), solid, mesh))
    of_sample = descent.charge()
    descent.weigh(np.arange(mesh.nvertices))
    assert of_sample != descent.charge() and of_sample == pytest.approx(descent.charge(), rel=0.2)
