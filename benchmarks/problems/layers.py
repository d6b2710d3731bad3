"""Problems with thin layers on the unit square: closed, open, and along the boundary, with exact energies."""

from dataclasses import dataclass, field

import numpy as np
from skfem import MeshTri
from skfem.quadrature import get_quadrature

import kohonen_adapt as ka
from benchmarks.problems import p1
from benchmarks.problems.manufactured import Function, Manufactured, WithFunctional

TERMS = 20_001  # of the series for the energy of the boundary layer, whose terms fall with the fourth power
POINTS, WEIGHTS = get_quadrature(MeshTri.elem.refdom, 12)
HATS = np.stack((1 - POINTS.sum(axis=0), *POINTS))


@dataclass
class Layer(Manufactured):
    """-lap u = f for a known u, whose error is to be small in the energy norm, without a functional."""

    gradient: Function = field(kw_only=True)

    norm = "energy"
    calibrated = True

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Recovery indicators."""
        return ka.estimators.recovery(mesh, solution, np.ones(mesh.nelements))

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """|u_h|_1."""
        return p1.energy_norm(mesh, solution)

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """|u - u_h|_1 over |u|_1."""
        areas, weights = p1.area(mesh), WEIGHTS / WEIGHTS.sum()
        exact = self.gradient(np.einsum("dke,kq->deq", mesh.p[:, mesh.t], HATS))
        difference = exact - p1.gradient(mesh, solution)[:, :, None]
        squared, norm = (areas @ (each**2).sum(axis=0) @ weights for each in (difference, exact))
        return float(np.sqrt(squared / norm))


class PolishedLayer(WithFunctional, Layer):
    """The same with the functional."""


def around_point(centre: tuple[float, float], profile: tuple[Function, Function, Function]) -> dict[str, Function]:
    """u, its gradient and its Laplacian of a profile of the distance to a point, by its derivatives of order 0 to 2."""
    value, slope, bend = profile

    def offset(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        away = np.stack([x[0] - centre[0], x[1] - centre[1]])
        return away, np.maximum(np.hypot(*away), np.finfo(float).tiny)

    def gradient(x: np.ndarray) -> np.ndarray:
        away, r = offset(x)
        return slope(r) * away / r

    def laplacian(x: np.ndarray) -> np.ndarray:
        r = offset(x)[1]
        return bend(r) + slope(r) / r

    return {"exact": lambda x: value(offset(x)[1]), "gradient": gradient, "laplacian": laplacian}


def closed_layer(steepness: float) -> dict[str, Function]:
    """tanh K (r - 1/4) around the middle of the square."""

    def sech_squared(r: np.ndarray) -> np.ndarray:
        return 1.0 / np.cosh(steepness * (r - 0.25)) ** 2

    def value(r: np.ndarray) -> np.ndarray:
        return np.tanh(steepness * (r - 0.25))

    return around_point(
        (0.5, 0.5),
        (value, lambda r: steepness * sech_squared(r), lambda r: -2 * steepness**2 * sech_squared(r) * value(r)),
    )


def wave_front(steepness: float) -> dict[str, Function]:
    """arctan K (r - 0.7) around a point outside (Mitchell, Appl. Math. Comput. 220, 2013, problem 2.9)."""

    def scaled(r: np.ndarray) -> np.ndarray:
        return steepness * (r - 0.7)

    return around_point(
        (-0.05, -0.05),
        (
            lambda r: np.arctan(scaled(r)),
            lambda r: steepness / (1 + scaled(r) ** 2),
            lambda r: -2 * steepness**2 * scaled(r) / (1 + scaled(r) ** 2) ** 2,
        ),
    )


@dataclass(frozen=True)
class BoundaryLayer:
    """-eps lap u + u = 1 with u = 0 all round, without a functional."""

    eps: float

    calibrated = True

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values of the P1 solution."""
        matrix = self.eps * p1.stiffness(mesh) + p1.mass(mesh)
        load = p1.integrate_hats(mesh, np.ones(mesh.nelements))
        return p1.solve_dirichlet(mesh, matrix, load, np.zeros(load.size))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Recovery indicators."""
        return ka.estimators.recovery(mesh, solution, np.full(mesh.nelements, self.eps))

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Root of eps |u_h|_1^2 + |u_h|_0^2, which is the integral of a Galerkin solution."""
        return float(np.sqrt(solution @ p1.integrate_hats(mesh, np.ones(mesh.nelements))))

    @property
    def energy(self) -> float:
        """The same squared for u, by its sine series in x with exact functions of y."""
        m = np.pi * np.arange(1, TERMS, 2)
        root = np.sqrt(m**2 + 1 / self.eps)
        return float(np.sum(8 / (m**2 * (self.eps * m**2 + 1)) * (1 - np.tanh(root / 2) * 2 / root)))

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Error of the energy norm over the energy norm of u: a Galerkin solution falls short by its square."""
        return float(np.sqrt(1 - self.energy_norm(mesh, solution) ** 2 / self.energy))


class PolishedBoundaryLayer(BoundaryLayer):
    """The same with a functional."""

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """Functional of -eps lap u = 1 - u_h, which the solution u_h minimises, too."""

        def source(x: np.ndarray, region: np.ndarray) -> np.ndarray:
            return 1.0 - ka.interpolate(mesh, solution, x)

        return ka.Ritz(solution, p1.on_boundary(mesh), self.eps, source)
