"""Solve problem H, -lap u + u = f with a Gaussian bump, Firedrake movement's Monge-Ampere demonstration."""

import numpy as np
from skfem import MeshTri

from benchmarks.problems.manufactured import Manufactured

CENTRE = np.array((0.51, 0.65))
WIDTH = 0.1


def square_mesh(n: int, low: float = 0.0, high: float = 1.0) -> MeshTri:
    """(low, high)^2 in n x n squares."""
    ticks = np.linspace(low, high, n + 1)
    return MeshTri.init_tensor(ticks, ticks)


def bump(x: np.ndarray) -> np.ndarray:
    """u at points x (2, ...)."""
    return np.exp(-_squared_distance(x) / WIDTH**2)


def laplacian(x: np.ndarray) -> np.ndarray:
    """lap u at points x (2, ...)."""
    return (4 * _squared_distance(x) / WIDTH**2 - 4) / WIDTH**2 * bump(x)


def _squared_distance(x: np.ndarray) -> np.ndarray:
    return (x[0] - CENTRE[0]) ** 2 + (x[1] - CENTRE[1]) ** 2


class Helmholtz(Manufactured):
    """-lap u + u = f on the unit square with exact Dirichlet data; the error is to be small in L2."""

    def __init__(self) -> None:
        super().__init__(bump, laplacian, 1.0)
