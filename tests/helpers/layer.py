"""A problem whose solution changes in a layer around a circle."""

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, LinearForm, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka

__all__ = ["Layer"]

laplace = BilinearForm(lambda u, v, w: dot(grad(u), grad(v)))
mass = BilinearForm(lambda u, v, w: u * v)


class Layer:
    """-lap u = f for u = tanh(k (r - 1/4)) around `centre`, u = 1 on the boundary, by a rule of degree `rule`."""

    calibrated = True

    def __init__(self, k, centre=(0.5, 0.5), rule=8, reaction=0.0):
        self.k, self.centre, self.rule, self.reaction = k, centre, rule, reaction

    def source(self, x, region=None):
        r = np.maximum(np.hypot(x[0] - self.centre[0], x[1] - self.centre[1]), 1e-9)
        across = 1.0 / np.cosh(np.minimum(self.k * abs(r - 0.25), 300.0)) ** 2
        return 2.0 * self.k**2 * across * np.tanh(self.k * (r - 0.25)) - self.k * across / r

    def solve(self, mesh):
        basis = Basis(mesh, ElementTriP1(), intorder=self.rule)
        matrix = laplace.assemble(basis) + self.reaction * mass.assemble(basis)
        right, rim = LinearForm(lambda v, w: self.source(w.x) * v).assemble(basis), mesh.boundary_nodes()
        return solve(*condense(matrix, right, x=np.ones(mesh.nvertices), D=rim))

    def indicators(self, mesh, solution):
        middle = mesh.p[:, mesh.t].mean(axis=1)
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements), source=self.source(middle))

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(solution @ laplace.assemble(Basis(mesh, ElementTriP1())) @ solution))

    def ritz(self, mesh, solution):
        fixed = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
        return ka.Ritz(solution, fixed, 1.0, self.source)

    def error(self, mesh):
        """Of the energy of the exact solution, near 8 pi k (1/4) / 3, the part that is missing, on halved elements."""
        solution = self.solve(mesh)
        for _ in range(3):
            solution, mesh = np.append(solution, solution[mesh.facets].mean(axis=0)), mesh.refined()
        basis = Basis(mesh, ElementTriP1(), intorder=4)
        x = np.asarray(basis.global_coordinates())
        offset = x - np.reshape(self.centre, (2, 1, 1))
        r = np.hypot(*offset)
        slope = self.k / np.cosh(np.minimum(self.k * abs(r - 0.25), 300.0)) ** 2 * offset / r
        missing = np.sum((basis.interpolate(solution).grad - slope) ** 2, axis=0)
        return float(np.sqrt(np.sum(missing * basis.dx) / np.sum(np.sum(slope**2, axis=0) * basis.dx)))
