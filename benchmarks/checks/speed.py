"""Time a relocation beside one round of assembly, solve and indicators as scikit-fem users write it."""

import cProfile
import pstats
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numba
import numpy as np

import kohonen_adapt as ka
from benchmarks.checks.reference_round import seconds_per_round
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.table import markdown

PASSES = 4
SQUARES = (64, 182)  # per unit: N = 12 545 and 99 008
TARGETS = {1: 1.0, 2: 0.7}  # relocations per reference round, by number of threads; the first may cost twice as much
LEARNT = 2e6  # training points per second on two threads
PACKAGE = Path(__file__).parents[2] / "kohonen_adapt"
SHOWN = 8  # files of the package in which a relocation spends most


def report(seeds: Sequence[int], quick: bool) -> str:
    """For every size alternating runs on one and two threads; training points per second; and where the time goes."""
    ka.warmup()
    seconds_per_round(l_shaped_mesh(8))  # first calls of scikit-fem import and cache things
    tables = [_relocations(l_shaped_mesh(squares), seeds) for squares in ((16,) if quick else SQUARES)]
    start = l_shaped_mesh(16 if quick else SQUARES[0])
    return "\n\n".join([*tables, _default(start, seeds), _learning(start), _profile(start)])


@contextmanager
def threads(number: int) -> Iterator[None]:
    """What ``NUMBA_NUM_THREADS`` does, for a while."""
    before, numba.config.NUMBA_NUM_THREADS = numba.config.NUMBA_NUM_THREADS, number
    try:
        yield
    finally:
        numba.config.NUMBA_NUM_THREADS = before


def _relocations(start, seeds: Sequence[int]) -> str:
    """A row per number of threads: medians over the seeds, each beside a round in the same run."""
    runs = {number: [] for number in TARGETS}
    rounds = []
    for seed in seeds:
        rounds.append(seconds_per_round(start))
        for number in TARGETS:
            with threads(number):
                runs[number].append(_passes(start, seed))
    nodes, reference = start.p.shape[1], float(np.median(rounds))
    header = [f"speed: relocation of L, N = {nodes}", *(f"pass {number + 1} us/node" for number in range(PASSES))]
    header += ["mean", "rounds", "target", "", "first, rounds", "target", ""]
    rows = []
    for number, target in TARGETS.items():
        passes = np.median(runs[number], axis=0)
        ratios = float(passes.mean()) / reference, float(passes[0]) / reference
        name = f"{number} thread{'s' if number > 1 else ''}"
        rows.append([name, *(1e6 / nodes * float(value) for value in (*passes, passes.mean()))])
        rows[-1] += [ratios[0], target, _verdict(ratios[0] <= target), ratios[1], 2 * target]
        rows[-1] += [_verdict(ratios[1] <= 2 * target)]
    return markdown(header, rows) + f"\n  round: {1e6 * reference / nodes:.1f} us per node"


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
    som, rates = ka.KohonenMap(mesh, topology="fixed"), {}
    once, often = (ka.Schedule((ka.Stage(0, epochs, 1e-9),), fresh=False) for epochs in (1, 11))
    for number in TARGETS:
        with threads(number):
            seconds = [min(_timed(lambda to=to: som.train(points, to)) for _ in range(5)) for to in (once, often)]
        rates[number] = 10 * points.shape[1] / (seconds[1] - seconds[0])
    found = ", ".join(f"{rate / 1e6:.1f} million on {number}" for number, rate in rates.items())
    return (
        f"training points per second and threads: {found} (target {LEARNT / 1e6:.0f}: {_verdict(rates[2] >= LEARNT)})"
    )


def _timed(call) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _profile(mesh) -> str:
    """Microseconds per node of the first relocation, by the file whose code ran, compiled or not."""
    profile = cProfile.Profile()
    density = np.hypot(*mesh.p[:, mesh.t].mean(axis=1)) ** (-4 / 3)
    profile.runcall(ka.relocate, mesh, density)
    spent: dict[str, float] = {}
    for (file, _, _), (_, _, seconds, *_) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        name = str(Path(file).relative_to(PACKAGE)) if Path(file).is_relative_to(PACKAGE) else "other packages"
        spent[name] = spent.get(name, 0.0) + 1e6 / mesh.p.shape[1] * seconds
    most = sorted(spent.items(), key=lambda item: -item[1])[:SHOWN]
    return markdown(["where the first relocation goes", "us per node"], [*most, ("whole", sum(spent.values()))])


def _verdict(met: bool) -> str:
    return "met" if met else "missed"
