"""Problem -lap u = f with a sum of Gaussians for f, at every order."""

from dataclasses import dataclass

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementTriP2,
    ElementTriP3,
    ElementTriP4,
    LinearForm,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import dot, grad

import kohonen_adapt as ka

ELEMENTS = {1: ElementTriP1, 2: ElementTriP2, 3: ElementTriP3, 4: ElementTriP4}

laplace = BilinearForm(lambda u, v, w: dot(grad(u), grad(v)))


@dataclass
class GaussianSources:
    """-lap u = sum exp(-|x - c|^2 / s^2), u = 0 on the boundary except on the natural one.

    Attributes
    ----------
    centres, widths
        The c and s of the Gaussians, shape (k, 2) and (k,).
    order
        Degree of the elements.
    natural
        Name of the boundary on which du/dn = 0, empty for none.
    """

    centres: np.ndarray
    widths: np.ndarray
    order: int = 1
    natural: str = ""

    @classmethod
    def random(cls, rng: np.random.Generator, order: int = 1) -> "GaussianSources":
        """Return a problem with two or three Gaussians in the unit square, of widths .1 to .5."""
        count = int(rng.integers(2, 4))
        return cls(rng.random((count, 2)), rng.uniform(0.1, 0.5, count), order)

    def source(self, x: np.ndarray, region: np.ndarray | None = None) -> np.ndarray:
        """Return f at points (2, ...)."""
        pairs = zip(self.centres, self.widths, strict=True)
        return sum(np.exp(-((x[0] - c[0]) ** 2 + (x[1] - c[1]) ** 2) / s**2) for c, s in pairs)

    def basis(self, mesh: MeshTri, order: int) -> Basis:
        return Basis(mesh, ELEMENTS[order](), intorder=2 * order + 4)

    def fixed(self, basis: Basis) -> np.ndarray:
        """Return which unknowns are given, (nunknowns,) bool."""
        facets = basis.mesh.boundary_facets()
        if self.natural:
            facets = np.setdiff1d(facets, basis.mesh.boundaries[self.natural])
        return np.isin(np.arange(basis.N), basis.get_dofs(facets).flatten())

    def solve(self, mesh: MeshTri) -> np.ndarray:
        return self.solved(mesh, self.order)

    def solved(self, mesh: MeshTri, order: int) -> np.ndarray:
        """Return the solution by elements of this order."""
        basis = self.basis(mesh, order)
        load = LinearForm(lambda v, w: self.source(w.x) * v).assemble(basis)
        return solve(*condense(laplace.assemble(basis), load, D=np.flatnonzero(self.fixed(basis))))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Return the distance from the solution of the next order, by element."""
        basis = self.basis(mesh, self.order + 1)
        finer = basis.interpolate(self.solved(mesh, self.order + 1)).grad
        coarse = basis.with_element(ELEMENTS[self.order]()).interpolate(solution).grad
        return np.sqrt(np.sum(np.sum((finer - coarse) ** 2, axis=0) * basis.dx, axis=1))

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        return ka.Ritz(solution, self.fixed(self.basis(mesh, self.order)), 1.0, self.source, order=self.order)

    def energy(self, mesh: MeshTri, order: int) -> float:
        """Return the square of the H1 seminorm of the solution by elements of this order."""
        solution = self.solved(mesh, order)
        return float(solution @ laplace.assemble(self.basis(mesh, order)) @ solution)

    def error(self, mesh: MeshTri, exact: float) -> float:
        """Return the error in the H1 seminorm, by the energy of a finer solution."""
        return float(np.sqrt(max(0.0, exact - self.energy(mesh, self.order))))
