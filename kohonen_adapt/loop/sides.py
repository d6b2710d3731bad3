"""Solutions on exact sides, and errors with the share of flattened sides.

The polish flattens sides on curves, because its elements must be far from folded. Estimates on the mesh do not include
these sides.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.mesh.blended import is_folded
from kohonen_adapt.mesh.curved import inverted_elements
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.problem.evaluation import functional_of_solution
from kohonen_adapt.problem.protocol import CheckedProblem

PARABOLIC = 3  # order whose parabolas cut off more than its elements miss
NEARLY_EXACT = 0.03  # relative determinant of elements that exact sides would fold
LEAST_JACOBIANS = 0.003, 0.01, 0.03, 0.05, 0.07, 0.1  # of elements, relative to straight ones, in order of trial


@dataclass(frozen=True, eq=False)
class Sides:
    problem: CheckedProblem
    mesh: Mesh
    solution: Any
    curved: MovableMesh | None = None  # the movable mesh if sides are curved

    @cached_property
    def exact(self) -> tuple[Mesh, Any]:
        # the mesh and the solution themselves if no side is flattened
        if self.curved is None or not self.curved.flattened(self.mesh):
            return self.mesh, self.solution
        exact = self.curved.mesh_with_free_sides()
        if inverted_elements(exact).size:
            exact = self.curved.mesh(NEARLY_EXACT)
        return exact, self._solved(self.problem, exact)

    def error_with_sides(self, error: float, curves: Curves | None) -> float:
        # The functional exceeds its minimum by half the squared error, and rises by sides off their curves. Parabolas
        # are off at all orders, by a share of the error that rises with the order. Exact curves are for orders above 3.
        problem, order = self.problem, self.problem.order
        if self.curved and order == PARABOLIC and problem.takes_order and problem.has("on_curves"):
            exact = on_whole_curves(self.mesh, self.curved)
            problem = CheckedProblem(problem.on_curves(curves or {}), PARABOLIC + 1)
            solution = self._solved(problem, exact)
        else:
            exact, solution = self.exact
        if solution is self.solution:
            return error
        change = functional_of_solution(problem, exact, solution)
        change -= functional_of_solution(self.problem, self.mesh, self.solution)
        difference = float(np.sqrt(2.0 * abs(change)))
        return max(error, difference) if problem.order > order else float(np.hypot(error, difference))

    def _solved(self, problem: CheckedProblem, exact: Mesh) -> Any:
        number_facets(exact)
        return problem.solve(exact, self.mesh, self.solution)


def on_whole_curves(flattened: Mesh, movable: MovableMesh) -> Mesh:
    # Higher orders have smaller errors than flattened sides.
    trials = chain([movable.mesh_with_free_sides()], map(movable.mesh, LEAST_JACOBIANS))
    return next((mesh for mesh in trials if not is_folded(mesh)), flattened)
