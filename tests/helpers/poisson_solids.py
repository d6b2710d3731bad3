"""Poisson's equation on tetrahedra, to be adapted: on a cube and on the Fichera corner, whose energies are known."""

import numpy as np
from skfem import Basis, ElementTetP1, ElementTetP2, condense, solve
from skfem.models.poisson import laplace, unit_load

from helpers.solids import box
from helpers.tetrahedra import fichera as octant_removed
from kohonen_adapt import Ritz
from kohonen_adapt.estimators import residual

ODD = np.ix_(*[np.arange(1.0, 201.0, 2.0)] * 3)  # of the Fourier series
CUBE = float(np.sum(512.0 / np.pi**8 / ((ODD[0] * ODD[1] * ODD[2]) ** 2 * sum(n**2 for n in ODD))))
FICHERA = 2.0 * 0.1989845  # to 1e-6: elements of orders 5 to 7 on graded hexahedra, extrapolated


class Poisson:
    """-div grad u = 1 and u = 0 all around, or on the boundaries named so.

    A solution is the values of the unknowns. `energy` is int |grad u|^2 of the exact one.
    """

    def __init__(self, energy=CUBE, order=1, norm="energy", given=None):
        self.energy, self.order, self.norm, self.given = energy, order, norm, given
        self.solves = 0

    def solve(self, mesh):
        self.solves += 1
        basis = self._basis(mesh)
        fixed = basis.get_dofs(self.given or mesh.boundary_facets())
        return solve(*condense(laplace.assemble(basis), unit_load.assemble(basis), D=fixed))

    def indicators(self, mesh, solution):
        ones = np.ones(mesh.nelements)
        return residual(mesh, solution[: mesh.nvertices], ones, source=ones)

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(unit_load.assemble(self._basis(mesh)) @ solution))

    def error(self, step):
        """In the energy norm, of a pass: the solution is the best function there is."""
        return float(np.sqrt(self.energy - step.energy_norm**2))

    def _basis(self, mesh):
        return Basis(mesh, (ElementTetP1(), ElementTetP2())[self.order - 1])


class Minimised(Poisson):
    """The same problem, which states what its solution minimises."""

    def ritz(self, mesh, solution):
        fixed = self._basis(mesh).get_dofs(self.given or mesh.boundary_facets()).flatten()
        is_fixed = np.isin(np.arange(len(solution)), fixed)
        return Ritz(solution, is_fixed, 1.0, source=1.0, flux=0.0, order=self.order)


def fichera(n=3):
    """(-1, 1)^3 without the octant where all is positive, in so many cubes per unit, faces at the corner named."""
    return octant_removed(n).with_boundaries({"corner": lambda x: np.all(x > -1e-9, axis=0)})


def cube(n=5):
    """The unit cube in two halves, its floor named."""
    mesh = box(n).with_boundaries({"floor": lambda x: x[2] == 0.0})
    return mesh.with_subdomains({"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5})
