"""Compare orders 1 to 3 at equal numbers of unknowns with uniform meshes, targets, and one another."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.c_core import c_core_mesh
from benchmarks.problems.l_shape import l_shaped_mesh
from benchmarks.problems.orders import problem
from benchmarks.problems.square_magnet import magnet_mesh
from benchmarks.table import markdown

PASSES = 4
WORST = 1.03  # of the target: no seed may be further off
TWICE = 1.06  # of the error after four passes: what may be left after two


@dataclass(frozen=True)
class Row:
    """A problem at an order, the mesh it starts from, and the error that is wanted."""

    order: int
    letter: str
    start: Callable[[], MeshTri]
    target: float
    iron: bool = False

    @property
    def name(self) -> str:
        """As printed."""
        return f"P{self.order}, {self.letter}{', mu_r = 1000' if self.iron else ''}"


ROWS = (
    *(Row(2, "L", lambda n=n: l_shaped_mesh(n), target) for n, target in ((8, 0.0040), (16, 0.00096), (32, 0.00024))),
    *(Row(2, "F", lambda n=n: l_shaped_mesh(n), target) for n, target in ((16, 0.00096), (32, 0.00023))),
    Row(2, "M", lambda: magnet_mesh(40, False), 0.230),
    Row(2, "M", lambda: magnet_mesh(40, True), 0.202, iron=True),
    Row(2, "C", lambda: c_core_mesh("c_core.msh"), 0.415),
    Row(2, "C", lambda: c_core_mesh("c_core_fine.msh"), 0.117),
    *(Row(3, "L", lambda n=n: l_shaped_mesh(n), target) for n, target in ((10, 2.6e-4), (20, 2.9e-5))),
    Row(3, "F", lambda: l_shaped_mesh(10), 2.1e-4),
    Row(3, "M", lambda: magnet_mesh(20, False), 0.112),
    Row(3, "M", lambda: magnet_mesh(20, True), 0.148, iron=True),
    Row(3, "C", lambda: c_core_mesh("c_core.msh"), 0.098),
)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors of the uniform mesh, of the map alone, after two and after four polished passes, and microseconds."""
    ka.warmup()
    header = ["orders", "unknowns", "uniform", "map only", "two passes", "four", "worst", "target", "", "us of a sweep"]
    rows = ROWS[:1] if quick else ROWS
    return markdown(header, [_row(row, seeds) for row in rows])


def _row(row: Row, seeds: Sequence[int]) -> list[str | int | float]:
    mesh, given = row.start(), problem(row.letter, row.order, row.iron)
    uniform = given.error(mesh, given.solve(mesh))
    unknowns, two, four = zip(*(_polished(row, mesh, seed) for seed in seeds), strict=True)
    plain = np.median([_error(row, ka.adapt(mesh, given, passes=PASSES, polish=False, seed=seed)) for seed in seeds])
    error, worst = float(np.median(four)), max(four)
    verdict = "met" if error <= row.target and worst <= WORST * row.target else "missed"
    if np.median(two) > TWICE * error:
        verdict = f"{verdict}; more passes wanted"
    figures = [uniform, float(plain), float(np.median(two)), error, worst, row.target, verdict]
    return [row.name, int(np.median(unknowns)), *figures, _sweep(row, mesh)]


def _polished(row: Row, mesh: MeshTri, seed: int) -> tuple[int, float, float]:
    """Unknowns, and errors after two and four passes."""
    given = problem(row.letter, row.order, row.iron)
    result = ka.adapt(mesh, given, passes=PASSES, seed=seed)
    second = result.history[min(2, len(result.history) - 1)].mesh
    return len(result.solution), given.error(second, given.solve(second)), _error(row, result)


def _error(row: Row, result: ka.AdaptResult) -> float:
    return problem(row.letter, row.order, row.iron).error(result.mesh, result.solution)


def _sweep(row: Row, mesh: MeshTri) -> float:
    """Microseconds per unknown of a sweep of `ka.polish`, by the difference of 17 and one."""
    given, seconds = problem(row.letter, row.order, row.iron), []
    for sweeps in (1, 17):
        begin = time.perf_counter()
        ka.polish(mesh, given, sweeps=sweeps)
        seconds.append(time.perf_counter() - begin)
    return 1e6 * (seconds[1] - seconds[0]) / 16 / len(given.solve(mesh))
