"""Solve problem C, the C-core magnet of the examples, by a plain P1 solver."""

from pathlib import Path

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1

HERE = Path(__file__).parent
EXAMPLES = HERE.parents[1] / "examples"
SCALE = 1e-3  # drawn in millimetres
PERMEABILITY = {"iron": 1000.0, "magnet": 1.05, "air": 1.0}
REMANENCE = 1.2  # along y, T
# a(u, u) in T^2 m^2 with nu relative: P2 on meshes bisected to 600 000 unknowns, extrapolated
REFERENCE_ENERGY = 3.54281383556e-4


def c_core_mesh(name: str) -> MeshTri:
    """A mesh of the drawing by its file name, in metres: two of the examples, and a coarser one to refine from.

    `gmsh -2 -format msh41 -setnumber size 14 -o benchmarks/problems/c_core_coarse.msh examples/c_core.geo` made that.
    """
    folder = HERE if (HERE / name).exists() else EXAMPLES
    return ka.read_mesh(folder / name, scale=SCALE)


def reluctivity(mesh: MeshTri) -> np.ndarray:
    """nu relative to that of vacuum, (nelements,)."""
    values = np.empty(mesh.t.shape[1])
    for name, permeability in PERMEABILITY.items():
        values[mesh.subdomains[name]] = 1 / permeability
    return values


def flux(mesh: MeshTri) -> np.ndarray:
    """nu (-Br_y, Br_x), (2, nelements)."""
    values = np.zeros((2, mesh.t.shape[1]))
    values[0, mesh.subdomains["magnet"]] = -REMANENCE / PERMEABILITY["magnet"]
    return values


class CCore:
    """-div(nu grad A - flux) = 0 with A = 0 on the outer boundary."""

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values of the potential."""
        load = p1.integrate_gradients(mesh, flux(mesh))
        return p1.solve_dirichlet(mesh, p1.stiffness(mesh, reluctivity(mesh)), load, np.zeros(load.size))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Residual indicators; only the tangential field jumps."""
        return p1.residual_indicators(mesh, solution, reluctivity(mesh), flux=flux(mesh))

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Square root of int nu |grad A|^2."""
        return p1.energy_norm(mesh, solution, reluctivity(mesh))

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """int nu |grad A|^2 / 2 - flux . grad A, with a number for every name."""
        number = np.zeros(mesh.t.shape[1], dtype=int)
        for order, name in enumerate(PERMEABILITY):
            number[mesh.subdomains[name]] = order
        coefficients = 1 / np.array([*PERMEABILITY.values()])
        flux = np.outer((-REMANENCE, 0.0), coefficients * [name == "magnet" for name in PERMEABILITY])
        return ka.Ritz(solution, p1.on_boundary(mesh), coefficients, flux=flux, region=number)

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Relative error of the energy norm: the energy of a Galerkin solution falls short by its square."""
        return float(np.sqrt(1 - self.energy_norm(mesh, solution) ** 2 / REFERENCE_ENERGY))
