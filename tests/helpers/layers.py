"""A circular layer on the unit square as a problem of a user of scikit-fem."""

import numpy as np
import skfem
from skfem import BilinearForm, ElementTriP1, LinearForm
from skfem.helpers import dot, grad

import kohonen_adapt as ka

RADIUS = 0.25


@BilinearForm
def stiffness(u, v, _):
    return dot(grad(u), grad(v))


@LinearForm
def load(v, w):
    return source(w.x, w.steepness) * v


def distance(x):
    return np.hypot(x[0] - 0.5, x[1] - 0.5)


def source(x, steepness):
    r = np.maximum(distance(x), 1e-9)
    value, decay = np.tanh(steepness * (r - RADIUS)), np.cosh(steepness * (r - RADIUS)) ** -2
    return 2.0 * steepness**2 * decay * value - steepness * decay / r


class Layer:
    """-div grad u = f with u = tanh(steepness (r - 1/4)), 1 on the boundary up to rounding."""

    calibrated = True

    def __init__(self, steepness):
        self.steepness = steepness

    def solve(self, mesh):
        basis = skfem.Basis(mesh, ElementTriP1(), intorder=6)
        fixed, values = mesh.boundary_nodes(), np.zeros(mesh.nvertices)
        values[fixed] = 1.0
        right = load.assemble(basis, steepness=self.steepness)
        return skfem.solve(*skfem.condense(stiffness.assemble(basis), right, x=values, D=fixed))

    def indicators(self, mesh, solution):
        centres = mesh.p[:, mesh.t].mean(axis=1)
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements), source=source(centres, self.steepness))

    def energy_norm(self, mesh, solution):
        return float(np.sqrt(solution @ stiffness.assemble(skfem.Basis(mesh, ElementTriP1())) @ solution))


class LayerWithFunctional(Layer):
    def ritz(self, mesh, solution):
        fixed = np.isin(np.arange(mesh.nvertices), mesh.boundary_nodes())
        return ka.Ritz(solution, fixed, 1.0, lambda x, region: source(x, self.steepness))


def error_of(problem, mesh):
    """Return the error of the gradient in the L2 norm."""
    basis = skfem.Basis(mesh, ElementTriP1(), intorder=8)
    x = np.asarray(basis.global_coordinates())
    r = distance(x)
    slope = problem.steepness * np.cosh(problem.steepness * (r - RADIUS)) ** -2
    exact = slope * np.stack([x[0] - 0.5, x[1] - 0.5]) / np.maximum(r, 1e-9)
    return float(np.sqrt(np.sum(np.sum((basis.interpolate(problem.solve(mesh)).grad - exact) ** 2, axis=0) * basis.dx)))
