"""Time a relocation beside one round of assembly, solve and indicators as scikit-fem users write it."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial

import numba
import numpy as np

import kohonen_adapt as ka
from benchmarks.checks.reference_round import seconds_per_round
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.table import Cell, markdown

PASSES = 4
SQUARES = (64, 182)  # per unit: N = 12 545 and 99 008
THREADS = (1, 2)


def report(seeds: Sequence[int], quick: bool) -> str:
    """For every size alternating runs on one and two threads; a pass by default; training points per second."""
    ka.warmup()
    seconds_per_round(l_shaped_mesh(8))  # first calls of scikit-fem import and cache things
    starts = [l_shaped_mesh(squares) for squares in ((16,) if quick else SQUARES)]
    header = ["relocations of L", "threads", "rounds", "the first, rounds", "us per node"]
    table = markdown(header, [row for start in starts for row in _relocations(start, seeds)])
    return "\n\n".join([table, _default(starts[0], seeds), _learning(starts[0])])


@contextmanager
def threads(number: int) -> Iterator[None]:
    """What ``NUMBA_NUM_THREADS`` does, for a while."""
    before, numba.config.NUMBA_NUM_THREADS = numba.config.NUMBA_NUM_THREADS, number
    try:
        yield
    finally:
        numba.config.NUMBA_NUM_THREADS = before


def _relocations(start, seeds: Sequence[int]) -> Iterator[list[Cell]]:
    """A row per number of threads: medians over the seeds, each beside a round in the same run."""
    runs: dict[int, list[list[float]]] = {number: [] for number in THREADS}
    rounds = []
    for seed in seeds:
        rounds.append(seconds_per_round(start))
        for number in THREADS:
            with threads(number):
                runs[number].append(_passes(start, seed))
    nodes, reference = start.nvertices, float(np.median(rounds))
    for number in THREADS:
        passes = np.median(runs[number], axis=0)
        mean = float(passes.mean())
        yield [f"N = {nodes}", number, mean / reference, float(passes[0]) / reference, 1e6 / nodes * mean]


def _passes(mesh, seed: int) -> list[float]:
    """Seconds of density and relocation in a loop of solve, indicators, relocate."""
    problem, seconds = LShape(), []
    for number in range(PASSES):
        indicators = problem.indicators(mesh, problem.solve(mesh))
        start = time.perf_counter()
        mesh = ka.relocate(mesh, ka.density_from_indicators(mesh, indicators), seed=seed * PASSES + number)
        seconds.append(time.perf_counter() - start)
    return seconds


def _default(start, seeds: Sequence[int]) -> str:
    """What a pass of `adapt` costs beside solve and estimate: recycling and map, and the polish."""
    nodes, steps, rounds = start.p.shape[1], ("relocate", "polish"), []
    spent: dict[str, list[float]] = {step: [] for step in steps}
    for seed in seeds:
        rounds.append(seconds_per_round(start))
        history = ka.adapt(start, LShape(), passes=3, seed=seed).history[1:]
        for step in steps:
            spent[step].append(float(np.mean([entry.seconds[step] for entry in history])))
    reference = float(np.median(rounds))
    rows = [
        [step, 1e6 / nodes * float(np.median(spent[step])), float(np.median(spent[step])) / reference] for step in steps
    ]
    return markdown([f"a pass by default (recycle), N = {nodes}", "us per node", "rounds"], rows)


def _learning(mesh) -> str:
    """Training points learnt per second at radius 0, the search for their winners included; nothing moves visibly."""
    points = np.random.default_rng(0).random((2, 10 * mesh.p.shape[1])) * 0.5
    rates = dict[int, float]()
    once, often = (ka.Schedule((ka.Stage(0, epochs, 1e-9),), fresh=False) for epochs in (1, 11))
    for number in THREADS:
        with threads(number):
            som = ka.KohonenMap(mesh, topology="fixed")
            seconds = [min(_timed(partial(som.train, points, to)) for _ in range(5)) for to in (once, often)]
        rates[number] = 10 * points.shape[1] / (seconds[1] - seconds[0])
    found = ", ".join(f"{rate / 1e6:.1f} million on {number}" for number, rate in rates.items())
    return f"Training points per second and threads: {found}."


def _timed(call) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
