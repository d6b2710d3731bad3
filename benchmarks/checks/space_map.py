"""Measure what the Kohonen map brings in meshes of tetrahedra: spread of mass alone, and errors after recycling."""

import time
from collections.abc import Sequence

import numpy as np
from skfem import MeshTet

import kohonen_adapt as ka
from benchmarks.checks.space import PASSES, shell, spread
from benchmarks.problems.solids import BUMP, EDGE, FICHERA, MAGNET, Solid
from benchmarks.table import aligned

CASES = ((BUMP, 10), (EDGE, 6), (FICHERA, 5), (MAGNET, 4))  # cells per unit
SIDES = (10, 20)  # cells along the cube
STAGES = (ka.Stage(1, 2, 0.3),)
SWEEPS = 3  # of `relocate` with "recycle"
MOST = float(shell(np.array([[0.9], [0.5], [0.5]]))[0])


def report(seeds: Sequence[int], quick: bool) -> str:
    """Spread of mass of maps of points drawn from a density; then errors with and without the map after recycling."""
    taught(2, "flip", 0)  # compiles all that is needed
    sides = SIDES[: 1 if quick else None]
    rows = [spreads(side, topology, seeds) for side in sides for topology in ("fixed", "flip")]
    maps = aligned(["map alone", "N", "start", "spread", "quality", "us/node/epoch"], rows)
    errors = [compared(*case, seeds) for case in CASES[: 1 if quick else None]]
    return f"{maps}\n\n{aligned(['space: 4 relocations', 'N', 'recycle', 'and map', 'ratio'], errors)}"


def spreads(side: int, topology: str, seeds: Sequence[int]) -> list[str | float | int | None]:
    """Coefficient of variation of the mass of elements of a uniform cube before, and in the median after training."""
    found = [taught(side, topology, seed) for seed in seeds]
    start, after, worst, cost = np.median(found, axis=0)
    return [topology, (side + 1) ** 3, start, after, worst, cost]


def taught(side: int, topology: str, seed: int) -> tuple[float, float, float, float]:
    """Spread before and after, least quality, and microseconds of processors per node and epoch."""
    mesh = MeshTet.init_tensor(*[np.linspace(0.0, 1.0, side + 1)] * 3)
    som, began = ka.KohonenMap(mesh, topology=topology), time.process_time()
    errors = som.train(drawn, seed=seed)
    cost = 1e6 * (time.process_time() - began) / mesh.nvertices / len(errors)
    return spread(mesh), spread(som.mesh), float(ka.quality(som.mesh).min()), cost


def drawn(number: int, rng: np.random.Generator) -> tuple[np.ndarray, None]:
    """Points of the cube from the density of a shell, by rejection."""
    kept = np.zeros((3, 0))
    while kept.shape[1] < number:
        x = rng.random((3, 4 * number))
        kept = np.hstack([kept, x[:, MOST * rng.random(4 * number) < shell(x)]])
    return kept[:, :number], None


def compared(problem: Solid, cells: int, seeds: Sequence[int]) -> list[str | float | int | None]:
    """Errors after relocations with recycling, without the map, and with it in the median over seeds."""
    plain = relocated(problem, cells, None, 0)
    taught = float(np.median([relocated(problem, cells, ka.Schedule(STAGES, sweeps=SWEEPS), seed) for seed in seeds]))
    return [problem.name, problem.mesh(cells).nvertices, plain, taught, taught / plain]


def relocated(problem: Solid, cells: int, schedule: ka.Schedule | None, seed: int) -> float:
    """The error in the end."""
    mesh = problem.mesh(cells)
    u = problem.solve(mesh)
    for _ in range(PASSES):
        mesh = ka.relocate(mesh, problem.density(mesh, u), topology="recycle", schedule=schedule, seed=seed)
        u = problem.solve(mesh)
    return problem.error(mesh, u)
