"""Problems of `diffusion_solids` by scikit-fem's `ElementTetP2`, and their functional the slow way."""

import numpy as np
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTetP2, LinearForm, condense
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from helpers.diffusion_solids import Diffusion

PAIRS = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
NEAR, FAR = 0.1381966011250105, 0.5854101966249685  # coordinates of four points, exact for degree 2


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


def functional(position, node, local, constants):
    """int c/2 |grad u|^2 - f u - g . grad u by four points, element by element.

    `local` (m, 10) are the coefficients of L_i and of 4 L_i L_j, `constants` (m, 5) are c, f and g.
    """
    total = 0.0
    for corners, u, (c, f, *g) in zip(position[node], local, constants, strict=True):
        hats = np.linalg.inv(np.column_stack([np.ones(4), corners]))[1:].T
        volume = np.linalg.det(corners[1:] - corners[0]) / 6.0
        for k in range(4):
            at = np.full(4, NEAR)
            at[k] = FAR
            slope, value = u[:4] @ hats, u[:4] @ at
            for mode, (i, j) in zip(u[4:], PAIRS, strict=True):
                slope = slope + 4.0 * mode * (at[i] * hats[j] + at[j] * hats[i])
                value += 4.0 * mode * at[i] * at[j]
            total += 0.25 * volume * (0.5 * c * slope @ slope - f * value - g @ slope)
    return total
