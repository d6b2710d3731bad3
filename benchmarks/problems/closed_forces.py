"""Forces in space with closed forms, between magnets, coils and a permeable half space."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from skfem import MeshTet

from benchmarks.problems.magnets_in_space import MU0, blocks, graded
from kohonen_adapt.magnetostatics import Coil, Force, MagneticScalarPotential, Material

STEP, FAR, LAYERS = 0.008, 0.03, 3  # of the meshes, m
SHEET_POINTS = 24  # along each side of a charged face
STRENGTH = 8e5  # A/m, standard deviation of the components of magnetisations
PAIRS, BESIDE_COILS, OVER_IRON = 8, 7, 5


class Cuboid(NamedTuple):
    """A uniformly magnetised block, as charges on its faces."""

    centre: np.ndarray
    half: np.ndarray
    magnetisation: np.ndarray  # A/m

    def at(self, centre: np.ndarray) -> "Cuboid":
        """The same block about another centre."""
        return Cuboid(centre, self.half, self.magnetisation)

    def faces(self) -> Iterator[tuple[int, int, np.ndarray]]:
        """Axis, side, and centre of every face."""
        for axis, side in product(range(3), (-1, 1)):
            yield axis, side, self.centre + side * self.half * np.eye(3)[axis]

    def potential(self, x: np.ndarray) -> np.ndarray:
        """The scalar potential in A, by the closed form of a charged rectangle."""
        total = np.zeros(x.shape[1])
        for axis, side, centre in self.faces():
            a, b = (k for k in range(3) if k != axis)
            z = x[axis] - centre[axis]
            for s, t in product((-1, 1), repeat=2):
                u, v = x[a] - centre[a] - s * self.half[a], x[b] - centre[b] - t * self.half[b]
                r = np.sqrt(u**2 + v**2 + z**2)
                angle = np.arctan(u * v / np.where(z == 0.0, 1.0, z * r))
                terms = u * _log(v + r) + v * _log(u + r) - np.where(z == 0.0, 0.0, z * angle)
                total += side * s * t * self.magnetisation[axis] / (4.0 * np.pi) * terms
        return total

    def flux_density(self, x: np.ndarray) -> np.ndarray:
        """B outside, by magpylib."""
        import magpylib

        magnet = magpylib.magnet.Cuboid(
            dimension=2.0 * self.half, magnetization=self.magnetisation, position=self.centre
        )
        return magnet.getB(x.T).T

    def force_in(self, flux_density: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Force (3,) in N in the field of others."""
        at, weight = np.polynomial.legendre.leggauss(SHEET_POINTS)
        force = np.zeros(3)
        for axis, side, centre in self.faces():
            a, b = (k for k in range(3) if k != axis)
            x = np.repeat(centre[:, None], SHEET_POINTS**2, axis=1)
            x[a] += self.half[a] * np.repeat(at, SHEET_POINTS)
            x[b] += self.half[b] * np.tile(at, SHEET_POINTS)
            sizes = self.half[a] * self.half[b] * np.outer(weight, weight).ravel()
            force += side * self.magnetisation[axis] * (flux_density(x) @ sizes)
        return force

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        return np.round(self.centre - self.half, 9), np.round(self.centre + self.half, 9)

    @property
    def material(self) -> Material:
        return Material(remanence=tuple(MU0 * self.magnetisation))

    def mirrored(self) -> "Cuboid":
        """The image in iron of infinite permeability below z = 0."""
        return Cuboid(self.centre * (1, 1, -1), self.half, self.magnetisation * (-1, -1, 1))


@dataclass(frozen=True)
class ClosedForm:
    """A coarse mesh, the problem on it, the force on "magnet" along its direction, and its exact value in N."""

    kind: str
    mesh: MeshTet
    problem: MagneticScalarPotential
    goal: Force
    exact: float


def _log(x: np.ndarray) -> np.ndarray:
    # on the lines through edges, where the factor is 0
    return np.log(np.maximum(x, np.finfo(float).tiny))


def closed_forms() -> Iterator[ClosedForm]:
    """Twenty random configurations, the same in every run."""
    rng = np.random.default_rng(7)
    for _ in range(PAIRS):
        lower, upper = _cuboid(rng), _cuboid(rng)
        shift = np.round([*rng.uniform(-0.006, 0.006, 2), rng.uniform(0.003, 0.008)], 4)
        shift[2] += lower.half[2] + upper.half[2]
        upper = upper.at(shift)
        yield _case("two magnets", {"other": lower, "magnet": upper}, [lower, upper], lower.flux_density)
    for index in range(BESIDE_COILS):
        magnet = _cuboid(rng)
        coil = _coil(rng, float(magnet.half[2]), racetrack=index % 2 == 1)
        field = lambda x, coil=coil: MU0 * coil.field_strength(x)  # noqa: E731
        yield _case("magnet beside a coil", {"magnet": magnet}, [magnet], field, coils={"coil": coil})
    for _ in range(OVER_IRON):
        magnet = _cuboid(rng)
        height = magnet.half[2] + np.round(rng.uniform(0.003, 0.006), 4)
        magnet = magnet.at(np.array([0.0, 0.0, height]))
        image = magnet.mirrored()
        yield _case("magnet over iron", {"magnet": magnet}, [magnet, image], image.flux_density, floor=True)


def _cuboid(rng: np.random.Generator) -> Cuboid:
    return Cuboid(np.zeros(3), np.round(rng.uniform(0.004, 0.010, 3), 4), STRENGTH * rng.normal(size=3))


def _coil(rng: np.random.Generator, top: float, racetrack: bool) -> Coil:
    section = tuple(rng.uniform(0.003, 0.008, 2))
    centre = (*rng.uniform(-0.006, 0.006, 2), top + 0.5 * section[1] + rng.uniform(0.002, 0.008))
    if racetrack:
        return Coil.racetrack(centre, (0.0, 0.0, 1.0), 0.02, 0.015, 0.006, section, 2000.0)
    return Coil.circular(centre, (0.0, 0.0, 1.0), rng.uniform(0.012, 0.02), section, 2000.0)


def _case(
    kind: str,
    magnets: dict[str, Cuboid],
    sources: list[Cuboid],
    field: Callable[[np.ndarray], np.ndarray],
    coils: dict[str, Coil] | None = None,
    floor: bool = False,
) -> ClosedForm:
    ends = {name: magnet.ends for name, magnet in magnets.items()}
    axes = [graded(sorted({end[k] for pair in ends.values() for end in pair}), STEP, FAR, LAYERS) for k in range(3)]
    if floor:
        low = ends["magnet"][0][2]
        axes[2] = np.concatenate([np.linspace(0.0, low, 2)[:-1], axes[2][axes[2] > low - 1e-9]])
    force = magnets["magnet"].force_in(field)
    size = float(np.linalg.norm(force))
    materials = {**{name: magnet.material for name, magnet in magnets.items()}, "air": Material()}
    potential = {"outer": lambda x: sum(source.potential(x) for source in sources)}
    problem = MagneticScalarPotential(materials, potential, coils=coils, order=2)
    return ClosedForm(kind, blocks(axes, ends), problem, Force("magnet", tuple(force / size)), size)
