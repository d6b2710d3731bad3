"""A hash of what a dozen runs give, so that a change meant to change no result can be seen to change none.

The bits depend on the machine's type of CPU and on the versions of its libraries: compare two commits on one machine.
Where a change sums in another order the bits change, and with them the ways of nodes. What must stay then are numbers
of the input meshes, before any node moves: `closeness` compares them with those that it wrote before the change.
"""

import json
import tempfile
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.c_core import CCore, c_core_mesh
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.solids import BUMP, EDGE, FICHERA
from benchmarks.problems.square_magnet import SquareMagnet, magnet_mesh
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material

EXAMPLES = Path(__file__).parents[2] / "examples"
AIR, IRON = Material(), Material(permeability=1000.0)
SATURATING = Material(bh=Froehlich(permeability=2000.0, saturation=1.9))
MAGNET = Material(permeability=1.05, remanence=(0.0, 1.2))
MOTOR = {
    **dict.fromkeys(("stator", "rotor"), IRON),
    **dict.fromkeys(("slot_air", "gap", "rotor_air"), AIR),
    "magnet": MAGNET,
    "coil_a_plus": Material(current_density=-4e6),
    "coil_b_minus": Material(current_density=-2e6),
    "coil_c_minus": Material(current_density=-2e6),
}


def report(seeds: Sequence[int], quick: bool) -> str:
    """The runs with their hashes, each of the mesh and of every number of every pass; the quick ones alone if asked."""
    rows = [[name, fingerprint(run())] for name, run in RUNS.items() if not (quick and name in SLOW)]
    return markdown(["run", "hash"], rows)


def closeness(file: Path, quick: bool) -> str:
    """Write the numbers of input meshes to a new file; to a file of before compare them.

    Raises
    ------
    ValueError
        If a number differs by more than 1e-9 of its size from that in the file.
    """
    found = {name: numbers_of_input(run()) for name, run in RUNS.items() if not (quick and name in SLOW)}
    if not file.exists():
        file.write_text(json.dumps(found, indent=1), encoding="utf-8")
        return f"numbers of {len(found)} input meshes written to {file}"
    before = json.loads(file.read_text(encoding="utf-8"))
    rows: list[list[Cell]] = []
    for name, now in found.items():
        known = np.array(before[name])
        size = np.maximum(np.abs(known), 1e-6 * np.max(np.abs(known), initial=0.0))  # what is zero but for rounding
        rows.append([name, len(now), float(np.max(np.abs(np.array(now) - known) / size, initial=0.0))])
    text = markdown(["run", "numbers", "largest relative change"], rows)
    if max(row[2] for row in rows) > 1e-9:
        raise ValueError(f"numbers of input meshes changed:\n{text}")
    return text


def numbers_of_input(result: ka.AdaptResult | MeshTri) -> list[float]:
    """Return estimate, norm, functional, indicators and outputs before any node moves; none of a map by itself."""
    if not isinstance(result, ka.AdaptResult):
        return []
    first = result.history[0]
    known = [number for number in (first.estimate, first.energy_norm, first.functional) if number is not None]
    return [float(number) for number in (*known, *first.indicators, *first.outputs.values())]


def fingerprint(result: ka.AdaptResult | MeshTri) -> str:
    """Return the hash of a mesh with its names, or of every pass of a result with its status."""
    found = sha256()
    if isinstance(result, ka.AdaptResult):
        for step in result.history:
            numbers = (step.estimate, step.energy_norm or 0.0, step.functional or 0.0, step.polish_gain)
            counts = (step.collapses, step.splits, step.max_displacement, *step.quantization_errors)
            _hear(found, np.array([*numbers, *counts, *step.outputs.values()]))
            _hear_mesh(found, step.mesh)
        _hear(found, result.indicators, result.nodes)
        found.update(str(result.status).encode())
        result = result.mesh
    _hear_mesh(found, result)
    return found.hexdigest()[:16]


def _hear_mesh(found: Any, mesh: MeshTri) -> None:
    _hear(found, mesh.p, mesh.t)
    for names in (mesh.boundaries or {}, mesh.subdomains or {}):
        for name in sorted(names):
            found.update(name.encode())
            _hear(found, np.sort(np.asarray(names[name])))


def _hear(found: Any, *arrays: np.ndarray) -> None:
    for array in arrays:
        kind = np.float64 if array.dtype.kind == "f" else np.int64
        found.update(np.ascontiguousarray(array, dtype=kind).tobytes())


def _l_shape(**options: Any) -> ka.AdaptResult:
    return ka.adapt(l_shaped_mesh(16), LShape(), passes=3, **options)


def _motor() -> ka.AdaptResult:
    """One pole, its sides antiperiodic, with a layer of elements kept in the gap."""
    sides = [("right", "left")]
    problem = Magnetostatics(MOTOR, potential={"outer": 0.0, "inner": 0.0}, antiperiodic=sides, order=1)
    mesh = ka.read_mesh(EXAMPLES / "motor.msh")
    torque = {"torque": lambda field: field.torque(["rotor", "magnet"])}
    return ka.adapt(mesh, problem, passes=2, periodic=sides, layers={"gap": 1}, outputs=torque)


def _actuator() -> ka.AdaptResult:
    """A plunger around its axis, its iron saturating."""
    parts = {"core": SATURATING, "plunger": SATURATING, "coil": AIR, "air": AIR}
    problem = Magnetostatics(parts, potential={"outer": 0.0}, ampere_turns={"coil": 1500.0}, axisymmetric=True, order=1)
    mesh = ka.read_mesh(EXAMPLES / "actuator_1.msh", scale=1e-3)
    return ka.adapt(mesh, problem, passes=2, outputs={"force": lambda field: field.force("plunger")[1]})


def _saturated() -> ka.AdaptResult:
    problem = Magnetostatics({"iron": SATURATING, "magnet": MAGNET, "air": AIR}, potential={"outer": 0.0}, order=1)
    return ka.adapt(c_core_mesh("c_core.msh"), problem, passes=3)


def _quadratic() -> ka.AdaptResult:
    materials = {"iron": IRON, "magnet": MAGNET, "air": AIR}
    problem = Magnetostatics(materials, potential={"outer": 0.0}, order=2)
    return ka.adapt(c_core_mesh("c_core.msh"), problem, passes=2)


def _recovery() -> ka.AdaptResult:
    """Adapt the C-core at its number of nodes by the recovery estimate, with a tolerance out of reach."""
    materials = {"iron": IRON, "magnet": MAGNET, "air": AIR}
    problem = Magnetostatics(materials, potential={"outer": 0.0}, estimator="recovery")
    mesh = c_core_mesh("c_core.msh")
    return ka.adapt(mesh, problem, passes=2, rtol=1e-6, target_nodes=mesh.nvertices)


def _grown() -> ka.AdaptResult:
    return ka.adapt(c_core_mesh("c_core.msh"), CCore(), passes=3, target_nodes=1800, pinned=["magnet"])


def _resumed() -> ka.AdaptResult:
    """Cut short after its first pass, and gone on with from its files."""
    with tempfile.TemporaryDirectory() as folder:
        options = {"passes": 3, "checkpoint": folder}
        ka.adapt(magnet_mesh(20, True), SquareMagnet(True), callback=lambda step: step.number == 1, **options)
        return ka.adapt(magnet_mesh(20, True), SquareMagnet(True), **options)


def _ring_mesh() -> MeshTri:
    """An annulus with a circle inside it, which are recognised, and a straight cut."""
    radius, angle = np.meshgrid(np.linspace(0.5, 1.5, 9), np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)]).reshape(2, -1)
    number = np.arange(48 * 9).reshape(48, 9)
    a, b = number[:, :-1].ravel(), number[:, 1:].ravel()
    c, d = np.roll(number, -1, axis=0)[:, :-1].ravel(), np.roll(number, -1, axis=0)[:, 1:].ravel()
    mesh = MeshTri(points, np.concatenate([np.stack([a, b, c]), np.stack([b, d, c])], axis=1))
    mesh = mesh.with_subdomains({"core": lambda x: np.hypot(*x) < 1.0, "shell": lambda x: np.hypot(*x) > 1.0})
    return mesh.with_boundaries({"inner": lambda x: np.hypot(*x) < 0.55, "outer": lambda x: np.hypot(*x) > 1.45})


def _curves(topology: str) -> MeshTri:
    """A ring relocated on its circles, one of them given."""
    return ka.relocate(
        _ring_mesh(),
        lambda x: 1.0 / (0.1 + (x[0] - 1.0) ** 2 + x[1] ** 2),
        topology=topology,
        curves={"outer": ka.Arc((0.0, 0.0), 1.5)},
        seed=3,
    )


def _periodic() -> MeshTri:
    """A square with matched sides and two layers in a strip of it."""
    ticks = np.linspace(0.0, 1.0, 21)
    mesh = MeshTri.init_tensor(ticks, ticks).with_subdomains(
        {"strip": lambda x: np.abs(x[1] - 0.5) < 0.1, "rest": lambda x: np.abs(x[1] - 0.5) > 0.1}
    )
    mesh = mesh.with_boundaries({"left": lambda x: x[0] == 0.0, "right": lambda x: x[0] == 1.0})
    density = np.exp(-20.0 * np.sum((mesh.p[:, mesh.t].mean(axis=1) - 0.5) ** 2, axis=0))
    return ka.relocate(mesh, density, periodic=[("left", "right")], layers={"strip": 2}, seed=1)


def _paper() -> MeshTri:
    """The paper's schedule, guarded."""
    som = ka.KohonenMap(l_shaped_mesh(8), topology="fixed")
    som.train(lambda number, rng: (0.999 * rng.random((2, number)) ** 2 - [[1.0], [0.0]], None), ka.Schedule.paper())
    return som.mesh


RUNS: dict[str, Callable[[], ka.AdaptResult | MeshTri]] = {
    "L, recycle": _l_shape,
    "L, flip, seed 1": lambda: _l_shape(topology="flip", seed=1),
    "L, fixed, no polish": lambda: _l_shape(topology="fixed", polish=False),
    "M over iron": lambda: ka.adapt(magnet_mesh(20, True), SquareMagnet(True), passes=3),
    "C-core": lambda: ka.adapt(c_core_mesh("c_core.msh"), CCore()),
    "C-core, saturated": _saturated,
    "C-core, order 2": _quadratic,
    "C-core, recovery": _recovery,
    "C-core, grown and pinned": _grown,
    "M, resumed": _resumed,
    "motor, pairs and layers": _motor,
    "actuator around its axis": _actuator,
    "ring on curves, flip": lambda: _curves("flip"),
    "ring on curves, recycle": lambda: _curves("recycle"),
    "square, pairs and layers": _periodic,
    "L, polish alone": lambda: ka.polish(l_shaped_mesh(16), LShape()),
    "L, the paper's map": _paper,
    "E in space": lambda: ka.adapt(EDGE.mesh(5), EDGE, passes=3),
    "F in space, grown": lambda: ka.adapt(FICHERA.mesh(2), FICHERA, passes=3, target_nodes=400),
    "B in space, no polish": lambda: ka.adapt(BUMP.mesh(8), BUMP, passes=2),
}
SLOW = ("motor, pairs and layers", "actuator around its axis")
