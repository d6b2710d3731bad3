"""Both potentials in space: bounds of an inductance, fluxes in thin plates, times and steps of solutions.

A square frame of iron with a coil around one limb, half of it, and the thin plates of a saturated circuit. The field of
the coils without iron is T0, constant in blocks: along the bore, and falling in two steps across the winding. Stated as
a coercivity it is exact in every element. On meshes without the surfaces of the winding the frame has a `Coil`.
"""

import logging
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import (
    Bracket,
    Coil,
    Froehlich,
    MagneticScalarPotential,
    MagneticVectorPotential,
    Material,
    bracket,
)

AMPERE_TURNS = 1000.0
HALF = 0.025  # half the length of the coils along z, in m
T0 = AMPERE_TURNS / (2.0 * HALF)
STEPS = {"bore": 1.0, "ring 1": 0.75, "ring 2": 0.25}  # fractions of T0
STEEL = Froehlich(permeability=2000.0, saturation=2.0)
Box = tuple[tuple[float, float, float], tuple[float, float, float]]
WIDTHS = {3_500: 0.01, 15_000: 0.005}
MESHES = 50
LEAST_TIME = 2.0  # s of repeated solutions, the quickest of which counts
FLOORS: tuple[Any, ...] = ("auto", 0.02)  # elements as thin as the plates are below the first
TARGET_OF_FLUX, TARGET_OF_TIME, TARGET_OF_EFFECTIVITY = 0.025, 1.5, 1.5


def report(quick: bool) -> str:
    parts, meshes = list[str](), list[MeshTet]()
    for name, problem in PROBLEMS.items():
        start = frame(0.02, wound=name == "T0")
        driven = replace(problem, estimator="bracket")
        found = {nodes: adapted(start, driven, nodes) for nodes in list(WIDTHS)[: 1 if quick else None]}
        reference = adapted(start, problem, 8_000 if quick else 30_000)
        parts.append(bounds(name, found, reference, 5 if quick else MESHES))
        meshes = [each.scalar.mesh for each in found.values()]
    return "\n\n".join([*parts, fluxes(quick), solutions(meshes)])


def bounds(name: str, found: Mapping[int, Bracket], reference: Bracket, count: int) -> str:
    """Inductance for one turn of the whole frame, in uH."""
    rows, exact = list[list[Cell]](), float(np.mean(inductance(reference)))
    for each, target in ((reference, None), *((each, WIDTHS[nodes]) for nodes, each in found.items())):
        low, high = inductance(each)
        change = 4e6 * abs(each.source_error) / AMPERE_TURNS**2 / high
        effectivity = None if target is None else float(np.sqrt((high - low) / (high - exact)))
        rows.append([each.scalar.mesh.nvertices, low, high, 2.0 * (high - low) / (high + low), target, change])
        rows[-1] += [effectivity, TARGET_OF_EFFECTIVITY]
    held = 0
    for seed in range(count):
        low, high = inductance(bracketed(PROBLEMS[name], jittered(seed, name)))
        held += low <= exact <= high
    titles = [f"inductance by {name} in uH: nodes", "lower", "upper", "width", "target", "by currents"]
    table = aligned([*titles, "bound / error of the scalar potential", "target"], rows)
    return f"{table}\nThe bracket holds the middle of the first on {held} of {count} coarse meshes."


def bracketed(problem: MagneticScalarPotential, mesh: MeshTet) -> Bracket:
    return bracket(mesh, problem.materials, problem.potential, symmetry=problem.symmetry, coils=problem.coils)


def refined(mesh: MeshTet) -> MeshTet:
    return with_sides(mesh.refined())


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


def fluxes(quick: bool) -> str:
    """Error of the fluxes through sections of thin plates, relative to the largest, against a fine mesh."""
    problem, coarse = vector_problem(), plates(3.2 if quick else 2.1)
    scalar = MagneticScalarPotential(problem.materials, problem.potential, order=1)
    fine = problem.solve(plates(1.6 if quick else 1.0))
    fields = {"scalar potential": scalar.solve(coarse), "edge elements": problem.solve(coarse)}
    for floor in () if quick else FLOORS:
        mesh = ka.adapt(plates(8.0), scalar, target_nodes=10_000, passes=4, min_quality=floor).mesh
        fields[f"adapted, min_quality={floor}"] = problem.solve(mesh)
    largest = max(abs(fine.flux(name)) for name in SECTIONS)
    rows: list[list[Cell]] = []
    for kind, field in fields.items():
        off = [abs(field.flux(name) - fine.flux(name)) / largest for name in SECTIONS]
        target = None if kind == "scalar potential" else TARGET_OF_FLUX
        rows.append([kind, field.mesh.nvertices, float(np.mean(off)), float(np.max(off)), target])
    return aligned(["fluxes of 10 sections", "nodes", "mean error", "largest", "target"], rows)


SECTIONS = {  # axis, position in mm
    **{f"limb {z}": (2, z) for z in (-40, -20, 0, 20, 40)},
    **{f"far {z}": (2, z) for z in (-40, -20, 20, 40)},
    "top": (0, 50),
}


def plates(factor: float) -> MeshTet:
    """Plates 3.2 mm thick in a square, with a gap of 4 mm in the far limb, and the coil around the near one."""
    thick = 3.2
    limb, far = box(0, thick, -20, 20, -60, 60), box(90, 90 + thick, -20, 20, -60, 60)
    joined = [box(0, 90 + thick, -20, 20, 60, 60 + thick), box(0, 90 + thick, -20, 20, -60 - thick, -60)]
    gap, coil = box(0, 200, -50, 50, -2, 2), {"bore": (6, 26), "ring 1": (12, 32), "ring 2": (18, 38)}
    sides = [0.0, thick, 50.0, 90.0, 90.0 + thick]
    marks = (
        [-18, -12, -6, *sides[:2], 6 + thick, 12 + thick, 18 + thick, *sides[2:]],
        [-38, -32, -26, -20, 20, 26, 32, 38],
        [-60 - thick, -60, -40, -25, -20, -2, 0, 2, 20, 25, 40, 60, 60 + thick],
    )
    axes = [graded(1e-3 * np.array(each, dtype=float), 4e-3 * factor, 0.2, 4, 0.0, False) for each in marks]
    axes = [refined_in_plates(axis, k, thick * 1e-3, 2 if factor < 2.0 else 1) for k, axis in enumerate(axes)]
    mesh = MeshTet.init_tensor(*axes)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    names = np.full(mesh.nelements, "air", dtype=object)
    for name, (x, y) in reversed(coil.items()):
        names[is_in(middle, box(-x, x + thick, -y, y, -25, 25))] = name
    iron = np.any([is_in(middle, each) for each in (limb, far, *joined)], axis=0)
    iron &= ~(is_in(middle, gap) & (middle[0] > 0.05))
    names[iron & (names == "bore")] = "iron in coil"
    names[iron & (names == "air")] = "iron"
    return with_sections(named(mesh, names))


def refined_in_plates(axis: np.ndarray, k: int, thick: float, cells: int) -> np.ndarray:
    """Planes inside every plate across the axis, so that it has as many cells."""
    starts = ((0.0, 0.09), (), (-0.06 - thick, 0.06))[k]
    return np.unique(np.concatenate([axis, *(start + thick * np.arange(1, cells) / cells for start in starts)]))


def with_sections(mesh: MeshTet) -> MeshTet:
    iron = np.concatenate([mesh.subdomains[name] for name in ("iron", "iron in coil")])
    of_iron = np.unique(mesh.t2f[:, iron])
    middle = mesh.p[:, mesh.facets[:, of_iron]]
    found = dict(mesh.boundaries)
    for name, (axis, position) in SECTIONS.items():
        on = np.all(np.abs(middle[axis] - 1e-3 * position) < 1e-9, axis=0)
        side = middle[0].mean(axis=0) > 0.05
        wanted = side if name.startswith("far") else ~side if name.startswith("limb") else middle[2].mean(axis=0) > 0.0
        found[name] = of_iron[on & wanted]
    return mesh.with_boundaries(found)


def vector_problem() -> MagneticVectorPotential:
    iron = Material(bh=STEEL)
    materials = frame_materials() | {"iron": iron, "iron in coil": replace(iron, coercivity=(0.0, 0.0, T0))}
    return MagneticVectorPotential(materials, {"outer": 0.0})


class Auxiliary(MagneticVectorPotential):
    solver = replace(MagneticVectorPotential.solver, large=0)


class Sweeps(MagneticVectorPotential):
    solver = replace(MagneticVectorPotential.solver, large=10**9)


def solutions(meshes: Sequence[MeshTet]) -> str:
    """Processor time of one solution relative to that of the scalar potential, and steps of conjugate gradients."""
    steel = Material(bh=STEEL)
    saturated = replace(PROBLEMS["coil"], materials={"iron": steel, "air": Material()})
    rows: list[list[Cell]] = []
    for name, problem in {"linear": PROBLEMS["coil"], "saturated": saturated}.items():
        for mesh in meshes:
            scalar = seconds(partial(problem.solve, mesh))
            row: list[Cell] = [name, mesh.nvertices, mesh.edges.shape[1], scalar]
            for kind in (Sweeps, Auxiliary):
                vector = kind(problem.materials, *OUTSIDE, coils=problem.coils)
                steps, spent = steps_of(partial(vector.solve, mesh))
                row += [steps, spent / scalar]
            rows.append([*row, TARGET_OF_TIME])
    titles = ["iron", "nodes", "edges", "scalar s", "steps, sweeps", "time ratio", "steps, auxiliary", "time ratio"]
    return aligned([*titles, "target"], rows)


def million(quick: bool) -> str:
    """One solution on a million edges, beside one on ten thousand; `quick` is without it."""
    problem, start = PROBLEMS["coil"], frame(0.02, wound=False)
    meshes = [start if quick else refined(ka.adapt(start, problem, target_nodes=19_400, passes=4).mesh)]
    rows: list[list[Cell]] = []
    for mesh in (start, *meshes):
        scalar = seconds(partial(problem.solve, mesh), 1)
        steps, spent = steps_of(partial(problem.vector_potential.solve, mesh), 1)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2.0**20
        rows.append([mesh.nvertices, mesh.edges.shape[1], steps, spent, spent / scalar, memory])
    return aligned(["one solution: nodes", "edges", "steps", "seconds", "time ratio", "peak memory in GiB"], rows)


def seconds(solve: Callable[[], Any], repeats: int = 2) -> float:
    spent = list[float]()
    while len(spent) < repeats or sum(spent) < LEAST_TIME:
        start = time.process_time()
        solve()
        spent.append(time.process_time() - start)
    return min(spent)


def steps_of(solve: Callable[[], Any], repeats: int = 2) -> tuple[int, float]:
    logger, found = logging.getLogger("kohonen_adapt"), list[int]()

    class Steps(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.msg.startswith("Conjugate gradients") and isinstance(record.args, tuple):
                found.append(int(record.args[0]))  # type: ignore[call-overload]

    handler, level = Steps(logging.DEBUG), logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    try:
        spent = seconds(solve, repeats)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
    return max(found), spent
