"""Hold forces in space, adapted at orders 1 and 2, against finer meshes and closed forms."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.closed_forces import ClosedForm, closed_forms
from benchmarks.problems.magnets_in_space import blocks, graded
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Force, Froehlich, MagneticScalarPotential, Material
from kohonen_adapt.problem.uncertain import corrected, error_of

TOLERANCES = (0.03, 0.01, 0.003)
STEP, FAR, LAYERS = 0.01, 0.06, 4  # of the coarse meshes, m
REFERENCE = 8000  # nodes at order 2
MOST = 40_000  # nodes
PASSES = (0, 1, 3)

Block = tuple[tuple[float, float, float], tuple[float, float, float]]  # opposite corners, m
POLE: Block = ((-0.01, -0.01, 0.0), (0.01, 0.01, 0.01))
UPPER: Block = ((-0.006, -0.01, 0.015), (0.014, 0.01, 0.025))
MAGNET, TILTED = Material(remanence=(0.0, 0.0, 1.2)), Material(remanence=(0.3, 0.0, 1.1))


@dataclass(frozen=True)
class Device:
    name: str
    places: Mapping[str, Block]
    materials: Mapping[str, Material]
    force: Force

    def mesh(self) -> MeshTet:
        marks = [sorted({corner[axis] for block in self.places.values() for corner in block}) for axis in range(3)]
        return blocks([graded(each, STEP, FAR, LAYERS) for each in marks], self.places)

    def problem(self, order: int) -> MagneticScalarPotential:
        return MagneticScalarPotential({**self.materials, "air": Material()}, {"outer": 0.0}, order=order)


TWO_MAGNETS = Device(
    "two magnets",
    {"lower": POLE, "upper": UPPER},
    {"lower": MAGNET, "upper": Material(remanence=(0.0, 0.5, 1.0))},
    Force("upper", (0.0, 0.0, 1.0)),
)
DEVICES = (
    Device(
        "magnet over steel",
        {"magnet": POLE, "steel": ((-0.015, -0.015, -0.012), (0.015, 0.015, -0.004))},
        {"magnet": MAGNET, "steel": Material(1000.0)},
        Force("magnet", (0.0, 0.0, 1.0)),
    ),
    Device(
        "over saturated steel",
        {"magnet": POLE, "steel": ((-0.015, -0.015, -0.006), (0.015, 0.015, -0.003))},
        {"magnet": MAGNET, "steel": Material(bh=Froehlich(2000.0, 1.8))},
        Force("steel", (0.0, 0.0, 1.0)),
    ),
    TWO_MAGNETS,
    replace(TWO_MAGNETS, name="two magnets, sideways", force=Force("upper", (1.0, 0.0, 0.0))),
    Device(
        "beside steel",
        {"magnet": POLE, "steel": ((-0.005, -0.012, -0.015), (0.02, 0.012, -0.005))},
        {"magnet": TILTED, "steel": Material(500.0)},
        Force("steel", (1.0, 0.0, 0.0)),
    ),
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors, true and told, and processor seconds; estimates over errors in the energy norm; closed forms."""
    ka.warmup(space=True)
    devices, tolerances = DEVICES[: 2 if quick else None], TOLERANCES[: 2 if quick else None]
    forces, estimates = list[list[Cell]](), list[list[Cell]]()
    for device in devices:
        problem, outputs = device.problem(2), {"force": device.force}
        fine = ka.adapt(device.mesh(), problem, passes=2, target_nodes=REFERENCE, outputs=outputs)
        forces += _force_rows(device, tolerances, fine.best.outputs["force"])
        estimates.append([device.name, *_estimate_cells(device, fine)])
    header = ["force: nodes, true and told error / tol, s", "output_rtol", "order 1", "order 2", "time ratio"]
    tables = [markdown(header, forces)]
    header = ["energy norm, order 2: error %, estimate / error", *(f"{passes} passes" for passes in PASSES)]
    tables.append(markdown(header, estimates))
    header = ["closed forms, order 2", "passes", "forces", "median error %", "median told / true", "least", "greatest"]
    return "\n\n".join([*tables, markdown([*header, "corrected / true"], list(_closed_rows(quick)))])


def _force_rows(device: Device, tolerances: Sequence[float], exact: float) -> Iterator[list[Cell]]:
    mesh, outputs = device.mesh(), {"force": device.force}
    for tolerance in tolerances:
        cells, times = list[str](), list[float]()
        for order in (1, 2):
            began = time.process_time()
            result = ka.adapt(mesh, device.problem(order), outputs=outputs, output_rtol=tolerance, max_nodes=MOST)
            times.append(time.process_time() - began)
            force = result.outputs["force"]
            true, told = abs(exact / force.value - 1.0), abs((force.error or np.nan) / force.value)
            ratios = f"{true / tolerance:.2g}, {told / tolerance:.2g}"
            cells.append(f"{result.mesh.nvertices}, {ratios}, {times[-1]:.2g}")
        yield [device.name, f"{tolerance:g}", *cells, f"{times[1] / times[0]:.2f}"]


def _estimate_cells(device: Device, fine: ka.AdaptResult) -> Iterator[str]:
    # The squared error is twice the distance of the co-energies, and the estimate of the finer mesh is added.
    problem = device.problem(2)
    for passes in PASSES:
        result = ka.adapt(device.mesh(), problem, passes=passes)
        squared = 2.0 * abs(result.solution.coenergy - fine.solution.coenergy) + fine.estimate**2
        error = 100.0 * np.sqrt(squared) / problem.energy_norm(result.mesh, result.solution)
        yield f"{error:.3g}, {result.estimate / np.sqrt(squared):.2f}"


def _closed_rows(quick: bool) -> Iterator[list[Cell]]:
    # Last is the median of what the correction leaves of the error.
    found = dict[tuple[str, int], list[tuple[float, float, float]]]()
    for case in list(closed_forms())[:: 7 if quick else 1]:
        for passes in (0, 2):
            found.setdefault((case.kind, passes), []).append(_against_closed_form(case, passes))
    for (kind, passes), rows in found.items():
        true, ratio, left = np.array(rows).T
        medians = 100.0 * float(np.median(true)), float(np.median(ratio))
        yield [kind, passes, true.size, *medians, float(ratio.min()), float(ratio.max()), float(np.median(left))]


def _against_closed_form(case: ClosedForm, passes: int) -> tuple[float, float, float]:
    result = ka.adapt(case.mesh, case.problem, passes=passes)
    value = case.goal(result.solution)
    error = error_of(value, case.problem.improved(result.mesh, result.solution, {"force": case.goal})["force"])
    true, left = abs(case.exact - value), abs(corrected(value, error, error.doubt) - case.exact)
    return true / case.exact, abs(error) / true, left / true
