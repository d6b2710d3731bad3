"""Iron and magnets beside coils in space: an electromagnet like TEAM problem 20, and random blocks."""

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet

from benchmarks.problems.magnets_in_space import blocks
from kohonen_adapt.magnetostatics import Coil, Froehlich, Goal, MagneticScalarPotential, Material

AIR, STEEL = Material(), Material(bh=Froehlich(2000.0, 1.9))
YOKE = (
    ((0.0, 0.0, 0.0), (0.0635, 0.0125, 0.025)),
    ((0.0385, 0.0, 0.025), (0.0635, 0.0125, 0.125)),
    ((0.0135, 0.0, 0.125), (0.0635, 0.0125, 0.15)),
)
POLE = ((0.0, 0.0, 0.0265), (0.0125, 0.005, 0.125))
FAR = 0.25
PARTS = {"iron": ((-0.5, -0.5, -0.5), (0.5, 0.0, 0.5)), "block": ((-0.5, 0.5, -0.5), (0.0, 1.0, 0.5))}


def electromagnet(cells: int) -> MeshTet:
    """A quarter, x, y >= 0, with cells so many times finer than the coarsest."""
    x = axis([0.0, 0.0125, 0.0135, 0.0385, 0.0635], [2, 1, 3, 2], cells, above=5)
    y = axis([0.0, 0.005, 0.0125], [1, 1], cells, above=6)
    z = axis([0.0, 0.025, 0.0265, 0.125, 0.15], [2, 1, 6, 2], cells, below=5, above=5)
    mesh = blocks([x, y, z], {"pole": POLE})
    middle = mesh.p[:, mesh.t].mean(axis=1)
    yoke = np.any([inside(middle, *part) for part in YOKE], axis=0)
    pole = inside(middle, *POLE)
    parts = {"yoke": yoke, "pole": pole, "air": ~yoke & ~pole}
    mesh = MeshTet(mesh.p, mesh.t).with_subdomains({name: np.flatnonzero(part) for name, part in parts.items()})
    planes = {"x": lambda p: p[0] < 1e-9, "y": lambda p: p[1] < 1e-9}
    far = {"far": lambda p: np.any([p[0] > x[-1] - 1e-9, p[1] > y[-1] - 1e-9, np.abs(p[2] - 0.075) > FAR], axis=0)}
    return mesh.with_boundaries(planes | far)


def axis(marks: list[float], counts: list[int], cells: int, below: int = 0, above: int = 0) -> NDArray[np.float64]:
    """Even steps between marks, growing ones beyond."""
    inner = [np.linspace(a, b, cells * n + 1)[:-1] for a, b, n in zip(marks[:-1], marks[1:], counts, strict=True)]
    step = (marks[-1] - marks[-2]) / (cells * counts[-1])
    far = 0.01 + FAR  # beyond the marks, so that the winding ends far from the boundary
    out = [step * (np.geomspace(1.0, 1.0 + far / step, cells * n + 1)[1:] - 1.0) for n in (below, above)]
    return np.concatenate([marks[0] - out[0][::-1], *inner, marks[-1:], marks[-1] + out[1]])


def inside(x: NDArray[np.float64], low: tuple[float, ...], high: tuple[float, ...]) -> NDArray[np.bool_]:
    start, end = np.array(low), np.array(high)
    return np.all(np.abs(2.0 * x.T - start - end) < end - start, axis=1)


def electromagnet_problem(ampere_turns: float) -> MagneticScalarPotential:
    """The winding is that of TEAM problem 20, around the pole."""
    coil = Coil.racetrack((0.0, 0.0, 0.075), (0.0, 0.0, 1.0), 0.057, 0.057, 0.014, (0.018, 0.0966), ampere_turns)
    symmetry = {"x": "parallel", "y": "parallel"}
    materials = {"yoke": STEEL, "pole": STEEL, "air": AIR}
    return MagneticScalarPotential(materials, {"far": 0.0}, coils={"winding": coil}, symmetry=symmetry)


def random_blocks(seed: int, cells: int = 8) -> MeshTet:
    """Two blocks in a box of air, with nodes off their planes moved at random."""
    rng, t = np.random.default_rng(seed), np.linspace(-1.0, 1.0, cells + 1)
    mesh = blocks([t, np.linspace(-1.5, 1.5, 3 * cells // 2 + 1), t], PARTS)
    p = mesh.p.copy()
    on = np.abs(p[:, :, None] - np.array([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5])).min(axis=2) < 1e-9
    p += np.where(on, 0.0, rng.uniform(-0.5, 0.5, p.shape) / cells)
    return MeshTet(p, mesh.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)


def random_problem(seed: int) -> MagneticScalarPotential:
    """A coil above, beside or around the blocks, and materials and conditions at random."""
    rng = np.random.default_rng(seed)
    current, tilt = 10.0 ** rng.uniform(2.0, 5.5), (*rng.uniform(-0.2, 0.2, 2), 1.0)
    coil = [
        Coil.circular((0.1, 0.2, 0.75), tilt, 0.5, (0.1, 0.15), current),
        Coil.circular((0.4, 0.6, 0.0), tilt, 0.25, (0.1, 0.2), current),
        Coil.racetrack((0.0, 0.2, 0.02), (0.0, 0.0, 1.0), 1.7, 2.2, 0.2, (0.1, 0.3), current),
        Coil.racetrack((0.0, 0.0, 1.4), tilt, 1.2, 0.8, 0.1, (0.1, 0.1), current),  # outside the mesh
    ][rng.integers(4)]
    return MagneticScalarPotential(*random_media(rng), applied_field=coil.field_strength)


def random_media(rng: np.random.Generator) -> tuple[dict[str, Material], dict[str, float]]:
    """Materials and potentials of the blocks."""
    remanence = tuple(rng.normal(size=3))
    iron = [Material(1000.0), STEEL][rng.integers(2)]
    block = [
        Material(1.05, remanence=remanence),
        Material(1.0, remanence=remanence),
        Material(50.0),
        Material(bh=Froehlich(2000.0, 1.9), coercivity=tuple(1e4 * rng.normal(size=3))),
    ][rng.integers(4)]
    potential = [{}, {"outer": 0.0}, {"z-": 0.0}, {"z-": 0.0, "z+": 0.0}][rng.integers(4)]
    return {"iron": iron, "block": block, "air": AIR}, potential


def gapped_ring(cells: int) -> MeshTet:
    """A quarter, y, z >= 0, of a square ring of iron with a gap of 4 mm in the limb opposite to the winding."""
    x = axis([0.0, 0.02, 0.08, 0.1], [2, 3, 2], cells, below=5, above=5)
    y, z = axis([0.0, 0.01], [1], cells, above=6), axis([0.0, 0.002, 0.04, 0.06], [1, 4, 2], cells, above=5)
    mesh = blocks([x, y, z], {"iron": ((0.0, 0.0, 0.0), (0.1, 0.01, 0.06))})
    middle = mesh.p[:, mesh.t].mean(axis=1)
    window, gap = (np.abs(middle[0] - 0.05) < 0.03) & (middle[2] < 0.04), (middle[0] > 0.05) & (middle[2] < 0.002)
    iron = inside(middle, (0.0, 0.0, 0.0), (0.1, 0.01, 0.06)) & ~window & ~gap
    mesh = MeshTet(mesh.p, mesh.t).with_subdomains({"iron": np.flatnonzero(iron), "air": np.flatnonzero(~iron)})
    planes = {"y": lambda p: p[1] < 1e-9, "z": lambda p: p[2] < 1e-9}
    low, high = np.array([x[0], -np.inf, -np.inf]), np.array([x[-1], y[-1], z[-1]])
    far = {"far": lambda p: np.any((low + 1e-9 > p.T) | (high - 1e-9 < p.T), axis=1)}
    return mesh.with_boundaries(planes | far)


def ring_problem(goal: Goal | None = None) -> MagneticScalarPotential:
    coil = Coil.straight_limb((0.01, 0.0, 0.0), (0.0, 0.0, 1.0), (0.022, 0.022), (0.01, 0.06), 1000.0)
    symmetry, materials = {"y": "parallel", "z": "normal"}, {"iron": Material(1000.0), "air": AIR}
    return MagneticScalarPotential(materials, {"far": 0.0}, coils={"winding": coil}, symmetry=symmetry, goal=goal)


def energy_beyond(mesh: MeshTet, coil: Coil, centre: tuple[float, float, float]) -> float:
    """``int mu0 Hs^2`` of a coil outside a mesh, by cones over its far facets from a centre in all planes."""
    corners = mesh.p[:, mesh.facets[:, np.asarray(mesh.boundaries["far"])]] - np.array(centre)[:, None, None]
    a, b, c = np.moveaxis(corners, 1, 0)
    size = np.abs(np.sum(np.cross(b - a, c - a, axis=0) * a, axis=0)) / 2.0
    points, weights = np.polynomial.legendre.leggauss(6)
    total = 0.0
    for inner in 1.0 / 6.0 + 0.5 * np.eye(3):
        x = np.einsum("i,cin->cn", inner, corners)
        for u, weight in zip(0.5 * (1.0 + points), 0.5 * weights, strict=True):
            field = coil.field_strength(x / u + np.array(centre)[:, None])
            total += weight / u**4 * float(np.sum(size / 3.0 * np.sum(field**2, axis=0)))
    return 4e-7 * np.pi * total
