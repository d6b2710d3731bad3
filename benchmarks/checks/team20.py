"""Measure the force of TEAM problem 20 with a tolerance of the goal."""

import runpy
import time
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import kohonen_adapt as ka
from benchmarks.table import Cell, aligned

EXAMPLES = Path(__file__).parents[2] / "examples"
LIMITS = {1000.0: (8.2, 8.45), 3000.0: (54.5, 57.0), 4500.0: (75.0, 77.0), 5000.0: (80.0, 81.5)}  # A: corrected, N
FINEST = {1000.0: 8.357, 3000.0: 55.58, 4500.0: 75.32, 5000.0: 80.45}  # N, corrected, as `finest` prints
RTOL, PASSES, NODES, SECONDS, RATIO = 0.01, 3, 3_500, 10.0, 1.5
TIGHT, MOST_PASSES = 0.003, 12


def report(quick: bool) -> str:
    """Forces beside their limits, and the estimated error beside the distance to a finer solution of order 2."""
    return forces_to(RTOL, PASSES, (5000.0,) if quick else tuple(LIMITS))


def tight(quick: bool) -> str:
    """The same to 0.3 %."""
    return forces_to(TIGHT, MOST_PASSES, (4500.0,) if quick else (1000.0, 4500.0))


def forces_to(tolerance: float, passes: int, currents: tuple[float, ...]) -> str:
    rows = list[list[Cell]]()
    for order, current in product((1, 2), currents):
        problem, mesh = device(current)
        (low, high), start = LIMITS[current], time.process_time()
        result = ka.adapt(mesh, replace(problem, order=order), passes=passes, goal_rtol=tolerance)
        seconds = time.process_time() - start
        value, corrected, error = forces(result)
        row = [value, corrected, low, high, error, FINEST[current], error / abs(value - FINEST[current]), seconds]
        rows.append([f"{current:.0f} A", order, result.mesh.nvertices, *row])
    header = ["TEAM problem 20", "order", "nodes", "force N", "corrected", "from", "to", "error", "finest"]
    return aligned([*header, f"error / distance (target {RATIO:g})", f"seconds (target {SECONDS:g})"], rows)


def finest(quick: bool) -> str:
    """Forces of order 2, with six times the unknowns of the largest mesh above but one."""
    rows = list[list[Cell]]()
    for current in (1000.0,) if quick else LIMITS:
        problem, mesh = device(current)
        result = ka.adapt(mesh, replace(problem, order=2), passes=PASSES, target_nodes=NODES)
        rows.append([f"{current:.0f} A", result.mesh.nvertices, *forces(result)])
    return aligned(["TEAM problem 20, order 2", "nodes", "force N", "corrected", "error"], rows)


def device(current: float) -> tuple[Any, Any]:
    example = runpy.run_path(str(EXAMPLES / "team20.py"))
    return example["problem"](current), ka.read_mesh(EXAMPLES / "team20.msh", scale=1e-3)


def forces(result: Any) -> tuple[float, float, float]:
    """Force on the whole pole, its corrected value, and its estimated error."""
    goal = result.outputs["goal"]
    return 4.0 * goal.value, 4.0 * goal.corrected, 4.0 * abs(goal.error)
