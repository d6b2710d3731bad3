"""The problems of `solids` with elements of order 2: solution, residual estimate and functional."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import cg
from skfem import Basis, BilinearForm, ElementTetP1, ElementTetP2, Functional, LinearForm, MeshTet, condense
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from benchmarks.problems.solids import TABLES, Solid, jacobi

CLOSE = 1e-9  # residual of conjugate gradients


@dataclass(frozen=True)
class Quadratic:
    """A `Solid` with a constant source, and zero where u is given, by `ElementTetP2`, as `ka.adapt` asks."""

    solid: Solid
    order = 2

    def system(self, mesh: MeshTet) -> tuple[csr_array, np.ndarray, np.ndarray]:
        """Stiffness, load, and the mask of the given values."""
        basis, nu, flux = self.constants(mesh)
        stiffness = BilinearForm(lambda u, v, w: nu * dot(grad(u), grad(v))).assemble(basis)
        return stiffness, self.load(basis, flux), self.given(basis)

    def load(self, basis: Basis, flux: np.ndarray) -> np.ndarray:
        """Source and flux against all functions."""
        return LinearForm(lambda v, w: self.solid.source * v + dot(flux, grad(v))).assemble(basis)

    def given(self, basis: Basis) -> np.ndarray:
        """Mask of the unknowns whose values are given."""
        fixed = np.zeros(basis.N, dtype=bool)
        fixed[basis.get_dofs("given").flatten()] = True
        return fixed

    def constants(self, mesh: MeshTet) -> tuple[Basis, np.ndarray, np.ndarray]:
        """The basis, and nu and flux of elements."""
        basis = Basis(mesh, ElementTetP2(), intorder=2)
        nu, flux = (table[..., self.solid.regions(mesh), None] for table in TABLES)
        return basis, nu, flux

    def solve(self, mesh: MeshTet) -> np.ndarray:
        """The solution at the unknowns."""
        return self.solve_and_count(mesh)[0]

    def solve_and_count(self, mesh: MeshTet) -> tuple[np.ndarray, int]:
        """The solution at the unknowns, and the steps of conjugate gradients with the diagonal."""
        steps = list[None]()
        stiffness, load, fixed = self.system(mesh)
        matrix, right, u, free = condense(stiffness, load, D=np.flatnonzero(fixed))
        u[free], failed = cg(
            matrix, right, rtol=CLOSE, M=jacobi(matrix), maxiter=10_000, callback=lambda _: steps.append(None)
        )
        if failed:
            raise RuntimeError(f"conjugate gradients did not come to {CLOSE:g} with {right.size} unknowns.")
        return u, len(steps)

    def error(self, mesh: MeshTet, u: np.ndarray) -> float:
        """Of a solution, in the energy norm."""
        return float(np.sqrt(max(0.0, 2.0 * (-0.5 * self.work(mesh, u) - self.solid.energy))))

    def work(self, mesh: MeshTet, u: np.ndarray) -> float:
        """The load times a solution, which is the square of its energy norm."""
        basis, _, flux = self.constants(mesh)
        return float(self.load(basis, flux) @ u)

    def indicators(self, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
        """The residual in elements and the jumps of the normal flux at corners of facets, weighted as at order 1."""
        _, nu, flux = self.constants(mesh)
        laplacian = self.laplacian(mesh, u)
        volume = Functional(lambda w: np.ones_like(w.x[0])).elemental(Basis(mesh, ElementTetP1(), intorder=1))
        squares = volume ** (5 / 3) * (self.solid.source + nu[:, 0] * laplacian) ** 2 / nu[:, 0]
        inner = np.flatnonzero(mesh.f2t[1] >= 0)
        corners = mesh.p[:, mesh.facets[:, inner]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
        area = 0.5 * np.linalg.norm(normal, axis=0)
        normal /= 2.0 * area
        jumps = np.zeros((3, len(inner)))
        for side, sign in ((0, 1.0), (1, -1.0)):
            rows = mesh.f2t[side, inner]
            slope = self.corner_slopes(mesh, u, rows, mesh.facets[:, inner])
            jumps += sign * np.einsum("dkf,df->kf", nu[rows, 0] * slope - flux[:, rows].transpose(0, 2, 1), normal)
        middle = 0.5 * (jumps + np.roll(jumps, 1, axis=0))  # linear on a facet
        first, second = mesh.f2t[:, inner]
        part = 0.5 * area**1.5 * np.mean(middle**2, axis=0) / np.maximum(nu[first, 0], nu[second, 0])
        np.add.at(squares, first, part)
        np.add.at(squares, second, part)
        return np.sqrt(squares)

    def density(self, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
        """Nodes per volume that the residual of a solution asks for."""
        return ka.density_from_indicators(mesh, self.indicators(mesh, u), order=2)

    def modes(self, mesh: MeshTet, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of 4 L_i L_j as symmetric tables (4, 4, m), and the gradients of L (3, 4, m)."""
        table = np.zeros((4, 4, mesh.nelements))
        for row, (i, j) in enumerate(mesh.elem.refdom.edges):
            own = u[mesh.nvertices + mesh.t2e[row]] - 0.5 * (u[mesh.t[i]] + u[mesh.t[j]])
            table[i, j] = table[j, i] = own
        x = mesh.p[:, mesh.t]
        rows = np.linalg.inv((x[:, 1:] - x[:, :1]).transpose(2, 0, 1)).transpose(2, 1, 0)  # (3, 3, m): d, k
        return table, np.concatenate([-rows.sum(axis=1, keepdims=True), rows], axis=1)

    def laplacian(self, mesh: MeshTet, u: np.ndarray) -> np.ndarray:
        """Of u in every element."""
        table, slope = self.modes(mesh, u)
        return 4.0 * np.einsum("ijm,dim,djm->m", table, slope, slope)

    def corner_slopes(self, mesh: MeshTet, u: np.ndarray, rows: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """Gradients of u in elements `rows` at their corners `nodes` (3, f), (3, 3, f)."""
        table, slope = self.modes(mesh, u)
        at = np.einsum("im,dim->dm", u[mesh.t], slope)[:, None] + 4.0 * np.einsum("kim,dim->dkm", table, slope)
        corner = np.argmax(mesh.t[:, rows][:, None] == nodes[None], axis=0)
        return at[:, corner, rows]

    def ritz(self, mesh: MeshTet, u: np.ndarray) -> ka.Ritz:
        """The functional that the solution minimises."""
        fixed = self.given(self.constants(mesh)[0])
        constants = {"coefficient": TABLES[0], "source": self.solid.source, "flux": TABLES[1]}
        return ka.Ritz(u, fixed, **constants, region=self.solid.regions(mesh), order=2)
