"""Compare energies, forces and fluxes of adapted meshes with NGSolve's P3 elements on the same polygon."""

import runpy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.peers.ngsolve_field import NgsolveField
from benchmarks.table import markdown
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material

EXAMPLES = Path(__file__).parents[2] / "examples"
ORDER = 3
LINEAR, SATURATING = Material(1000.0), Material(bh=Froehlich(2000.0, 0.8))
GAP = np.array([[0.015, 0.030], [0.0, 0.0]])  # m, ends of a line across the flux in the gap of the C-core


@dataclass(frozen=True)
class Device:
    """A problem, its start mesh, its output besides the energies, of a field and by the oracle, options of `adapt`."""

    name: str
    mesh: MeshTri
    problem: Magnetostatics
    output: str
    ours: Callable[[Any], float]
    theirs: Callable[[NgsolveField], float]
    options: dict[str, Any] = field(default_factory=dict)


def c_core(iron: Material, name: str) -> Device:
    """The C-core of the examples, and the flux in its gap in Wb/m."""
    materials = {"iron": iron, "magnet": Material(1.05, remanence=(0.0, 1.2)), "air": Material()}
    return Device(
        name,
        ka.read_mesh(EXAMPLES / "c_core.msh", scale=1e-3),
        Magnetostatics(materials, potential={"outer": 0.0}, order=1),
        "flux in the gap (Wb/m)",
        lambda solution: float(np.diff(solution.potential_at(GAP))[0]),
        lambda oracle: float(np.diff(oracle.potential_at(GAP))[0]),
    )


def motor() -> Device:
    """The motor of the examples, and the torque of a pole."""
    example, body = runpy.run_path(str(EXAMPLES / "motor.py")), ["rotor", "magnet"]
    return Device(
        "motor",
        ka.read_mesh(EXAMPLES / "motor.msh", scale=1e-3),
        example["sector"](example["materials"]()),
        "torque (N m/m)",
        lambda solution: solution.torque(body),
        lambda oracle: oracle.torque(body),
        {"periodic": [("left", "right")], "layers": {"gap": 2}},
    )


def actuator() -> Device:
    """The actuator of the examples at its smallest gap, and the force on its plunger."""
    return Device(
        "actuator",
        ka.read_mesh(EXAMPLES / "actuator_1.msh", scale=1e-3),
        replace(runpy.run_path(str(EXAMPLES / "actuator.py"))["PROBLEM"], order=1),
        "force (N)",
        lambda solution: float(solution.force("plunger")[1]),
        lambda oracle: float(oracle.force(["plunger"])[1]),
    )


def devices() -> list[Device]:
    """All that are compared."""
    return [c_core(LINEAR, "C-core"), c_core(SATURATING, "C-core, saturating"), motor(), actuator()]


def compared(device: Device, seed: int = 0) -> list[list[str | float]]:
    """Rows of energy, co-energy and output: this package, NGSolve, their difference and what it should be, in %.

    Co-energies should differ by half the square of the estimate, to first order, and energies by about as much; outputs
    at most by the share of the estimate in the energy norm.
    """
    result = ka.adapt(device.mesh, device.problem, seed=seed, **device.options)
    solution, oracle = result.solution, NgsolveField(result.mesh, device.problem, ORDER)
    missing = 0.5 * result.estimate**2
    share = result.estimate / device.problem.energy_norm(result.mesh, solution)
    values = [
        ("energy", solution.energy, oracle.energy, missing / abs(oracle.energy)),
        ("co-energy", solution.coenergy, oracle.coenergy, missing / abs(oracle.coenergy)),
        (device.output, device.ours(solution), device.theirs(oracle), share),
    ]
    return [
        [f"{device.name}, {name}", ours, theirs, 100 * (ours / theirs - 1), 100 * expected]
        for name, ours, theirs, expected in values
    ]


def report(seeds: Sequence[int], quick: bool) -> str:
    """Every device on its adapted mesh, by this package in P1 and by NGSolve in P3 elements."""
    try:
        import ngsolve  # noqa: F401
    except ImportError as error:
        return f"oracle: NGSolve cannot be imported ({error}); install the extra 'bench'."
    chosen = devices()[:1] if quick else devices()
    rows = [row for device in chosen for row in compared(device, seeds[0])]
    return markdown(["oracle", "P1, adapted", "NGSolve, P3", "difference %", "expected %"], rows)
