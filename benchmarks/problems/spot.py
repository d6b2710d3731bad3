"""Adapt problem M over iron for the flux density in a spot of air, by `Magnetostatics`."""

from dataclasses import dataclass

import numpy as np
from skfem import MeshTri

from benchmarks.problems.square_magnet import IRON_PERMEABILITY, magnet_mesh
from kohonen_adapt.magnetostatics import Field, Magnetostatics, Material

GOAL = -0.0645483674  # T: by P3 elements on meshes bisected for solution and dual, 104 341 unknowns


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
