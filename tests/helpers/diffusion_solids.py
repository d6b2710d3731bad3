"""-div(c grad u - g) = f on tetrahedra: constants and laws by region, given values on named boundaries."""

import numpy as np
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTetP1, ElementTetP2, LinearForm
from skfem.helpers import dot, grad

import kohonen_adapt as ka

PAIRS = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]


class Rising:
    """H = scale (b + b^3)."""

    def __init__(self, scale=1.0):
        self.scale = scale

    def field_strength(self, b):
        return self.scale * (b + b**3)

    def energy(self, b):
        return self.scale * (b**2 / 2 + b**4 / 4)


class Knee(Rising):
    """H = scale (b + 10 b^3 / (1 + (b / 2)^2)): the slope rises from 1 to 41 at b = 2."""

    def field_strength(self, b):
        return self.scale * (b + 10.0 * b**3 / (1.0 + 0.25 * b**2))

    def energy(self, b):
        square = 0.25 * b**2
        return self.scale * (0.5 * b**2 + 80.0 * (square - np.log1p(square)))


class Diffusion:
    """Constants and laws by subdomain, in the order of the mesh's; `given` has functions of points by boundary.

    A region with a law has W(|grad u - s|) with the shift s. A solution is the values at the unknowns.
    """

    order = 1

    def __init__(self, coefficient, source, flux, given, laws=()):
        self.coefficient, self.source, self.flux = (np.asarray(a, dtype=float) for a in (coefficient, source, flux))
        self.given, self.laws = given, laws
        self.shift = np.zeros((3, len(laws)))

    @classmethod
    def random(cls, seed):
        """Of two subdomains, given on some sides of the unit cube by functions that are linear there."""
        rng = np.random.default_rng(seed)
        slope, sides = rng.normal(size=3), rng.permutation(6)[: rng.integers(1, 7)]
        load = rng.choice([0.0, 1.0, 10.0])
        names = [f"side{k}" for k in sides]
        given = dict.fromkeys(names, lambda x: slope @ x)
        if len(names) == 2 and sides[0] // 2 == sides[1] // 2:  # opposite sides may have functions that differ
            given[names[1]] = lambda x: 2.0 - slope[::-1] @ x
        laws = [(), (None, Rising()), (Rising(3.0), Rising())][rng.integers(3)]
        return cls(
            10.0 ** rng.uniform(-1, 1, 2), load * rng.normal(size=2), load * rng.normal(size=(3, 2)), given, laws
        )

    def indicators(self, mesh, solution):
        return np.ones(mesh.nelements)

    def number(self, mesh):
        number = np.zeros(mesh.nelements, dtype=int)
        for k, rows in enumerate((mesh.subdomains or {}).values()):
            number[rows] = k
        return number

    def basis(self, mesh):
        if self.order == 1:
            return Basis(mesh, ElementTetP1(), intorder=1)
        return Basis(mesh, ElementTetP2(), intorder=8 if any(self.laws) else 4)

    def ends(self, mesh):
        """Given values, and where they are."""
        basis = self.basis(mesh)
        values, fixed = np.zeros(basis.N), np.zeros(basis.N, dtype=bool)
        for name, value in self.given.items():
            rows = basis.get_dofs(name).flatten()
            values[rows], fixed[rows] = value(basis.doflocs[:, rows]), True
        return values, fixed

    def ritz(self, mesh, solution):
        constants = {"coefficient": self.coefficient, "source": self.source, "flux": self.flux}
        rest = {"region": self.number(mesh), "laws": self.laws, "order": self.order}
        return ka.Ritz(solution, self.ends(mesh)[1], **constants, **rest, shift=self.shift if any(self.laws) else 0.0)

    def solve(self, mesh):
        """Newton's method, which a linear problem needs one step of; steps are halved until the residual falls."""
        values, fixed = self.ends(mesh)
        residual, matrix = self.equations(mesh, values)
        free = ~fixed
        for _ in range(60):
            step = np.zeros_like(values)
            step[free] = spsolve(matrix[free][:, free].tocsc(), -residual[free])
            size, share = np.linalg.norm(residual[free]), 1.0
            while share > 1e-3:
                after, matrix = self.equations(mesh, values + share * step)
                if np.linalg.norm(after[free]) < size:
                    break
                share *= 0.5
            if not np.linalg.norm(after[free]) < size:
                break
            values, residual = values + share * step, after
            if not any(self.laws):
                break
        return values

    def equations(self, mesh, u):
        """Derivatives of the functional by the values at all unknowns, first and second."""
        basis, number = self.basis(mesh), self.number(mesh)
        one = np.eye(3)[..., None, None]
        slope = np.asarray(basis.interpolate(u).grad)
        field, tensor = np.zeros_like(slope), np.zeros((3, *slope.shape))
        for k, coefficient in enumerate(self.coefficient):
            rows, law = number == k, self.laws[k] if self.laws else None
            if law is None:
                field[:, rows], tensor[:, :, rows] = coefficient * slope[:, rows], coefficient * one
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


class QuadraticDiffusion(Diffusion):
    """Of order 2."""

    order = 2

    @classmethod
    def random(cls, seed):
        """Without laws."""
        problem = super().random(seed)
        problem.laws = ()
        return problem


class NonlinearQuadratic(QuadraticDiffusion):
    """Of order 2 with laws and a shift."""

    @classmethod
    def random(cls, seed):
        problem, rng = super().random(seed), np.random.default_rng(seed)
        problem.laws = [(None, Rising()), (Rising(3.0), Rising()), (Knee(), None), (Knee(0.1), Rising())][seed % 4]
        problem.shift = rng.normal(size=(3, 2)) * rng.choice([0.0, 1.0])
        return problem
