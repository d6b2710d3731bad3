"""Solve two problems on four squares of two materials that meet in one point, where the solution has a small exponent.

`Touching`: flux from the left to the right side. The energy is exact, ``(nu_1 nu_2)^(1/2) / 2`` (A. M. Dykhne, Sov.
Phys. JETP 32, 1971), and the exponent is ``4 / pi atan(ratio^(-1/2))``. `Kellogg`: the exact solution ``r^0.1
s(angle)`` at a ratio of 161.4476 (R. B. Kellogg, Applicable Analysis 4, 1975; P. Morin, R. H. Nochetto and K. G.
Siebert, SIAM J. Numer. Anal. 38, 2000).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import Basis, BilinearForm, ElementTriP0, ElementTriP1, MeshTri, condense, solve
from skfem.helpers import dot, grad

import kohonen_adapt as ka
from kohonen_adapt.magnetostatics import Magnetostatics, Material

VACUUM_PERMEABILITY = 4e-7 * np.pi
RATIO, EXPONENT, TURN = 161.4476387975881, 0.1, -14.92256510455152  # of Kellogg's solution, with rho = pi / 4
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(20)


def squares_mesh(n: int = 16) -> MeshTri:
    """(-1, 1)^2 in n x n squares, with the names of sides and materials."""
    ticks = np.linspace(-1.0, 1.0, n + 1)
    mesh = MeshTri.init_tensor(ticks, ticks)
    sides = {
        "left": lambda x: x[0] < -0.999,
        "right": lambda x: x[0] > 0.999,
        "outer": lambda x: np.abs(x).max(axis=0) > 0.999,
    }
    mesh = mesh.with_boundaries(sides)
    return mesh.with_subdomains({"iron": lambda x: x[0] * x[1] > 0.0, "air": lambda x: x[0] * x[1] < 0.0})


@dataclass(frozen=True)
class Touching:
    """A = 0 on the left and 1 on the right, with iron of a relative permeability."""

    permeability: float

    @property
    def fixed(self) -> dict[str, Any]:
        """Values by boundary."""
        return {"left": 0.0, "right": 1.0}

    def error(self, mesh: MeshTri, norm: float, value_at: Callable[[np.ndarray], np.ndarray]) -> float:
        """In the energy norm, of a solution with that energy norm, both for nu = 1 in air."""
        return float(np.sqrt(norm**2 - self.permeability**-0.5))


class Kellogg:
    """Kellogg's solution as values on the boundary."""

    permeability = RATIO

    @property
    def fixed(self) -> dict[str, Any]:
        """Values by boundary."""
        return {"outer": self.exact}

    @staticmethod
    def exact(x: np.ndarray) -> np.ndarray:
        """u at points x (2, n)."""
        r, s, _ = Kellogg.parts(x)
        return r**EXPONENT * s

    @staticmethod
    def parts(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = np.mod(np.arctan2(-x[0], x[1]), 2.0 * np.pi)  # the larger coefficient is in the second quadrant
        quadrant = np.minimum((angle / (0.5 * np.pi)).astype(int), 3)
        factor = np.cos(EXPONENT * np.array([0.5 * np.pi - TURN, 0.25 * np.pi, TURN, 0.25 * np.pi]))[quadrant]
        shift = np.array([-0.25 * np.pi, -np.pi + TURN, -1.25 * np.pi, -1.5 * np.pi - TURN])[quadrant]
        at = EXPONENT * (angle + shift)
        return np.hypot(*x), factor * np.cos(at), -EXPONENT * factor * np.sin(at)

    def error(self, mesh: MeshTri, norm: float, value_at: Callable[[np.ndarray], np.ndarray]) -> float:
        """In the energy norm: ``|u - u_h|^2 = |u|^2 + |u_h|^2 - 2 a(u, u_h)`` by integrals over the boundary."""
        a, b = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]].swapaxes(0, 1)
        x = 0.5 * (a + b)[:, :, None] + 0.5 * (b - a)[:, :, None] * POINTS
        weights = 0.5 * np.hypot(*(b - a))[:, None] * WEIGHTS
        inside = (1.0 - 1e-12) * x.reshape(2, -1)
        r, s, slope = self.parts(inside)
        normal = np.sign(inside) * (np.abs(inside) == np.abs(inside).max(axis=0))
        along, across = inside / r, np.stack((-inside[1], inside[0])) / r
        gradient = r ** (EXPONENT - 1.0) * (EXPONENT * s * along + slope * across)
        nu = np.where(inside[0] * inside[1] > 0.0, 1.0 / RATIO, 1.0)
        outflow = nu * np.sum(gradient * normal, axis=0) * weights.ravel()
        return float(np.sqrt(max(norm**2 + outflow @ (r**EXPONENT * s - 2.0 * value_at(inside)), 0.0)))


Squares = Touching | Kellogg


def in_magnetostatics(squares: Squares, order: int | str) -> Magnetostatics:
    """The problem as one of magnetostatics."""
    materials = {"iron": Material(permeability=squares.permeability), "air": Material()}
    return Magnetostatics(materials, potential=squares.fixed, order=order)


def error_of_field(squares: Squares, field: Any) -> float:
    """As `indicators` have it, in sqrt(J / m)."""
    unit = np.sqrt(VACUUM_PERMEABILITY)
    return squares.error(field.mesh, unit * np.sqrt(2.0 * field.energy), field.potential_at) / unit


@BilinearForm
def _slopes(u: Any, v: Any, w: Any) -> Any:
    return w.nu * dot(grad(u), grad(v))


class ByRecovery:
    """The same as a problem of one's own, in P1 elements with `ka.estimators.recovery`."""

    calibrated = True

    def __init__(self, squares: Squares) -> None:
        self.squares = squares

    def coefficient(self, mesh: MeshTri) -> np.ndarray:
        """The coefficient of every element."""
        return np.where(
            np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["iron"]), 1.0 / self.squares.permeability, 1.0
        )

    def stiffness(self, mesh: MeshTri) -> Any:
        """The matrix of all nodes."""
        basis = Basis(mesh, ElementTriP1())
        return _slopes.assemble(basis, nu=basis.with_element(ElementTriP0()).interpolate(self.coefficient(mesh)))

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values."""
        values, fixed = np.zeros(mesh.p.shape[1]), np.zeros(mesh.p.shape[1], dtype=bool)
        for name, value in self.squares.fixed.items():
            nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
            values[nodes], fixed[nodes] = value(mesh.p[:, nodes]) if callable(value) else value, True
        return np.asarray(solve(*condense(self.stiffness(mesh), x=values, D=np.flatnonzero(fixed))))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """By recovery."""
        return ka.estimators.recovery(mesh, solution, self.coefficient(mesh))

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Of the solution."""
        return float(np.sqrt(solution @ self.stiffness(mesh) @ solution))

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """In the energy norm."""
        return self.squares.error(mesh, self.energy_norm(mesh, solution), lambda x: ka.interpolate(mesh, solution, x))


class PolishedByRecovery(ByRecovery):
    """The same with a functional."""

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """Of the solution."""
        fixed = np.isin(
            np.arange(mesh.p.shape[1]),
            mesh.facets[:, np.concatenate([mesh.boundaries[name] for name in self.squares.fixed])],
        )
        iron = np.isin(np.arange(mesh.t.shape[1]), mesh.subdomains["iron"]).astype(int)
        return ka.Ritz(solution, fixed, [1.0, 1.0 / self.squares.permeability], region=iron)
