"""Model the coil of FEMM's tutorial: a thick one in air, around an axis."""

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import j0, j1, struve
from skfem import MeshTri

from benchmarks.problems.drawing import meshed
from benchmarks.problems.geometry import Gmsh
from kohonen_adapt.magnetostatics import FluxLinkage, Magnetostatics, Material

INCH = 0.0254
INNER, OUTER, LENGTH = 0.5 * INCH, 1.5 * INCH, 2.0 * INCH  # radii, and along the axis
TURNS, CURRENT = 1000, 1.0
RIM, NEAR = 0.15, 0.08  # radius of the open boundary, half of a square with smaller elements
VACUUM_PERMEABILITY = 4e-7 * np.pi
HEIGHTS = np.linspace(-0.04, 0.04, 9)  # on the axis, m
INDUCTANCE, ON_AXIS, RECOVERED = "inductance (mH)", "field at 9 points of the axis (mT)", "the same, recovered (mT)"
DENSITY = TURNS * CURRENT / ((OUTER - INNER) * LENGTH)


class ThickCoil:
    """Meeker, "FEMM Magnetostatic Tutorial", femm.info: 1 in and 3 in across, 2 in long, 1000 turns, 1 A.

    On the axis the exact field is (Montgomery, Solenoid Magnet Design, 1969), summed over h from there to either end,

    ``B = mu0 J / 2 sum of h ln((r_o + sqrt(r_o^2 + h^2)) / (r_i + sqrt(r_i^2 + h^2)))``

    and the inductance with n turns per area ``2 pi mu0 n^2 int_0^oo (k l + exp(-k l) - 1) / k^2 I(k)^2 dk``,
    ``I = int_{r_i}^{r_o} r J_1(k r) dr`` (Dwight, Electrical Coils and Conductors, 1945).
    """

    settings = (0.0,)
    goal = FluxLinkage({"coil": TURNS})

    def __init__(self, order: int) -> None:
        self.order = order
        self.title = f"FEMM, coil of the tutorial, order={order}"

    def start(self, setting: float) -> MeshTri:
        """Of Gmsh, in the half of a disk."""

        def draw(gmsh: Gmsh) -> dict[str, list[int]]:
            disk, half = (
                gmsh.model.occ.addDisk(0, 0, 0, RIM, RIM),
                gmsh.model.occ.addRectangle(0, -RIM, 0, RIM, 2 * RIM),
            )
            gmsh.model.occ.intersect([(2, disk)], [(2, half)])
            near = gmsh.model.occ.addRectangle(0, -NEAR, 0, NEAR, 2 * NEAR)
            coil = gmsh.model.occ.addRectangle(INNER, -LENGTH / 2, 0, OUTER - INNER, LENGTH)
            return {"air": [disk], "near": [near], "coil": [coil]}

        def rim(left: float, low: float, right: float, high: float) -> str:
            return "axis" if right < 1e-6 else "rim"

        return meshed(draw, {"air": 0.03, "near": 6e-3, "coil": 4e-3}, rim)

    def problem(self, setting: float) -> Magnetostatics:
        """Air beyond the rim, as FEMM has it by its asymptotic boundary condition."""
        return Magnetostatics(
            {"air": Material(), "near": Material(), "coil": Material(current_density=DENSITY)},
            axisymmetric=True,
            open_boundary="rim",
            order=self.order,
        )

    def published(self, setting: float) -> dict[str, np.ndarray]:
        """What `measured` should find."""
        on_axis = 1e3 * flux_density_on_axis(HEIGHTS)
        return {INDUCTANCE: np.array([1e3 * inductance()]), ON_AXIS: on_axis, RECOVERED: on_axis}

    def measured(self, mesh: MeshTri, setting: float) -> dict[str, np.ndarray]:
        """The same of a solution on a mesh."""
        field, points = self.problem(setting).solve(mesh), np.stack((np.zeros(HEIGHTS.size), HEIGHTS))
        plain, recovered = (1e3 * field.flux_density_at(points, recovered=smooth)[1] for smooth in (False, True))
        found = field.flux_linkage("coil", TURNS) / CURRENT
        return {INDUCTANCE: np.array([1e3 * found]), ON_AXIS: plain, RECOVERED: recovered}


def flux_density_on_axis(height: np.ndarray) -> np.ndarray:
    """B_z at heights over the middle of the coil, in T."""
    total = np.zeros_like(height)
    for h in (LENGTH / 2 - height, LENGTH / 2 + height):
        total += h * np.log((OUTER + np.hypot(OUTER, h)) / (INNER + np.hypot(INNER, h)))
    return VACUUM_PERMEABILITY * DENSITY / 2 * total


def inductance() -> float:
    """In H, the integral by Gauss's rule; what lies beyond the last k is less than 1e-9 of it."""
    nodes, weights = leggauss(8)
    edges = np.linspace(0.0, 400.0 / INNER, 8001)
    k = edges[:-1] + np.outer((1 + nodes) / 2, np.diff(edges))
    moment = (_integral(k * OUTER) - _integral(k * INNER)) / k**2
    integrand = (k * LENGTH + np.expm1(-k * LENGTH)) / k**2 * moment**2
    per_area = TURNS / ((OUTER - INNER) * LENGTH)
    return float(np.pi * VACUUM_PERMEABILITY * per_area**2 * np.diff(edges) @ (weights @ integrand))


def _integral(x: np.ndarray) -> np.ndarray:
    """Of x J_1(x) from 0 on."""
    return np.pi * x / 2 * (j1(x) * struve(0, x) - j0(x) * struve(1, x))
