"""Adapt problem M over iron for the flux density in a spot of air, by `Magnetostatics`."""

from dataclasses import dataclass

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems import p1
from benchmarks.problems.square_magnet import IRON_PERMEABILITY, magnet_mesh
from kohonen_adapt.magnetostatics import Field, Magnetostatics, Material

# Of both exact solutions |.|^2 with nu relative to vacuum and a remanence of 1 T, and J in T, by P3 elements on meshes
# bisected for both, 104 341 unknowns.
NORM_SQUARED, DUAL_NORM_SQUARED, GOAL = 0.113491258, 12.1396324, -0.0645483674
VACUUM = 4e-7 * np.pi


def spot_mesh(n: int) -> MeshTri:
    """(-1, 1)^2 in n x n squares, n a multiple of 20, with a spot of a fifth by a fifth right above the magnet."""
    plain = magnet_mesh(n, iron=True)
    x, y = plain.p[:, plain.t].mean(axis=1)
    parts = {name: np.isin(np.arange(x.size), rows) for name, rows in plain.subdomains.items()}
    parts["spot"] = (np.abs(x - 0.6) < 0.1) & (np.abs(y - 0.4) < 0.1)
    parts["air"] = ~np.any([*parts.values()], axis=0)
    mesh = MeshTri(plain.p, plain.t).with_boundaries({"outer": lambda x: np.full(x.shape[1], True)})
    return mesh.with_subdomains({name: np.flatnonzero(inside) for name, inside in parts.items()})


@dataclass(frozen=True)
class MeanFluxDensity:
    """The mean of B_y over a subdomain."""

    part: str

    def __call__(self, field: Field) -> float:
        """In T."""
        rows = field.mesh.subdomains[self.part]
        return float(np.average(field.flux_density[1, rows], weights=field.volume[rows]))

    def derivative(self, field: Field) -> tuple[np.ndarray, np.ndarray]:
        """B_y = -dA/dx."""
        rows, flux = field.mesh.subdomains[self.part], np.zeros((2, field.mesh.t.shape[1]))
        flux[0, rows] = -1.0 / field.volume[rows].sum()
        return np.zeros(flux.shape[1]), flux


MATERIALS = {"magnet": Material(remanence=(0.0, 1.0)), "iron": Material(IRON_PERMEABILITY)}
AIR = dict.fromkeys(["spot", "air"], Material())
PROBLEM = Magnetostatics(MATERIALS | AIR, potential={"outer": 0.0}, order=1, goal=MeanFluxDensity("spot"))


class ByMap(Magnetostatics):
    """The same without the polish."""

    def ritz(self, mesh: MeshTri, field: Field) -> ka.Ritz:
        """None."""
        raise ka.NotOffered("it is left out, for the comparison")


MAP_ONLY = ByMap(PROBLEM.materials, PROBLEM.potential, order=1, goal=PROBLEM.goal)


def errors(mesh: MeshTri) -> tuple[float, float]:
    """The product of the errors of field and dual in the energy norm, and the error of the goal, in T."""
    field = PROBLEM.solve(mesh)
    dual = np.asarray(PROBLEM.ritz(mesh, field).dual.values)
    own = VACUUM * field.squared_norm
    pulled = p1.area(mesh) @ np.sum(PROBLEM.goal.derivative(field)[1] * p1.gradient(mesh, dual), axis=0) / VACUUM
    product = np.sqrt((NORM_SQUARED - own) * (DUAL_NORM_SQUARED - pulled))
    return float(product), abs(PROBLEM.goal(field) - GOAL)
