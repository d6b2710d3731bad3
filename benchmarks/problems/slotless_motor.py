"""Model a slotless permanent-magnet motor from two meshes, of its rotor and its stator; its torque has a series."""

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.drawing import annulus, meshed, sector
from benchmarks.problems.geometry import Gmsh
from kohonen_adapt.magnetostatics import Magnetostatics, Material, Torque

POLES, BELTS = 6, 18  # magnets, sides of coils: one for each phase under every pole
SHAFT, CORE, MAGNETS, RING, BORE, WINDING, YOKE = 0.010, 0.020, 0.024, 0.0245, 0.025, 0.029, 0.038  # radii, m
REMANENCE, IRON = 1.2, 1000.0  # T, permeability; that of the magnets is 1
PEAK = 5e6  # A/m^2
AROUND = 216  # facets of the ring where the meshes meet
TORQUE = "torque at 6 angles (N m/m)"
VACUUM_PERMEABILITY = 4e-7 * np.pi


class SlotlessMotor:
    """Six magnets of parallel magnetisation on an iron core; a winding of three phases inside an iron yoke.

    With one permeability in each of the layers around the axis, every harmonic n of the magnets' potential is
    ``a r^n + b r^-n`` in each of them, and in the magnets ``mu0 (M_phi - dM_r/dphi) r / (n^2 - 1)`` more (Zhu, Howe,
    Bolte and Ackermann, IEEE Trans. Magn. 29, 1993, 124). The torque on the rotor is ``-int r J B_r`` over the winding,
    of that field alone: from its own a current in layers has no torque. The currents stay while the rotor turns.
    """

    settings = tuple(range(3, 36, 6))  # steps of the ring, from 5 to 55 degrees
    goal = Torque("rotor")

    def __init__(self, order: int) -> None:
        self.order = order
        self.title = f"motor of two meshes, order={order}"

    def start(self, setting: int) -> MeshTri:
        """Both of Gmsh, the rotor's turned by whole steps of the ring."""
        return ka.turned(ka.merge(_rotor(), _stator()), "rotor", angle_of(setting))

    def problem(self, setting: int) -> Magnetostatics:
        """A = 0 on the shaft and outside."""
        materials = dict.fromkeys(["rotor_air", "stator_air"], Material())
        materials |= dict.fromkeys(["core", "yoke"], Material(permeability=IRON))
        for k, angle in enumerate(angle_of(setting) + 2 * np.pi / POLES * np.arange(POLES)):
            sense = REMANENCE * (-1) ** k
            materials[f"magnet_{k}"] = Material(remanence=(sense * np.cos(angle), sense * np.sin(angle)))
        materials |= {f"belt_{k}": Material(current_density=density) for k, density in enumerate(densities())}
        return Magnetostatics(materials, potential={"shaft": 0.0, "outside": 0.0}, order=self.order)

    def published(self, setting: int) -> dict[str, np.ndarray]:
        """What `measured` should find."""
        return {TORQUE: np.array([torque(angle_of(setting))])}

    def measured(self, mesh: MeshTri, setting: int) -> dict[str, np.ndarray]:
        """The same of a solution on a mesh."""
        return {TORQUE: np.array([self.problem(setting).solve(mesh).torque("rotor")])}


def angle_of(steps: int) -> float:
    """Of the rotor, counter-clockwise; at 0 the first magnet is on the x-axis."""
    return 2 * np.pi * steps / AROUND


def densities() -> list[float]:
    """Of the currents in the belts, the first of which is on the x-axis, in A/m^2."""
    return [PEAK * np.cos(np.pi * POLES / BELTS * k) for k in range(BELTS)]


def torque(angle: float) -> float:
    """On the rotor in N m/m, by the first 20 harmonics that there are."""
    total, half, k = 0.0, np.pi / BELTS, np.arange(BELTS)
    for n in (POLES // 2 * np.arange(1, 41, 2)).tolist():
        current = 2 * np.sin(n * half) / (np.pi * n) * np.sum(densities() * np.exp(-2j * n * half * k))
        rising, falling = _potential_in_air(n)
        moment = rising * (WINDING**2 - BORE**2 * (BORE / WINDING) ** n) / (2 + n)
        moment += falling * (WINDING**2 * (MAGNETS / WINDING) ** n - BORE**2 * (MAGNETS / BORE) ** n) / (2 - n)
        total -= np.pi * (1j * n * moment * np.exp(-1j * n * angle) * np.conj(current)).real
    return float(total)


def _potential_in_air(n: int) -> np.ndarray:
    """Factors of (r / WINDING)^n and (r / MAGNETS)^-n in the harmonic of the magnets' potential between them."""
    half = np.pi / POLES
    plus, minus = np.sin((n + 1) * half) / (n + 1), np.sin((n - 1) * half) / (n - 1)
    magnetisation = REMANENCE * POLES / np.pi
    radial, around = magnetisation * (plus + minus), 1j * magnetisation * (minus - plus)  # mu0 M
    extra = (around - 1j * n * radial) / (n**2 - 1)
    edges, reluctivity = [SHAFT, CORE, MAGNETS, WINDING, YOKE], [1 / IRON, 1.0, 1.0, 1 / IRON]
    matrix, right = np.zeros((8, 8)), np.zeros(8, dtype=complex)
    for layer, (low, high, nu) in enumerate(zip(edges[:-1], edges[1:], reluctivity, strict=True)):
        for r, row, sign in ((low, 2 * layer - 1, 1), (high, 2 * layer + 1, -1)):
            up, down = (r / high) ** n, (r / low) ** -n
            columns = slice(2 * layer, 2 * layer + 2)
            matrix[max(row, 0), columns] = sign * up, sign * down
            if row >= 0 and row < 7:
                matrix[row + 1, columns] = sign * nu * n * up / r, -sign * nu * n * down / r
            if layer == 1:
                right[row : row + 2] -= sign * extra * r, sign * (extra + around)
    return np.linalg.solve(matrix, right)[4:6]


def _rotor() -> MeshTri:
    """With the first magnet on the x-axis."""

    def draw(gmsh: Gmsh) -> dict[str, list[int]]:
        parts = {"rotor_air": [annulus(gmsh, SHAFT, RING)], "core": [annulus(gmsh, SHAFT, CORE)]}
        return parts | _sectors(gmsh, "magnet", POLES, CORE, MAGNETS)

    magnets = [f"magnet_{k}" for k in range(POLES)]
    mesh = meshed(draw, {"rotor_air": 2e-3, "core": 2.5e-3} | dict.fromkeys(magnets, 1.2e-3), _circle, {"ring": AROUND})
    return mesh.with_subdomains({"rotor": np.arange(mesh.t.shape[1])})


def _stator() -> MeshTri:
    """With the first belt on the x-axis."""

    def draw(gmsh: Gmsh) -> dict[str, list[int]]:
        parts = {"stator_air": [annulus(gmsh, RING, YOKE)], "yoke": [annulus(gmsh, WINDING, YOKE)]}
        return parts | _sectors(gmsh, "belt", BELTS, BORE, WINDING)

    belts = [f"belt_{k}" for k in range(BELTS)]
    return meshed(draw, {"stator_air": 3e-3, "yoke": 3e-3} | dict.fromkeys(belts, 1.5e-3), _circle, {"ring": AROUND})


def _sectors(gmsh: Gmsh, name: str, number: int, inner: float, outer: float) -> dict[str, list[int]]:
    """A whole ring of them, the first on the x-axis."""
    step = 2 * np.pi / number
    return {f"{name}_{k}": [sector(gmsh, inner, outer, (k - 0.5) * step, (k + 0.5) * step)] for k in range(number)}


def _circle(left: float, low: float, right: float, high: float) -> str:
    """The name of a circle by its bounding box."""
    return min({"shaft": SHAFT, "ring": RING, "outside": YOKE}.items(), key=lambda item: abs(item[1] - right))[0]
