"""Solve problem H, -lap u + u = f with a Gaussian bump, Firedrake movement's Monge-Ampere demonstration."""

import numpy as np
from skfem import MeshTri
from skfem.quadrature import get_quadrature

from benchmarks.problems import p1

_CENTRE = np.array((0.51, 0.65))
_WIDTH = 0.1
_POINTS, _WEIGHTS = get_quadrature(MeshTri.elem.refdom, 8)


def square_mesh(n: int, low: float = 0.0, high: float = 1.0) -> MeshTri:
    """(low, high)^2 in n x n squares."""
    ticks = np.linspace(low, high, n + 1)
    return MeshTri.init_tensor(ticks, ticks)


def exact(x: np.ndarray) -> np.ndarray:
    """u at points x (2, ...)."""
    return np.exp(-(_distance(x) ** 2) / _WIDTH**2)


def source(x: np.ndarray) -> np.ndarray:
    """f = u - lap u at points x (2, ...)."""
    laplacian = (4 * _distance(x) ** 2 / _WIDTH**2 - 4) / _WIDTH**2
    return (1 - laplacian) * exact(x)


def _distance(x: np.ndarray) -> np.ndarray:
    return np.hypot(x[0] - _CENTRE[0], x[1] - _CENTRE[1])


class Helmholtz:
    """-lap u + u = f on the unit square with exact Dirichlet data; the error is to be small in L2."""

    norm = "L2"

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values of the P1 solution."""
        matrix = p1.stiffness(mesh) + p1.mass(mesh)
        return p1.solve_dirichlet(mesh, matrix, _load(mesh), exact(mesh.p))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Residual indicators of the energy norm, element and jump part."""
        remainder = source(_points(mesh)) - _values(mesh, solution)
        return p1.residual_indicators(mesh, solution, source=np.sqrt(_mean(remainder**2)))

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """L2 norm of u - u_h."""
        areas, _ = p1.shape_gradients(mesh)
        return float(np.sqrt(areas @ _mean((exact(_points(mesh)) - _values(mesh, solution)) ** 2)))


def _hats() -> np.ndarray:
    """Values (3, points) of the hat functions at the points of the quadrature rule."""
    return np.stack((1 - _POINTS.sum(axis=0), *_POINTS))


def _points(mesh: MeshTri) -> np.ndarray:
    """Quadrature points (2, nelements, points)."""
    return np.einsum("dke,kq->deq", mesh.p[:, mesh.t], _hats())


def _values(mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
    """Solution at the quadrature points (nelements, points)."""
    return np.einsum("ke,kq->eq", solution[mesh.t], _hats())


def _mean(values: np.ndarray) -> np.ndarray:
    """Means over the elements of values at their quadrature points."""
    return values @ _WEIGHTS / _WEIGHTS.sum()


def _load(mesh: MeshTri) -> np.ndarray:
    areas, _ = p1.shape_gradients(mesh)
    weighted = source(_points(mesh)) * (_WEIGHTS / _WEIGHTS.sum())
    local = np.einsum("eq,kq->ke", weighted, _hats()) * areas
    return np.bincount(mesh.t.ravel(), local.ravel(), minlength=mesh.p.shape[1])
