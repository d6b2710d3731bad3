"""Measure which density of nodes comes of which density of training points, beside what theory says."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from skfem import MeshTri

from benchmarks.problems.helmholtz import square_mesh
from benchmarks.problems.p1 import area
from benchmarks.table import aligned
from kohonen_adapt import KohonenMap, Schedule, Stage

STEEPNESS = 2.0  # the ramp is exp(2 x) on the unit square
SECTOR_SIDES = 32
SECTOR_ANGLE = np.pi / 2

Points = Callable[[int, np.random.Generator], tuple[np.ndarray, np.ndarray | None]]


@dataclass(frozen=True)
class Trial:
    """A map, its training points, the logarithm of their density, and the exponent that theory gives it, if any."""

    title: str
    mesh: MeshTri
    points: Points
    log_density: Callable[[np.ndarray], np.ndarray]
    schedule: Schedule
    topology: str
    inner: Callable[[np.ndarray], np.ndarray]  # the points far enough from the boundary for theory to hold
    exponent: float | None

    def trained(self, seed: int) -> MeshTri:
        """The mesh that the map learns; without the quality rule, which theory does not know."""
        som = KohonenMap(self.mesh, topology=self.topology, min_quality=0.0)
        som.train(self.points, self.schedule, seed=seed)
        return som.mesh

    def slope(self, mesh: MeshTri) -> float:
        """Slope of the logarithm of the density of nodes over that of the training points, by least squares."""
        node = mesh.interior_nodes()
        node = node[self.inner(mesh.p[:, node])]
        share = np.bincount(mesh.t.ravel(), np.tile(area(mesh) / 3, 3))
        return float(np.polyfit(self.log_density(mesh.p[:, node]), -np.log(share[node]), 1)[0])

    def spread(self, mesh: MeshTri) -> float:
        """Coefficient of variation of the density's mass per element."""
        mass = area(mesh) * np.exp(self.log_density(mesh.p[:, mesh.t])).mean(axis=0)
        return float(mass.std() / mass.mean())


def report(seeds: Sequence[int], quick: bool) -> str:
    """Slopes and spreads over the seeds; `quick` has the sizes of the tests."""
    rows = []
    for trial in trials(*((12, 200) if quick else (20, 1000))):
        meshes = [trial.trained(seed) for seed in seeds]
        slopes, spreads = [trial.slope(mesh) for mesh in meshes], [trial.spread(mesh) for mesh in meshes]
        found = [float(np.median(slopes)), min(slopes), max(slopes), float(np.median(spreads)), max(spreads)]
        rows.append(
            [trial.title, trial.mesh.p.shape[1], trial.exponent, *found[:3], trial.spread(trial.mesh), *found[3:]]
        )
    header = ["magnification", "N", "theory", "slope", "lowest", "highest", "cv before", "after", "worst"]
    return aligned(header, rows)


def trials(squares: int, epochs: int) -> list[Trial]:
    """The maps of the comparison; `squares` along a side and `epochs` are for the slow ones, those of radius 0."""
    square, strip = square_mesh(squares), MeshTri.init_tensor(np.linspace(0, 1, 41), np.linspace(0, 0.05, 3))
    still = Schedule(tuple(Stage(0, epochs, rate, points_per_neuron=20.0) for rate in (0.3, (0.3, 0.01))))
    wide = Schedule((Stage(3, 100, (0.2, 0.01), points_per_neuron=5.0),))
    return [
        Trial("R = 0", square, ramp, log_ramp, still, "flip", off_border, 1 / 2),
        Trial(
            "R = 0, points of rho weighted with rho", square, weighted_ramp, log_ramp, still, "flip", off_border, 1.0
        ),
        Trial("R = 3, a strip: p a function of x", strip, strip_ramp, log_ramp, wide, "fixed", off_ends, 2 / 3),
        Trial(
            "R = 3, a sector: ln p harmonic", sector_mesh(), sector_points, log_sector, wide, "fixed", off_sides, 1.0
        ),
        Trial("R = 3, a square with flips", square_mesh(24), ramp, log_ramp, wide, "flip", off_border, None),
    ]


def off_ends(x: np.ndarray) -> np.ndarray:
    """Whether x is more than a seventh of the way from both ends."""
    return inner(x[0])


def off_border(x: np.ndarray) -> np.ndarray:
    """The same for both coordinates of the unit square."""
    return inner(x[0]) & inner(x[1])


def off_sides(x: np.ndarray) -> np.ndarray:
    """The same for the logarithm of the radius and the angle in the sector."""
    return inner(np.log(np.hypot(*x))) & inner(np.arctan2(x[1], x[0]) / SECTOR_ANGLE)


def inner(u: np.ndarray) -> np.ndarray:
    """Whether numbers from 0 to 1 are more than a seventh away from both."""
    return np.abs(u - 0.5) < 0.5 - 1 / 7


def log_ramp(x: np.ndarray) -> np.ndarray:
    """Logarithm of the ramp's density, up to a constant."""
    return STEEPNESS * x[0]


def ramp(number: int, rng: np.random.Generator) -> tuple[np.ndarray, None]:
    """Training points with the ramp as density."""
    u, v = stratified(number, 1.0, rng)
    return np.stack((np.log1p(u * np.expm1(STEEPNESS)) / STEEPNESS, v)), None


def weighted_ramp(number: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The same with weights rho^(2/d), d = 2, of at most 1."""
    x, _ = ramp(number, rng)
    density = np.exp(log_ramp(x))
    return x, density / np.exp(STEEPNESS)


def strip_ramp(number: int, rng: np.random.Generator) -> tuple[np.ndarray, None]:
    """The ramp on the strip of height 1/20."""
    u, v = stratified(number, 0.05, rng)
    return np.stack((np.log1p(u * np.expm1(STEEPNESS)) / STEEPNESS, 0.05 * v)), None


def sector_mesh() -> MeshTri:
    """An annular sector, radii 1 to e, the rings of its nodes at equal distances."""
    ticks = np.linspace(0, 1, SECTOR_SIDES + 1)
    grid = MeshTri.init_tensor(ticks, ticks)
    radius, angle = 1 + (np.e - 1) * grid.p[0], SECTOR_ANGLE * grid.p[1]
    return MeshTri(radius * np.array((np.cos(angle), np.sin(angle))), grid.t)


def log_sector(x: np.ndarray) -> np.ndarray:
    """Logarithm of the density r^-2."""
    return -2 * np.log(np.hypot(*x))


def sector_points(number: int, rng: np.random.Generator) -> tuple[np.ndarray, None]:
    """Training points of density r^-2 in the sector, but for those between its chords and the outer arc."""
    u, v = stratified(number, 1.0, rng)
    radius, angle, side = np.exp(u), SECTOR_ANGLE * v, SECTOR_ANGLE / SECTOR_SIDES
    chord = np.e * np.cos(side / 2) / np.cos(angle % side - side / 2)
    inside = radius < (1 - 1e-9) * chord
    return (radius * np.array((np.cos(angle), np.sin(angle))))[:, inside], None


def stratified(number: int, aspect: float, rng: np.random.Generator) -> np.ndarray:
    """At least that many points of the unit square, one in every cell of a grid, in random order.

    The grid has `aspect` times as many cells along y as along x.
    """
    cells = np.array([np.ceil(np.sqrt(number / aspect)), np.ceil(np.sqrt(number * aspect))], dtype=int)
    corner = np.indices(cells).reshape(2, -1)
    return ((corner + rng.random(corner.shape)) / cells[:, None])[:, rng.permutation(corner.shape[1])]
