"""The problems of `solids` with elements of order 1 to 6, for `adapt` with an order that follows the tolerance."""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.quadratic_solids import Quadratic
from benchmarks.problems.solids import TABLES, Box, Solid
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.magnetostatics.equations.system import IN_SPACE
from kohonen_adapt.magnetostatics.error_by_orders import indicators_beside_edges
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.singular_edges import singular_edges
from kohonen_adapt.problem.energy import Densities, Energy
from kohonen_adapt.problem.protocol import AutoOrder
from kohonen_adapt.problem.singular_nodes import materials_of

METHOD = Newton(solver=IN_SPACE)
SCALE = 1.0 / 5.5  # error over residual at order 2

# Iron beside air at edges, with a source all over; its energy by order 6 on a layer, extrapolated, to 1e-5.
BLOCK = Solid(
    "I",
    Box((-1, -1, -1), (1, 1, 1)),
    lambda x: np.abs(np.abs(x[0]) - 1.0) < 1e-9,
    -1.25801266,
    iron=Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)),
)


class Solved(NamedTuple):
    energy: Energy
    u: np.ndarray


@dataclass(frozen=True)
class ByOrder:
    """A `Solid` with a constant source, and zero where u is given."""

    solid: Solid
    order: int = AutoOrder(2)
    orders = (1, 6)
    calibrated = True

    def energy(self, mesh: MeshTet, order: int) -> Energy:
        """The functional of an order."""
        space = Space(mesh, order)
        fixed = np.zeros(space.doflocs.shape[1], dtype=bool)
        fixed[space.on_facets(np.asarray(mesh.boundaries["given"])).ravel()] = True
        nu, flux = (table[..., self.solid.regions(mesh)] for table in TABLES)
        load = space.loads(np.full(mesh.nelements, self.solid.source), flux[:, space.element])
        densities = Densities(space.gradient_weights, nu if order == 1 else nu[space.element])
        return Energy(space, densities, load, Conditions(fixed, np.zeros(fixed.size), np.flatnonzero(~fixed)))

    def solve(self, mesh: MeshTet, order: int | None = None) -> Solved:
        """The functional and the solution."""
        energy = self.energy(mesh, order or self.order)
        return Solved(energy, METHOD.linear(energy))

    def indicators(self, mesh: MeshTet, solution: Solved) -> np.ndarray:
        """By residuals at order 2, and by lower orders above, or by one more if no edge is singular."""
        u, order = solution.u, solution.energy.space.order
        if order <= 2:
            return SCALE * Quadratic(self.solid).indicators(mesh, u)
        return indicators_beside_edges(u, order, mesh, partial(self.energy, mesh), METHOD, self.singular_edges(mesh))

    def singular_edges(self, mesh: MeshTet, solution: object = None) -> tuple[np.ndarray, np.ndarray]:
        """The edges and corners at which the solution is singular."""
        zeros = np.zeros(mesh.nvertices)
        fixed = np.isin(np.arange(mesh.nvertices), mesh.facets[:, mesh.boundaries["given"]])
        given = {"source": self.solid.source, "flux": TABLES[1], "region": self.solid.regions(mesh)}
        return singular_edges(mesh, materials_of(mesh, ka.Ritz(zeros, fixed, TABLES[0], **given)))

    def energy_norm(self, mesh: MeshTet, solution: Solved) -> float:
        """Square root of the load times the solution."""
        return float(np.sqrt(solution.energy.load @ solution.u))

    def ritz(self, mesh: MeshTet, solution: Solved) -> ka.Ritz:
        """The functional that the solution minimises at order 2."""
        if solution.energy.space.order != 2:
            raise ka.NotOffered("its order is not 2")
        return Quadratic(self.solid).ritz(mesh, solution.u)

    def error(self, solution: Solved) -> float:
        """Of a solution, in % of the energy norm."""
        value, _ = solution.energy.value(solution.u)
        return 100.0 * float(np.sqrt(max(0.0, 1.0 - value / self.solid.energy)))
