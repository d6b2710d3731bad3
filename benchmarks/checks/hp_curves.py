"""Hold order 6 on circles against an exact field, and forces and a torque of order 4 against finer solutions."""

import runpy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.checks.curves import example_mesh, motor_mesh
from benchmarks.problems.c_core import EXAMPLES
from benchmarks.problems.round_magnet import RoundMagnet
from benchmarks.problems.undulator import UPPER, Undulator, attraction
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Field, Force, Goal, Magnetostatics, Torque

SHIFT, RINGS = 0.45, 5  # of the eccentric magnet; nodes on rings: 91
DISK = ((6, 0, 91), (6, 1, 91), (6, 2, 139), (6, 1, 331), (8, 1, 91))  # order, passes, nodes
DISK_TARGET, DISK_UNKNOWNS = 1e-7, 5000
ORDER = 4
COARSE_ARCS = {"steps = 6;": "steps = 2;"}  # facets of a quarter of a circle in examples/actuator.geo
WIDE_AIR = 0.06  # m beyond an array of the undulator; with twice as much the force differs by 1e-10


@dataclass(frozen=True)
class Device:
    """A start mesh, a problem, a goal, its value by a finer solution, and a target in %."""

    name: str
    start: Callable[[], MeshTri]
    problem: Magnetostatics
    goal: Goal
    exact: Callable[[], float]
    target: float


def report(quick: bool) -> str:
    """The eccentric magnet, and the devices."""
    chosen = devices()[1:2] if quick else devices()
    return "\n\n".join([disk(DISK[:2] if quick else DISK), goals(chosen, (1,) if quick else (1, 2))])


def disk(settings: Sequence[tuple[int, int, int]]) -> str:
    """Print errors of the eccentric magnet in the true domain, as parts of the energy norm."""
    given, rows = RoundMagnet(shift=SHIFT), list[list[Cell]]()
    for order, passes, nodes in settings:
        start = given.mesh(RINGS, curved=False)
        target_nodes = nodes if passes else None
        result = ka.adapt(start, given.problem(order), passes=passes, curves=given.curves, target_nodes=target_nodes)
        field = result.solution
        told = result.estimate / given.problem(order).energy_norm(result.mesh, field)
        error, unknowns = true_error(given, field), len(field.values)
        target = f"{DISK_TARGET:g}" if unknowns <= DISK_UNKNOWNS else None
        rows.append([f"p {order}", passes, result.mesh.nvertices, unknowns, f"{error:.2e}", f"{told:.2e}", target])
    return markdown(["eccentric magnet", "passes", "nodes", "unknowns", "error", "told", "target"], rows)


def true_error(given: RoundMagnet, field: Field) -> float:
    """Return the error of B at the points of quadrature, relative to the energy norm."""
    at = field.at_quadrature
    inside = np.isin(at.element, field.mesh.subdomains["magnet"])
    right, up = given.gradient(at.x, inside)
    off = at.flux_density - np.stack([up, -right])
    reluctivity = np.where(inside, 1.0 / given.permeability, 1.0)
    return float(np.sqrt(np.sum(field.point_volumes * reluctivity * np.sum(off**2, axis=0)) / given.norm()))


def goals(chosen: Sequence[Device], passes: Sequence[int]) -> str:
    """Print values after passes for the energy and for the goal, with their errors as told and true."""
    header = ["", "passes", "for", "unknowns", "value", "told %", "error %", "target"]
    return markdown(header, [row for device in chosen for row in _rows(device, passes)])


def _rows(device: Device, passes: Sequence[int]) -> Iterator[list[Cell]]:
    start, exact = device.start(), device.exact()
    energy = replace(device.problem, order=ORDER)
    aimed = replace(energy, goal=device.goal)
    for name, problem in (("energy", energy), ("goal", aimed)):
        for count in passes:
            row: list[Cell] = [device.name, count, name]
            result = ka.adapt(start, problem, passes=count)
            if result.status is ka.Status.FAILED:
                yield [*row, None, "failed", None, None, f"{device.target:g}"]
                continue
            field = result.solution
            value, told = device.goal(field), aimed.goal_error(field)
            figures = [f"{value:.8g}", f"{100.0 * told / exact:.1e}", f"{100.0 * (exact - value) / exact:.1e}"]
            yield [*row, len(field.values), *figures, f"{device.target:g}"]


def devices() -> list[Device]:
    """The motor, the undulator and the actuator of the examples."""
    motor, actuator = (runpy.run_path(str(EXAMPLES / f"{name}.py")) for name in ("motor", "actuator"))
    pole, plunger = motor["sector"](motor["materials"]()), actuator["PROBLEM"]
    torque, pull = Torque(["rotor", "magnet"]), Force("plunger", (0.0, 1.0))
    wide = Undulator(ORDER, WIDE_AIR)

    def finer(mesh: MeshTri, problem: Magnetostatics, goal: Goal, order: int, nodes: int) -> float:
        return goal(ka.adapt(mesh, replace(problem, order=order), passes=2, target_nodes=nodes).solution)

    def drawn() -> MeshTri:
        return example_mesh("actuator", COARSE_ARCS, size=5, gap=1)

    def fine_actuator() -> MeshTri:
        return ka.read_mesh(EXAMPLES / "actuator_1.msh", scale=1e-3)

    return [
        Device(
            "motor, torque (N m/m)",
            lambda: motor_mesh(2.25),
            pole,
            torque,
            lambda: finer(motor_mesh(2.25), pole, torque, 8, 2000),
            1e-3,
        ),
        Device(
            "undulator, force (N/m)",
            lambda: wide.start(0.0),
            wide.problem(0.0),
            Force(UPPER, (0.0, 1.0)),
            lambda: -attraction(),
            1e-3,
        ),
        Device(
            "actuator, force (N)", drawn, plunger, pull, lambda: finer(fine_actuator(), plunger, pull, 6, 1608), 1e-2
        ),
    ]
