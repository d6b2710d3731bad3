"""Problems of `diffusion_solids` by scikit-fem's `ElementTetP2`, and their functional the slow way."""

from dataclasses import replace

import numpy as np
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTetP2, LinearForm, condense
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from helpers.diffusion_solids import Diffusion, Rising

PAIRS = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]


class QuadraticDiffusion(Diffusion):
    """-div(c grad u - g) = f with constants by region, linear, of order 2. A solution is the values at the unknowns."""

    order = 2

    @classmethod
    def random(cls, seed):
        problem = super().random(seed)
        problem.laws = ()
        return problem

    def basis(self, mesh):
        return Basis(mesh, ElementTetP2(), intorder=4)

    def ends(self, mesh):
        basis = self.basis(mesh)
        values, fixed = np.zeros(basis.N), np.zeros(basis.N, dtype=bool)
        for name, value in self.given.items():
            rows = basis.get_dofs(name).flatten()
            values[rows], fixed[rows] = value(basis.doflocs[:, rows]), True
        return values, fixed

    def system(self, mesh):
        number = self.number(mesh)
        c, f, g = self.coefficient[number][:, None], self.source[number][:, None], self.flux[:, number][..., None]
        stiffness = BilinearForm(lambda u, v, w: c * dot(grad(u), grad(v))).assemble(self.basis(mesh))
        return stiffness, LinearForm(lambda v, w: f * v + dot(g, grad(v))).assemble(self.basis(mesh))

    def solve(self, mesh):
        stiffness, load = self.system(mesh)
        values, fixed = self.ends(mesh)
        matrix, right, u, free = condense(stiffness, load, x=values, D=np.flatnonzero(fixed))
        u[free] = spsolve(matrix.tocsc(), right)
        return u

    def ritz(self, mesh, solution):
        constants = {"coefficient": self.coefficient, "source": self.source, "flux": self.flux}
        return ka.Ritz(solution, self.ends(mesh)[1], **constants, region=self.number(mesh), order=2)


class Knee:
    """H = scale (b + 10 b^3 / (1 + (b / 2)^2)): the slope rises from 1 to 41 at b = 2."""

    def __init__(self, scale=1.0):
        self.scale = scale

    def field_strength(self, b):
        return self.scale * (b + 10.0 * b**3 / (1.0 + 0.25 * b**2))

    def energy(self, b):
        square = 0.25 * b**2
        return self.scale * (0.5 * b**2 + 80.0 * (square - np.log1p(square)))


class NonlinearQuadratic(QuadraticDiffusion):
    """Laws W(|grad u - s|) in the regions that have one, with the shift s; solved by Newton's method."""

    @classmethod
    def random(cls, seed):
        problem, rng = super().random(seed), np.random.default_rng(seed)
        problem.laws = [(None, Rising()), (Rising(3.0), Rising()), (Knee(), None), (Knee(0.1), Rising())][seed % 4]
        problem.shift = rng.normal(size=(3, 2)) * rng.choice([0.0, 1.0])
        return problem

    def basis(self, mesh):
        return Basis(mesh, ElementTetP2(), intorder=8)

    def ritz(self, mesh, solution):
        return replace(super().ritz(mesh, solution), laws=self.laws, shift=self.shift)

    def solve(self, mesh):
        return Diffusion.solve(self, mesh)

    def equations(self, mesh, u):
        """First and second derivatives of the functional."""
        basis, number = self.basis(mesh), self.number(mesh)
        slope = np.asarray(basis.interpolate(u).grad)
        field, tensor = np.zeros_like(slope), np.zeros((3, *slope.shape))
        for k, law in enumerate(self.laws):
            rows, one = number == k, np.eye(3)[..., None, None]
            if law is None:
                field[:, rows], tensor[:, :, rows] = self.coefficient[k] * slope[:, rows], self.coefficient[k] * one
                continue
            r = slope[:, rows] - self.shift[:, k, None, None]
            b = np.maximum(np.linalg.norm(r, axis=0), 1e-8)
            secant, tangent = (
                law.field_strength(b) / b,
                (law.field_strength(b * (1.0 + 1e-6)) - law.field_strength(b)) / (1e-6 * b),
            )
            field[:, rows] = secant * r
            tensor[:, :, rows] = secant * one + (tangent - secant) / b**2 * r[:, None] * r[None]
        f, g = self.source[number][:, None], self.flux[:, number][..., None]
        load = LinearForm(lambda v, w: dot(field - g, grad(v)) - f * v).assemble(basis)
        second = BilinearForm(lambda u, v, w: np.einsum("i...,ij...,j...", grad(u), tensor, grad(v)))
        return load, second.assemble(basis)
