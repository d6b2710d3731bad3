"""Hold forces in space, adapted to a tolerance at orders 1 and 2, against finer meshes."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.problems.magnets_in_space import blocks, graded
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import Force, Froehlich, MagneticScalarPotential, Material

TOLERANCES = (0.03, 0.01, 0.003)
STEP, FAR, LAYERS = 0.01, 0.06, 4  # of the coarse meshes, m
REFERENCE = 8000  # nodes at order 2
MOST = 40_000  # nodes

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
    Device(
        "two magnets",
        {"lower": POLE, "upper": UPPER},
        {"lower": MAGNET, "upper": Material(remanence=(0.0, 0.5, 1.0))},
        Force("upper", (0.0, 0.0, 1.0)),
    ),
    Device(
        "two magnets, sideways",
        {"lower": POLE, "upper": UPPER},
        {"lower": MAGNET, "upper": Material(remanence=(0.0, 0.5, 1.0))},
        Force("upper", (1.0, 0.0, 0.0)),
    ),
    Device(
        "beside steel",
        {"magnet": POLE, "steel": ((-0.005, -0.012, -0.015), (0.02, 0.012, -0.005))},
        {"magnet": TILTED, "steel": Material(500.0)},
        Force("steel", (1.0, 0.0, 0.0)),
    ),
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors, true and told, and processor seconds by device, order and tolerance; then the ratio of the times."""
    ka.warmup(space=True)
    rows = [
        row for device in DEVICES[: 2 if quick else None] for row in _rows(device, TOLERANCES[: 2 if quick else None])
    ]
    header = ["force in space", "order", "output_rtol", "nodes", "true error / tol", "told / tol", "told / true"]
    return aligned([*header, "seconds", "of order 1's"], rows)


def _rows(device: Device, tolerances: Sequence[float]) -> Iterator[list[Cell]]:
    mesh, outputs = device.mesh(), {"force": device.force}
    fine = ka.adapt(mesh, device.problem(2), passes=2, target_nodes=REFERENCE, outputs=outputs)
    exact = fine.best.outputs["force"]
    for tolerance in tolerances:
        first = np.nan
        for order in (1, 2):
            began = time.process_time()
            result = ka.adapt(mesh, device.problem(order), outputs=outputs, output_rtol=tolerance, max_nodes=MOST)
            seconds = time.process_time() - began
            first = seconds if order == 1 else first
            force = result.outputs["force"]
            true, told = abs(exact / force.value - 1.0), abs((force.error or np.nan) / force.value)
            row: list[Cell] = [device.name, order, tolerance, result.mesh.nvertices, true / tolerance]
            yield [*row, told / tolerance, told / true, seconds, seconds / first if order > 1 else None]
