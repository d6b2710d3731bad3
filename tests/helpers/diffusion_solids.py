"""-div(c grad u - g) = f on tetrahedra: constants and laws by region, given values on named boundaries."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

import kohonen_adapt as ka


class Rising:
    """H = scale (b + b^3)."""

    def __init__(self, scale=1.0):
        self.scale = scale

    def field_strength(self, b):
        return self.scale * (b + b**3)

    def energy(self, b):
        return self.scale * (b**2 / 2 + b**4 / 4)


class Diffusion:
    """Constants and laws by subdomain, in the order of the mesh's; `given` has functions of points by boundary.

    A solution is the values at the nodes.
    """

    def __init__(self, coefficient, source, flux, given, laws=()):
        self.coefficient, self.source, self.flux = (np.asarray(a, dtype=float) for a in (coefficient, source, flux))
        self.given, self.laws = given, laws

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

    def ends(self, mesh):
        """Given values, and where they are."""
        values, fixed = np.zeros(mesh.nvertices), np.zeros(mesh.nvertices, dtype=bool)
        for name, value in self.given.items():
            rows = np.unique(mesh.facets[:, mesh.boundaries[name]])
            values[rows], fixed[rows] = value(mesh.p[:, rows]), True
        return values, fixed

    def ritz(self, mesh, solution):
        fixed = self.ends(mesh)[1]
        return ka.Ritz(solution, fixed, self.coefficient, self.source, self.flux, self.number(mesh), laws=self.laws)

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

    def equations(self, mesh, values):
        """Derivatives of the functional by the values at all nodes, first and second."""
        t, number = mesh.t, self.number(mesh)
        corners = mesh.p[:, t]
        edges = (corners[:, 1:] - corners[:, :1]).transpose(2, 1, 0)
        volume = np.abs(np.linalg.det(edges)) / 6.0
        hats = np.linalg.solve(edges, np.broadcast_to(np.hstack([-np.ones((3, 1)), np.eye(3)]), (len(volume), 3, 4)))
        slope = np.einsum("mdk,km->md", hats, values[t])
        tensor = self.coefficient[number][:, None, None] * np.eye(3)
        strength = self.coefficient[number][:, None] * slope
        for k, law in enumerate(self.laws):
            if law is not None:
                rows = np.flatnonzero(number == k)
                square = np.sum(slope[rows] ** 2, axis=1)
                strength[rows] = law.scale * (1.0 + square)[:, None] * slope[rows]
                tensor[rows] = law.scale * (
                    (1.0 + square)[:, None, None] * np.eye(3) + 2.0 * slope[rows][:, :, None] * slope[rows][:, None]
                )
        own = volume[:, None] * np.einsum("mdk,md->mk", hats, strength - self.flux[:, number].T)
        own -= (volume * self.source[number] / 4.0)[:, None]
        local = volume[:, None, None] * np.einsum("mdk,mde,mel->mkl", hats, tensor, hats)
        rows, columns = np.repeat(t.T, 4, axis=1), np.tile(t.T, (1, 4))
        n = mesh.nvertices
        matrix = coo_array((local.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)).tocsr()
        return np.bincount(t.T.ravel(), own.ravel(), n), matrix
