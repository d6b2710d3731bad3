"""A problem whose solution changes in a layer around a circle."""

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, LinearForm, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from helpers.meshes import on_rim

__all__ = ["Insulation", "Layer"]

laplace = BilinearForm(lambda u, v, w: dot(grad(u), grad(v)))
mass = BilinearForm(lambda u, v, w: u * v)


class Layer:
    """-lap u = f for u = tanh(k (r - 1/4)) around `centre`, u = 1 on the boundary, by a rule of degree `rule`.

    With `by_flux` the divergence of the flux grad u is the source.
    """

    calibrated = True

    def __init__(self, k, centre=(0.5, 0.5), rule=8, reaction=0.0, by_flux=False):
        self.k, self.centre, self.rule, self.reaction, self.by_flux = k, centre, rule, reaction, by_flux

    def slope(self, x, region=None):
        offset = x - np.reshape(self.centre, (2,) + (1,) * (np.ndim(x) - 1))
        r = np.maximum(np.hypot(*offset), 1e-9)
        return self.k / np.cosh(np.minimum(self.k * abs(r - 0.25), 300.0)) ** 2 * offset / r

    def source(self, x, region=None):
        r = np.maximum(np.hypot(x[0] - self.centre[0], x[1] - self.centre[1]), 1e-9)
        across = 1.0 / np.cosh(np.minimum(self.k * abs(r - 0.25), 300.0)) ** 2
        return 2.0 * self.k**2 * across * np.tanh(self.k * (r - 0.25)) - self.k * across / r

    def solve(self, mesh):
        basis = Basis(mesh, ElementTriP1(), intorder=self.rule)
        matrix = laplace.assemble(basis) + self.reaction * mass.assemble(basis)
        by_source, by_flux = lambda v, w: self.source(w.x) * v, lambda v, w: dot(self.slope(w.x), grad(v))
        right, rim = LinearForm(by_flux if self.by_flux else by_source).assemble(basis), mesh.boundary_nodes()
        return solve(*condense(matrix, right, x=np.ones(mesh.nvertices), D=rim))

    def indicators(self, mesh, solution):
        middle = mesh.p[:, mesh.t].mean(axis=1)
        data = {"flux": self.slope(middle)} if self.by_flux else {"source": self.source(middle)}
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements), **data)

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(solution @ laplace.assemble(Basis(mesh, ElementTriP1())) @ solution))

    def ritz(self, mesh, solution):
        fixed = on_rim(mesh)
        return ka.Ritz(solution, fixed, 1.0, **{"flux": self.slope} if self.by_flux else {"source": self.source})

    def error(self, mesh):
        """Of the energy of the exact solution, near 8 pi k (1/4) / 3, the part that is missing, on halved elements."""
        solution = self.solve(mesh)
        for _ in range(3):
            solution, mesh = np.append(solution, solution[mesh.facets].mean(axis=0)), mesh.refined()
        basis = Basis(mesh, ElementTriP1(), intorder=4)
        slope = self.slope(np.asarray(basis.global_coordinates()))
        missing = np.sum((basis.interpolate(solution).grad - slope) ** 2, axis=0)
        return float(np.sqrt(np.sum(missing * basis.dx) / np.sum(np.sum(slope**2, axis=0) * basis.dx)))


class Insulation:
    """-div(a grad u) = 0 from u = 0 on the left to 1 on the right, with 1 / a = 1 + c k / cosh(k (x - 0.43))^2."""

    calibrated = True

    def __init__(self, k, rule=8, resistance=0.4):
        self.k, self.rule, self.resistance = k, rule, resistance

    def coefficient(self, x):
        across = np.cosh(np.minimum(self.k * abs(x[0] - 0.43), 300.0)) ** 2
        return 1.0 / (1.0 + 0.5 * self.resistance * self.k / across)

    def stiffness(self, mesh, rule):
        form = BilinearForm(lambda u, v, w: self.coefficient(w.x) * dot(grad(u), grad(v)))
        return form.assemble(Basis(mesh, ElementTriP1(), intorder=rule))

    def solve(self, mesh):
        at_ends = mesh.nodes_satisfying(lambda x: (x[0] == 0.0) | (x[0] == 1.0))
        return solve(*condense(self.stiffness(mesh, self.rule), x=mesh.p[0].copy(), D=at_ends))

    def indicators(self, mesh, solution):
        return ka.estimators.recovery(mesh, solution, self.coefficient(mesh.p[:, mesh.t].mean(axis=1)))

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(solution @ self.stiffness(mesh, self.rule) @ solution))

    def error(self, mesh):
        """Of the energy 1 / (1 + c), on halved elements."""
        solution, exact = self.solve(mesh), 1.0 / (1.0 + self.resistance)
        for _ in range(3):
            solution, mesh = np.append(solution, solution[mesh.facets].mean(axis=0)), mesh.refined()
        return float(np.sqrt(max(solution @ self.stiffness(mesh, 4) @ solution / exact - 1.0, 0.0)))
