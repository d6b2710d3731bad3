"""Solve problem F: scikit-fem's example 22, -lap u = 1 on the L-shape with u = 0 all round."""

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1

NORM_SQUARED = 0.2140758036140825  # |u|_1^2 of the exact solution, by high orders on layers at the corner


class PoissonL:
    """-lap u = 1 on an L-shape, u = 0 on its whole outline."""

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values of the P1 solution."""
        load = p1.integrate_hats(mesh, np.ones(mesh.t.shape[1]))
        return p1.solve_dirichlet(mesh, p1.stiffness(mesh), load, np.zeros(load.size))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Residual indicators of the energy norm, element and jump part."""
        return p1.residual_indicators(mesh, solution, source=1.0)

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """|u_h|_1."""
        return p1.energy_norm(mesh, solution)

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """int |grad u|^2 / 2 - u."""
        return ka.Ritz(solution, p1.on_boundary(mesh), coefficient=1.0, source=1.0)

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """|u - u_h|_1: the energy of a Galerkin solution falls short by its square."""
        return float(np.sqrt(NORM_SQUARED - self.energy_norm(mesh, solution) ** 2))
