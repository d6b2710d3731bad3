"""Solve -lap u + c u = f on the unit square for a known u, with exact values on the boundary."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from skfem import MeshTri
from skfem.quadrature import get_quadrature

import kohonen_adapt as ka
from benchmarks.problems import p1

Function = Callable[[np.ndarray], np.ndarray]

_POINTS, _WEIGHTS = get_quadrature(MeshTri.elem.refdom, 8)
_HATS = np.stack((1 - _POINTS.sum(axis=0), *_POINTS))  # hat functions at the quadrature points, (3, points)


@dataclass
class Manufactured:
    """-lap u + reaction u = f, with an error that is to be small in L2.

    Attributes
    ----------
    exact, laplacian
        u and lap u at points (2, ...).
    reaction
        Constant c >= 0.
    """

    exact: Function
    laplacian: Function
    reaction: float = 0.0

    norm = "L2"

    def source(self, x: np.ndarray) -> np.ndarray:
        """f at points (2, ...)."""
        return self.reaction * self.exact(x) - self.laplacian(x)

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values of the P1 solution."""
        matrix = p1.stiffness(mesh)
        if self.reaction:
            matrix = matrix + self.reaction * p1.mass(mesh)
        return p1.solve_dirichlet(mesh, matrix, self._load(mesh), self.exact(mesh.p))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Residual indicators of the energy norm, element and jump part."""
        remainder = self.source(_points(mesh)) - self.reaction * _values(mesh, solution)
        return p1.residual_indicators(mesh, solution, source=np.sqrt(_mean(remainder**2)))

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """L2 norm of u - u_h."""
        areas, _ = p1.shape_gradients(mesh)
        return float(np.sqrt(areas @ _mean((self.exact(_points(mesh)) - _values(mesh, solution)) ** 2)))

    def _load(self, mesh: MeshTri) -> np.ndarray:
        areas, _ = p1.shape_gradients(mesh)
        weighted = self.source(_points(mesh)) * (_WEIGHTS / _WEIGHTS.sum())
        local = np.einsum("eq,kq->ke", weighted, _HATS) * areas
        return np.bincount(mesh.t.ravel(), local.ravel(), minlength=mesh.p.shape[1])


class WithFunctional(Manufactured):
    """The same with a functional for the polish, and with indicators that do not overrate stretched elements."""

    calibrated = True

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Recovery indicators."""
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements))

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """Functional of -lap u = f - c u_h, which the solution u_h minimises, too."""

        def source(x: np.ndarray, region: np.ndarray) -> np.ndarray:
            return self.source(x) - (self.reaction * ka.interpolate(mesh, solution, x) if self.reaction else 0.0)

        return ka.Ritz(solution, p1.on_boundary(mesh), 1.0, source)


def _points(mesh: MeshTri) -> np.ndarray:
    """Quadrature points (2, nelements, points)."""
    return np.einsum("dke,kq->deq", mesh.p[:, mesh.t], _HATS)


def _values(mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
    """Solution at the quadrature points (nelements, points)."""
    return np.einsum("ke,kq->eq", solution[mesh.t], _HATS)


def _mean(at_points: np.ndarray) -> np.ndarray:
    """Means over the elements of values at their quadrature points."""
    return at_points @ _WEIGHTS / _WEIGHTS.sum()
