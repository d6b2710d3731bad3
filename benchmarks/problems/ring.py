"""Measure how node density follows the ring monitor of Firedrake's movement (problem R); nothing is solved."""

import numpy as np
from skfem import MeshTri

from benchmarks.problems import p1

_SUBDIVISIONS = 32  # per edge, for the exact mass: the ring is a fifth of a start element wide


def monitor(x: np.ndarray) -> np.ndarray:
    """m at points x (2, ...) of the unit square."""
    squared_radius = (x[0] - 0.5) ** 2 + (x[1] - 0.5) ** 2
    return 1 + 20 / np.cosh(200 * (squared_radius - 0.16)) ** 2


def nodal_mass(mesh: MeshTri) -> np.ndarray:
    """Mass of every element from the mean of m at its three nodes, as movement measures it."""
    areas, _ = p1.shape_gradients(mesh)
    return areas * monitor(mesh.p[:, mesh.t]).mean(axis=0)


def exact_mass(mesh: MeshTri) -> np.ndarray:
    """Integral of m over every element."""
    areas, _ = p1.shape_gradients(mesh)
    points = np.einsum("dke,kq->deq", mesh.p[:, mesh.t], _barycentres(_SUBDIVISIONS))
    return areas * monitor(points).mean(axis=1)


def spread(mass: np.ndarray) -> tuple[float, float]:
    """Coefficient of variation, and largest over smallest."""
    return float(mass.std() / mass.mean()), float(mass.max() / mass.min())


def figures(mesh: MeshTri) -> dict[str, float]:
    """Both spreads of both masses; the nodal one is what movement reports."""
    result = {}
    for kind, mass in {"nodal": nodal_mass(mesh), "exact": exact_mass(mesh)}.items():
        result[f"cv {kind}"], result[f"max/min {kind}"] = spread(mass)
    return result


class Ring:
    """The monitor as if it were a solution, with the nodal mass as indicator, for the baseline of refinement."""

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """The monitor at the nodes."""
        return monitor(mesh.p)

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Nodal mass of every element."""
        return nodal_mass(mesh)


def _barycentres(n: int) -> np.ndarray:
    """Barycentric coordinates (3, n * n) of the barycentres of n * n congruent parts of a triangle."""
    i, j = np.divmod(np.arange(n * n), n)
    upright = i + j < n
    first = np.where(upright, i + 1 / 3, n - i - 1 / 3) / n
    second = np.where(upright, j + 1 / 3, n - j - 1 / 3) / n
    return np.stack((1 - first - second, first, second))
