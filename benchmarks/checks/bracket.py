"""Bound an inductance by both potentials in space.

Half a square frame of iron with a coil around one limb. The field of the coil without iron is T0, constant in blocks:
along the bore, and falling in two steps across the winding. Stated as a coercivity it is exact in every element. On
meshes without the surfaces of the winding the frame has a `Coil`.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import (
    Bracket,
    Coil,
    MagneticScalarPotential,
    Material,
    bracket,
)

AMPERE_TURNS = 1000.0
HALF = 0.025  # half the length of the coils along z, in m
T0 = AMPERE_TURNS / (2.0 * HALF)
STEPS = {"bore": 1.0, "ring 1": 0.75, "ring 2": 0.25}  # fractions of T0
Box = tuple[tuple[float, float, float], tuple[float, float, float]]
NODES = (3_500, 15_000)
MESHES = 50


def report(seeds: Sequence[int], quick: bool) -> str:
    """Bounds for each source, with the width of the bracket and its ratio to the error of the scalar potential."""
    rows, remarks = list[list[Cell]](), list[str]()
    for name, problem in PROBLEMS.items():
        start = frame(0.02, wound=name == "T0")
        driven = replace(problem, estimator="bracket")
        found = [adapted(start, driven, nodes) for nodes in NODES[: 1 if quick else None]]
        reference = adapted(start, problem, 8_000 if quick else 30_000)
        exact = float(np.mean(inductance(reference)))
        rows += [bounds(name, each, exact if each is not reference else None) for each in (*found, reference)]
        count = 5 if quick else MESHES
        coarse = [inductance(bracketed(problem, jittered(seed, name))) for seed in range(count)]
        held = sum(low <= exact <= high for low, high in coarse)
        remarks.append(f"{name}: the bracket holds the middle of the finest on {held} of {count} coarse meshes.")
    header = ["source", "nodes", "lower, uH", "upper, uH", "width %", "by currents %", "bound / error"]
    return "\n\n".join([markdown(header, rows), *remarks])


def bounds(name: str, found: Bracket, exact: float | None) -> list[Cell]:
    """Inductance for one turn of the whole frame, and the bound over the error of the scalar potential."""
    low, high = inductance(found)
    width, change = 200.0 * (high - low) / (high + low), 4e8 * abs(found.source_error) / AMPERE_TURNS**2 / high
    effectivity = None if exact is None else float(np.sqrt((high - low) / (high - exact)))
    return [name, found.scalar.mesh.nvertices, low, high, width, change, effectivity]


def bracketed(problem: MagneticScalarPotential, mesh: MeshTet) -> Bracket:
    return bracket(mesh, problem.materials, problem.potential, symmetry=problem.symmetry, coils=problem.coils)


def frame_materials(permeability: float = 1000.0) -> dict[str, Material]:
    coil = {name: Material(coercivity=(0.0, 0.0, share * T0)) for name, share in STEPS.items()}
    iron = {"iron in coil": Material(permeability=permeability, coercivity=(0.0, 0.0, T0))}
    return {**coil, **iron, "iron": Material(permeability=permeability), "air": Material()}


def frame(step: float, shift: float = 0.0, wound: bool = True) -> MeshTet:
    """Half a frame: limbs of 20 by 20 mm, the wound one at x = 0, windows of 60 by 60 mm."""
    iron = [box(-10, 90, 0, 10, -50, -30), box(-10, 90, 0, 10, 30, 50), box(-10, 10, 0, 10, -30, 30)]
    iron.append(box(70, 90, 0, 10, -30, 30))
    shells = {name: box(-edge, edge, 0, edge, -25, 25) for name, edge in (("bore", 13), ("ring 1", 18), ("ring 2", 23))}
    marks = [[-23, -18, -13, -10, 10, 13, 18, 23, 70, 90], [0, 10, 13, 18, 23], [-50, -30, -25, 25, 30, 50]]
    if not wound:
        shells, marks = {}, [[-30, -10, 10, 30, 70, 90], [0, 10, 30], [-50, -30, 30, 50]]
    axes = [graded(1e-3 * np.array(each, dtype=float), step, 0.25, 4, shift, k == 1) for k, each in enumerate(marks)]
    mesh = MeshTet.init_tensor(*axes)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    in_iron = np.any([is_in(middle, each) for each in iron], axis=0)
    names = np.full(mesh.nelements, "air", dtype=object)
    for name in reversed(shells):
        names[is_in(middle, shells[name])] = name
    names[in_iron & (names == "bore")] = "iron in coil"
    names[in_iron & (names == "air")] = "iron"
    return named(mesh, names)


def box(*millimetres: float) -> Box:
    return tuple(1e-3 * each for each in millimetres[::2]), tuple(1e-3 * each for each in millimetres[1::2])  # type: ignore[return-value]


def is_in(x: np.ndarray, ends: Box) -> np.ndarray:
    return np.all((x > np.array(ends[0])[:, None]) & (x < np.array(ends[1])[:, None]), axis=0)


def graded(marks: np.ndarray, step: float, far: float, layers: int, shift: float, from_first: bool) -> np.ndarray:
    """Cells of about one size between marks, and growing ones beyond; `shift` moves planes between marks."""
    inner = []
    for k, (a, b) in enumerate(pairwise(marks)):
        count = max(1, round((b - a) / step))
        t = np.arange(count) / count
        t[1:] += shift * 0.3 / count * np.sin(5.0 * (k + 1) + np.arange(1, count))
        inner.append(a + (b - a) * t)
    beyond = step * (np.geomspace(1.0, 1.0 + far / step, layers + 1)[1:] - 1.0)
    before = np.zeros(0) if from_first else marks[0] - beyond[::-1]
    return np.concatenate([before, *inner, marks[-1:], marks[-1] + beyond])


def named(mesh: MeshTet, names: np.ndarray) -> MeshTet:
    return with_sides(mesh.with_subdomains({name: np.flatnonzero(names == name) for name in dict.fromkeys(names)}))


def with_sides(mesh: MeshTet) -> MeshTet:
    """Name the plane y = 0 of half a frame, and all other sides."""
    low, high = mesh.p.min(axis=1)[:, None], mesh.p.max(axis=1)[:, None]
    low[1] = low[1] if low[1] < -1e-9 else -1.0

    def outer(x: np.ndarray) -> np.ndarray:
        return np.any((np.abs(x - low) < 1e-9) | (np.abs(x - high) < 1e-9), axis=0)

    return mesh.with_boundaries({"y": lambda x: np.abs(x[1]) < 1e-9, "outer": outer})


def jittered(seed: int, name: str) -> MeshTet:
    """A coarse mesh of the frame, with another step for every seed, every fifth of them adapted."""
    random = np.random.default_rng(seed)
    mesh = frame(random.uniform(0.01, 0.02), random.uniform(0.0, 1.0), name == "T0")
    return ka.adapt(mesh, PROBLEMS[name], passes=1, seed=seed).mesh if seed % 5 == 0 else mesh


OUTSIDE: Any = ({"outer": 0.0}, None, {"y": "parallel"})
CORNERS = 1e-3 * np.array([[-18.0, 18.0, 18.0, -18.0], [-18.0, -18.0, 18.0, 18.0], [0.0, 0.0, 0.0, 0.0]])
WINDING = Coil(CORNERS, 0.01, 2.0 * HALF, AMPERE_TURNS)
PROBLEMS = {
    "T0": MagneticScalarPotential(frame_materials(), *OUTSIDE, order=1),
    "coil": MagneticScalarPotential(
        {"iron": Material(permeability=1000.0), "air": Material()}, *OUTSIDE, order=1, coils={"winding": WINDING}
    ),
}


def adapted(start: MeshTet, problem: MagneticScalarPotential, nodes: int) -> Bracket:
    return bracketed(problem, ka.adapt(start, problem, target_nodes=nodes, passes=4).mesh)


def inductance(found: Bracket) -> tuple[float, float]:
    """Of the whole frame for one turn: twice 2 W / (ampere turns)^2, with ``int |B|^2 / (2 mu)`` as W, in uH."""
    coefficients = found.scalar.coefficients
    rest = float(
        found.scalar.volume @ coefficients.law_coenergy(np.linalg.norm(coefficients.coercivity, axis=0)[None])[0]
    )
    return tuple(4e6 * (bound + rest) / AMPERE_TURNS**2 for bound in (found.lower, found.upper))  # type: ignore[return-value]
