"""Solve problem L: Laplace on the L-shape with the exact solution r^(2/3) sin(2 theta / 3)."""

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1

NORM_SQUARED = 1.8362266618751626  # |u|_1^2 of the exact solution
_GAUSS_POINTS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(12)
_GAUSS_POINTS, _GAUSS_WEIGHTS = (_GAUSS_POINTS + 1) / 2, _GAUSS_WEIGHTS / 2


def l_shaped_mesh(n: int) -> MeshTri:
    """(-1, 1)^2 without its quadrant x > 0 > y, in n x n squares per unit."""
    ticks = np.linspace(-1, 1, 2 * n + 1)
    square = MeshTri.init_tensor(ticks, ticks)
    x, y = square.p[:, square.t].mean(axis=1)
    return square.remove_elements(np.flatnonzero((x > 0) & (y < 0)))


def exact(x: np.ndarray) -> np.ndarray:
    """u at points x (2, ...)."""
    # the angle is taken from the bisector of the domain, so that no rounding of an outline node crosses the branch cut
    along, across = (x[1] - x[0]) / np.sqrt(2), -(x[0] + x[1]) / np.sqrt(2)
    theta = 0.75 * np.pi + np.arctan2(across, along)
    return np.hypot(x[0], x[1]) ** (2 / 3) * np.sin(2 / 3 * theta)


class LShape:
    """Laplace's equation on the L-shape with exact Dirichlet data, for `adapt`."""

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values of the P1 solution."""
        return p1.solve_dirichlet(mesh, p1.stiffness(mesh), np.zeros(mesh.p.shape[1]), exact(mesh.p))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Jumps of the normal derivative: the source is zero."""
        return p1.residual_indicators(mesh, solution)

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """|u_h|_1."""
        return p1.energy_norm(mesh, solution)

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """int |grad u|^2 / 2."""
        return ka.Ritz(solution, p1.on_boundary(mesh), coefficient=1.0)

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """|u - u_h|_1, exact to rounding for any mesh with a node at the re-entrant corner."""
        areas, _ = p1.shape_gradients(mesh)
        inner = areas @ (mean_gradient(mesh) * p1.gradient(mesh, solution)).sum(axis=0)
        return float(np.sqrt(NORM_SQUARED - 2 * inner + self.energy_norm(mesh, solution) ** 2))


def mean_gradient(mesh: MeshTri) -> np.ndarray:
    """Mean of grad u over every element (2, nelements), by Green's formula from the means of u on its facets.

    Quadrature of grad u itself is 8 % too low at the corner.
    """
    opposite = mesh.t2f[[1, 2, 0]]  # scikit-fem's facet k of an element runs from its node k to the next
    return -2 * np.einsum("ke,kde->de", _facet_means(mesh)[opposite], p1.shape_gradients(mesh)[1])


def _facet_means(mesh: MeshTri) -> np.ndarray:
    """Means of u on all facets, the Gauss points graded toward the re-entrant corner where a facet ends there."""
    ends = mesh.p[:, mesh.facets]
    radius = np.hypot(*ends)
    start, end = np.where(radius[0] <= radius[1], ends, ends[:, ::-1]).transpose(1, 0, 2)
    at_corner = radius.min(axis=0) < 1e-9
    means = np.zeros(mesh.facets.shape[1])
    for point, weight in zip(_GAUSS_POINTS, _GAUSS_WEIGHTS, strict=True):
        # u is a multiple of r^(2/3) on a facet from the corner: with t = s^3 a polynomial
        t = np.where(at_corner, point**3, point)
        means += np.where(at_corner, 3 * point**2, 1.0) * weight * exact(start + t * (end - start))
    return means
