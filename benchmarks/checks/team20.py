"""Measure the force of TEAM problem 20 with a tolerance of the goal."""

import runpy
import time
from pathlib import Path
from typing import Any

import kohonen_adapt as ka
from benchmarks.table import Cell, aligned

EXAMPLES = Path(__file__).parents[2] / "examples"
LIMITS = {1000.0: (8.2, 8.45), 3000.0: (54.5, 57.0), 4500.0: (75.0, 77.0), 5000.0: (80.0, 81.5)}  # A: corrected, N
RTOL, PASSES, FINEST, SECONDS, RATIO = 0.01, 3, 20_000, 10.0, 1.5


def report(quick: bool) -> str:
    """Forces beside their limits, and the estimated error beside the distance to the corrected force of a fine mesh."""
    example, rows = runpy.run_path(str(EXAMPLES / "team20.py")), list[list[Cell]]()
    mesh = ka.read_mesh(EXAMPLES / "team20.msh", scale=1e-3)
    for current in (5000.0,) if quick else LIMITS:
        problem, (low, high), start = example["problem"](current), LIMITS[current], time.process_time()
        result = ka.adapt(mesh, problem, passes=PASSES, goal_rtol=RTOL)
        seconds = time.process_time() - start
        value, corrected, error = forces(result)
        finest = None if quick else forces(ka.adapt(mesh, problem, passes=PASSES, target_nodes=FINEST))[1]
        ratio = None if finest is None else error / abs(value - finest)
        row = [value, corrected, low, high, error, finest, ratio, seconds]
        rows.append([f"{current:.0f} A", result.mesh.nvertices, *row])
    header = ["TEAM problem 20", "nodes", "force N", "corrected", "from", "to", "error", "finest"]
    return aligned([*header, f"error / distance (target {RATIO:g})", f"seconds (target {SECONDS:g})"], rows)


def forces(result: Any) -> tuple[float, float, float]:
    """Force on the whole pole, its corrected value, and its estimated error."""
    goal = result.outputs["goal"]
    return 4.0 * goal.value, 4.0 * goal.corrected, 4.0 * abs(goal.error)
