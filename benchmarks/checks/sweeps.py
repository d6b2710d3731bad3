"""Measure the error against the number of sweeps of energy descent, and what they cost."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.cases import Case, cases
from benchmarks.table import aligned

PASSES = 4
SWEEPS = (0, 2, 4, 8, 12, 16, 32)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Figures after four passes, each a relocation and a polish of that many sweeps; medians over the seeds."""
    ka.warmup()
    chosen = [case for letter in "LMF" for case in cases(letter, quick) if case.start().p.shape[1] < 5000]
    header = [
        f"sweeps: figure after {PASSES} passes of map and polish",
        "N",
        *map(str, SWEEPS),
        "us per node and sweep",
    ]
    return aligned(header, [_row(case, seeds) for case in chosen])


def _row(case: Case, seeds: Sequence[int]) -> list[str | int | float]:
    start = case.start()
    figures = [np.median([figure(case, start, sweeps, seed) for seed in seeds]) for sweeps in SWEEPS]
    return [f"{case.title.split(';')[0]}: {case.judged}", start.p.shape[1], *map(float, figures), _cost(case, start)]


def figure(case: Case, mesh: MeshTri, sweeps: int, seed: int) -> float:
    """The case's judged figure after the passes."""
    problem: Any = case.problem
    for number in range(PASSES):
        density = ka.density_from_indicators(mesh, problem.indicators(mesh, problem.solve(mesh)))
        mesh = ka.polish(ka.relocate(mesh, density, seed=seed * PASSES + number), problem, sweeps=sweeps)
    return case.figures(mesh, problem.solve(mesh))[case.judged]


def _cost(case: Case, mesh: MeshTri) -> float:
    """Microseconds per node and sweep, flips included: what 16 sweeps take beyond none, the best of three."""
    density = ka.density_from_indicators(mesh, case.problem.indicators(mesh, case.problem.solve(mesh)))
    mesh = ka.relocate(mesh, density)
    seconds = {sweeps: min(_seconds(case, mesh, sweeps) for _ in range(3)) for sweeps in (0, 16)}
    return 1e6 * (seconds[16] - seconds[0]) / 16 / mesh.p.shape[1]


def _seconds(case: Case, mesh: MeshTri, sweeps: int) -> float:
    start = time.perf_counter()
    ka.polish(mesh, case.problem, sweeps=sweeps)
    return time.perf_counter() - start
