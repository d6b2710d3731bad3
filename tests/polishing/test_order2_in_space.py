"""Polish of tetrahedra at order 2: the functional, its certificate, and what a polish keeps."""

import numpy as np
import pytest
from helpers.diffusion_solids import NonlinearQuadratic, QuadraticDiffusion
from helpers.solids import halved_cube

from kohonen_adapt import Rules
from kohonen_adapt.geometry.space.movable_solid import MovableSolid
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
