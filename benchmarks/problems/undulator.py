"""Model a Halbach undulator: two arrays of magnets over one period, with its field and force in closed form."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.magnetostatics import Force, Magnetostatics, Material

PERIOD, HEIGHT, GAP = 0.04, 0.01, 0.01  # of an array, of its magnets, between the arrays; metres
AIR = 0.03  # beyond each array, where 1e-6 of the field in the gap is left
REMANENCE, BLOCKS = 1.2, 4  # T, blocks per period; their permeability is 1
VACUUM_PERMEABILITY = 4e-7 * np.pi
UPPER = [f"upper_{k}" for k in range(BLOCKS)]
MIDDLE = np.stack(((np.arange(64) + 0.5) * PERIOD / 64, np.zeros(64)))  # of the gap, over a period
POINTS = np.stack((np.linspace(0.0005, 0.0395, 14), np.full(14, 0.0017)))  # in the gap, off its middle
HARMONIC, FIELD = "first harmonic in the middle (T)", "field at 14 points (T)"
RECOVERED, FORCE = "the same, recovered (T)", "force on an array (N/m)"


class Undulator:
    """The arrays face each other with their strong sides; blocks of one turn to the left, of the other to the right.

    Halbach (Nucl. Instrum. Methods 187, 1981, 109): in the gap, between x = 0 in the middle of a block that points
    across it, with k = 2 pi / period and M blocks in it,

    ``B_y = sum over n = 1, 1 + M, ... of 2 Br (1 - exp(-n k height)) sin(n pi / M) / (n pi / M) exp(-n k gap / 2)
    cosh(n k y) cos(n k x)``

    and B_x with -sinh and sin. The arrays attract each other by ``int B_y^2 / (2 mu0)`` over the middle of the gap.
    """

    settings = (0.0,)
    goal = Force(UPPER, (0.0, 1.0))

    def __init__(self, order: int, air: float = AIR) -> None:
        self.order, self.air = order, air
        self.title = f"Halbach undulator, order={order}"

    def start(self, setting: float) -> MeshTri:
        """Squares of 2.5 mm, cut in two."""
        top, size = GAP / 2 + HEIGHT + self.air, 2.5e-3
        lines = (np.linspace(0.0, length, round(length / size) + 1) for length in (PERIOD, 2 * top))
        mesh = MeshTri.init_tensor(*lines).translated((0.0, -top)).with_defaults()
        return mesh.with_subdomains(_subdomains(mesh))

    def problem(self, setting: float) -> Magnetostatics:
        """A = 0 above and below; a period apart everything is the same."""
        materials = {"air": Material()}
        for array, sense in (("lower", 1), ("upper", -1)):
            for k in range(BLOCKS):
                angle = np.pi / 2 + 2 * np.pi * sense * k / BLOCKS
                materials[f"{array}_{k}"] = Material(remanence=(REMANENCE * np.cos(angle), REMANENCE * np.sin(angle)))
        return Magnetostatics(
            materials, potential={"top": 0.0, "bottom": 0.0}, periodic=[("left", "right")], order=self.order
        )

    def published(self, setting: float) -> dict[str, np.ndarray]:
        """What `measured` should find."""
        return {
            HARMONIC: first_harmonic(flux_density(MIDDLE)),
            FIELD: flux_density(POINTS).ravel(),
            RECOVERED: flux_density(POINTS).ravel(),
            FORCE: np.array([-attraction()]),
        }

    def measured(self, mesh: MeshTri, setting: float) -> dict[str, np.ndarray]:
        """The same of a solution on a mesh."""
        field = self.problem(setting).solve(mesh)
        return {
            HARMONIC: first_harmonic(field.flux_density_at(MIDDLE)),
            FIELD: field.flux_density_at(POINTS).ravel(),
            RECOVERED: field.flux_density_at(POINTS, recovered=True).ravel(),
            FORCE: field.force(UPPER)[1:],
        }


def flux_density(x: np.ndarray) -> np.ndarray:
    """The closed form at points (2, n) of the gap, (2, n) in T."""
    total = np.zeros_like(x)
    for n, amplitude in _harmonics():
        along, across = 2 * np.pi * n / PERIOD * (x[0] - PERIOD / 8), 2 * np.pi * n / PERIOD * x[1]
        total += 2 * amplitude * np.stack((-np.sinh(across) * np.sin(along), np.cosh(across) * np.cos(along)))
    return total


def first_harmonic(field: np.ndarray) -> np.ndarray:
    """Its amplitude (1,) in the B_y of values (2, 64) at `MIDDLE`."""
    wave = np.cos(2 * np.pi * (MIDDLE[0] / PERIOD - 1 / 8))
    return np.atleast_1d(2 * np.mean(field[1] * wave))


def attraction() -> float:
    """Of the arrays over a period, in N per metre of depth."""
    return sum(PERIOD * amplitude**2 for _, amplitude in _harmonics()) / VACUUM_PERMEABILITY


def _harmonics() -> list[tuple[int, float]]:
    """Numbers, and amplitudes of one array's field in the middle of the gap in T."""
    n = 1 + BLOCKS * np.arange(12)
    height, gap = 2 * np.pi * n / PERIOD * np.array([[HEIGHT], [GAP / 2]])
    values = REMANENCE * (1 - np.exp(-height)) * np.sinc(n / BLOCKS) * np.exp(-gap)
    return list(zip(n.tolist(), values.tolist(), strict=True))


def _subdomains(mesh: MeshTri) -> dict[str, np.ndarray]:
    """Names of blocks by array and number, "lower_0" to "upper_3"; the rest is "air"."""
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    in_array = np.abs(np.abs(y) - GAP / 2 - HEIGHT / 2) < HEIGHT / 2
    names = {
        f"{array}_{k}": np.flatnonzero(in_array & (sign * y > 0) & (np.floor(BLOCKS * x / PERIOD) == k))
        for array, sign in (("lower", -1), ("upper", 1))
        for k in range(BLOCKS)
    }
    return names | {"air": np.flatnonzero(~in_array)}
