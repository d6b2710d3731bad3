"""Solve problem M: a square permanent magnet, alone or over an iron block."""

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1
from benchmarks.problems.helmholtz import square_mesh
from kohonen_adapt.magnetostatics import Field, Magnetostatics, Material

VACUUM_PERMEABILITY = 4e-7 * np.pi
IRON_PERMEABILITY = 1000.0
# a(u, u) without and with iron, by P2 elements on bisected meshes with up to 140 000 unknowns, extrapolated as N^-2
REFERENCE_ENERGY = {False: 0.0908370426, True: 0.1134912582}
_REMANENT_FLUX = np.array((-1.0, 0.0))  # nu (-Br_y, Br_x) for a magnetisation of (0, 1)


def magnet_mesh(n: int, iron: bool) -> MeshTri:
    """(-1, 1)^2 in n x n squares with its subdomains; n a multiple of 20 puts every interface on grid lines."""
    subdomains = {"magnet": lambda x: (abs(x[0]) < 0.3) & (abs(x[1]) < 0.2)}
    if iron:
        subdomains["iron"] = lambda x: (abs(x[0]) < 0.5) & (abs(x[1] + 0.4) < 0.2)
    return square_mesh(n, -1.0, 1.0).with_subdomains(subdomains)


def named(mesh: MeshTri) -> MeshTri:
    """The mesh with the names of `MagnetOfOrder`: those of `magnet_mesh`, the rest, and the outer boundary."""
    parts = [rows for name, rows in mesh.subdomains.items() if name != "rest"]  # refined meshes have that name already
    rest = np.setdiff1d(np.arange(mesh.nelements), np.concatenate(parts))
    return mesh.with_subdomains({"rest": rest}).with_boundaries({"outer": mesh.boundary_facets()})


class MagnetOfOrder(Magnetostatics):
    """Problem M by `Magnetostatics`."""

    @classmethod
    def of(cls, order: int, iron: bool) -> "MagnetOfOrder":
        parts = {"magnet": Material(remanence=(0.0, 1.0)), "rest": Material()}
        return cls(parts | ({"iron": Material(IRON_PERMEABILITY)} if iron else {}), {"outer": 0.0}, order=order)

    def error(self, mesh: MeshTri, field: Field) -> float:
        """As of `SquareMagnet`."""
        found = VACUUM_PERMEABILITY * field.squared_norm
        return float(np.sqrt(1 - found / REFERENCE_ENERGY["iron" in self.materials]))


class SquareMagnet:
    """-div(nu grad A - flux) = 0 with nu = 1 (iron 1/1000) and A = 0 on the outer boundary."""

    def __init__(self, iron: bool) -> None:
        self.iron = iron

    def solve(self, mesh: MeshTri) -> np.ndarray:
        """Nodal values of the potential."""
        load = p1.integrate_gradients(mesh, flux(mesh))
        return p1.solve_dirichlet(mesh, p1.stiffness(mesh, reluctivity(mesh, self.iron)), load, np.zeros(load.size))

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """Residual indicators; only the tangential field jumps."""
        return p1.residual_indicators(mesh, solution, reluctivity(mesh, self.iron), flux=flux(mesh))

    def energy_norm(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Square root of int nu |grad A|^2."""
        return p1.energy_norm(mesh, solution, reluctivity(mesh, self.iron))

    def ritz(self, mesh: MeshTri, solution: np.ndarray) -> ka.Ritz:
        """int nu |grad A|^2 / 2 - flux . grad A, with the numbers 0 for air, 1 for the magnet and 2 for iron."""
        number = np.zeros(mesh.t.shape[1], dtype=int)
        number[mesh.subdomains["magnet"]] = 1
        if self.iron:
            number[mesh.subdomains["iron"]] = 2
        flux = np.outer(_REMANENT_FLUX, (0.0, 1.0, 0.0))
        return ka.Ritz(solution, p1.on_boundary(mesh), (1.0, 1.0, 1 / IRON_PERMEABILITY), flux=flux, region=number)

    def error(self, mesh: MeshTri, solution: np.ndarray) -> float:
        """Relative error of the energy norm: the energy of a Galerkin solution falls short by its square."""
        reference = REFERENCE_ENERGY[self.iron]
        return float(np.sqrt(1 - self.energy_norm(mesh, solution) ** 2 / reference))


def reluctivity(mesh: MeshTri, iron: bool) -> np.ndarray:
    """nu relative to that of vacuum, (nelements,)."""
    values = np.ones(mesh.t.shape[1])
    if iron:
        values[mesh.subdomains["iron"]] = 1 / IRON_PERMEABILITY
    return values


def flux(mesh: MeshTri) -> np.ndarray:
    """nu (-Br_y, Br_x), (2, nelements)."""
    values = np.zeros((2, mesh.t.shape[1]))
    values[:, mesh.subdomains["magnet"]] = _REMANENT_FLUX[:, None]
    return values
