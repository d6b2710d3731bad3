"""Model linear problems whose only singularities are at corners of polygons, with their exact energies."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.c_core import c_core_mesh
from kohonen_adapt.magnetostatics import Field, Froehlich, Magnetostatics, Material

VACUUM_PERMEABILITY = 4e-7 * np.pi
# a(A, A) in T^2 m^2 with nu relative, by orders 7 and 8 on six and eight layers, whose values differ by 4e-12 (C: 4000
# nodes, M: 1681). NGSolve's order 10 on 14 layers falls short of them by 1.0e-10 and 3e-11.
C_NORM, M_NORM = 3.5428138352e-4, 0.113491258139
IRON, STEEL, AIR = Material(1000.0), Material(bh=Froehlich(2000.0, 0.8)), Material()
Polygon = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class CornerModel:
    """A coarse start mesh, materials in polygons of a box from -`box` to `box`, and the squared energy norm."""

    name: str
    start: Callable[[], MeshTri]
    materials: Mapping[str, Material]
    polygons: Sequence[tuple[str, Polygon]]
    box: float
    norm: float

    def problem(self, order: int) -> Magnetostatics:
        """Return the problem at an order."""
        return Magnetostatics(self.materials, {"outer": 0.0}, order=order)

    @property
    def corners(self) -> np.ndarray:
        """Corners of the polygons, (2, n)."""
        return np.unique(np.concatenate([points for _, points in self.polygons]), axis=0).T

    def error(self, solution: Field) -> float:
        """Return the error in % of the energy norm: the energy of a Galerkin solution falls short by its square."""
        return self.error_of(solution.squared_norm * VACUUM_PERMEABILITY)

    def error_of(self, squared_norm: float) -> float:
        """Return the error in % of a solution with that a(A, A), in T^2 m^2."""
        return 100.0 * float(np.sqrt(abs(1.0 - squared_norm / self.norm)))

    def with_layers(self, mesh: MeshTri, layers: int, factor: float = 0.15) -> MeshTri:
        """Return the mesh refined at the corners."""
        away = np.hypot(*(mesh.p[:, :, None] - self.corners[:, None]))
        return ka.refined_at(mesh, away.argmin(axis=0), layers=layers, factor=factor)


def c_core(iron: Material = IRON) -> CornerModel:
    """The C-core of the examples."""
    top = [(30, 4), (30, 30), (-30, 30), (-30, 10), (-15, 10), (-15, 15), (15, 15), (15, 4)]
    magnet = [(-30, -10), (-15, -10), (-15, 10), (-30, 10)]
    polygons = [
        ("iron", top),
        ("iron", [(x, -y) for x, y in reversed(top)]),
        ("magnet", magnet),
    ]  # all counter-clockwise
    metres = [(name, [(1e-3 * x, 1e-3 * y) for x, y in points]) for name, points in polygons]
    materials = {"iron": iron, "magnet": Material(1.05, remanence=(0.0, 1.2)), "air": AIR}
    return CornerModel("C", lambda: c_core_mesh("c_core_coarse.msh"), materials, metres, 0.07, C_NORM)


def magnet_over_iron() -> CornerModel:
    """The square magnet over iron."""
    polygons = [("magnet", rectangle(-0.3, -0.2, 0.3, 0.2)), ("iron", rectangle(-0.5, -0.6, 0.5, -0.2))]
    materials = {"magnet": Material(remanence=(0.0, 1.0)), "iron": IRON, "air": AIR}
    return CornerModel("M over iron", magnet_start, materials, polygons, 1.0, M_NORM)


def rectangle(left: float, low: float, right: float, high: float) -> Polygon:
    """Return its corners."""
    return [(left, low), (right, low), (right, high), (left, high)]


def magnet_start() -> MeshTri:
    """Return 42 nodes on a grid with the interfaces among its lines."""
    x, y = np.array([-1.0, -0.5, -0.3, 0.0, 0.3, 0.5, 1.0]), np.array([-1.0, -0.6, -0.2, 0.2, 0.6, 1.0])
    mesh = MeshTri.init_tensor(x, y)
    across, up = mesh.p[:, mesh.t].mean(axis=1)
    magnet, iron = (np.abs(across) < 0.3) & (np.abs(up) < 0.2), (np.abs(across) < 0.5) & (np.abs(up + 0.4) < 0.2)
    parts = {"magnet": magnet, "iron": iron, "air": ~(magnet | iron)}
    mesh = mesh.with_subdomains({name: np.flatnonzero(own) for name, own in parts.items()})
    return mesh.with_boundaries({"outer": lambda x: np.ones(x.shape[1], dtype=bool)})
