"""Count nodes and seconds from a coarse start to a given true error, method by method."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

import kohonen_adapt as ka
from benchmarks.peers import methods, orders_to_error
from benchmarks.peers.fewest_nodes import fewest
from benchmarks.peers.methods import Found, Remesher
from benchmarks.problems import orders
from benchmarks.problems.cases import Case, cases
from benchmarks.table import Cell, markdown

GOALS = {"L": 0.013, "M, mu_r = 1": 3.0, "M, mu_r = 1000": 3.0}  # L: |u - u_h|_1, M: per cent
EASIER = 2.0  # times the goal, with --quick
ORDERS = (1, 2)  # of the elements that every method is given
GROWTH = 4  # of the number of nodes from one mesh of a remesher to the next
EXTRA = (0, 1)  # loops of a remesher at the last number of nodes; the quicker counts
PASSES = (1, 2, 3, 4, 5, 6)  # of this package; the quickest counts
CAPTION = (
    "Time from a coarse start to an error. The number of nodes was searched for off the clock; of a remesher with or "
    f"without one more loop, and of {PASSES[0]} to {PASSES[-1]} passes of this package, the quickest:"
)


@dataclass(frozen=True)
class Reached:
    """What a run came to, or its repetitions in the median, and how often it solved."""

    solves: int
    nodes: int
    error: float
    seconds: float


Run = Callable[[int, int], Reached]
"""From the wanted number of nodes and a seed."""


def report(seeds: Sequence[int], quick: bool) -> str:
    """For every method, and every order, the run with the fewest nodes that reach the error, found off the clock."""
    ka.warmup()
    header = ["", "order", "error", "reached by", "solves", "N", "seconds"]
    chosen = {case.name: case for letter in "LM" for case in cases(letter)}
    rows = [
        row
        for name, goal in GOALS.items()
        for order in ORDERS
        for row in _rows(chosen[name], order, goal * (EASIER if quick else 1), seeds)
    ]
    missing = sorted({remesher.missing for remesher in methods.REMESHERS} - {""})
    return "\n\n".join([CAPTION, markdown(header, rows), *missing, orders_to_error.report(seeds, quick)])


def until(loop: Iterator[Found], goal: float) -> Reached:
    """The first mesh that is good enough."""
    return next(_reached(n, found) for n, found in enumerate(loop, start=1) if found.error <= goal)


def adapting(case: Case, passes: int) -> Run:
    """This package from the coarse mesh, as it comes."""
    start = case.coarse()

    def run(nodes: int, seed: int) -> Reached:
        begin = time.perf_counter()
        result = ka.adapt(start, case.problem, passes=passes, target_nodes=nodes, seed=seed)
        seconds = time.perf_counter() - begin
        error = methods.first_figure(case, result.mesh, result.solution)
        return _reached(len(result.history), Found(result.mesh, error, seconds))

    return run


def growing(start: int, end: int) -> list[int]:
    """Numbers of nodes from one mesh to another, evenly, each at most `GROWTH` times the one before."""
    steps = max(1, int(np.ceil(np.log(end / start) / np.log(GROWTH))))
    return [round(start * (end / start) ** (step / steps)) for step in range(1, steps + 1)]


def _rows(case: Case, order: int, goal: float, seeds: Sequence[int]) -> Iterator[list[Cell]]:
    for name, reached in _all(case if order == 1 else _of_order(case, order), goal, seeds):
        text = f"{reached.seconds:.3f}"
        yield [case.name, order, f"{reached.error:.4g} of {goal:g}", name, reached.solves, reached.nodes, text]


def _of_order(case: Case, order: int) -> Case:
    """The same problem by elements of another order."""
    problem = orders.problem(case.name[0], order, case.name.endswith("1000"))
    return replace(case, problem=problem, figures=lambda mesh, solution: {"error": problem.error(mesh, solution)})


def _all(case: Case, goal: float, seeds: Sequence[int]) -> Iterator[tuple[str, Reached]]:
    for refiner in methods.REFINERS:
        reached = _medians([until(refiner.loop(case), goal) for _ in seeds])
        yield refiner.name, reached
    for remesher in (methods.GMSH, methods.MMG):
        runs = [] if remesher.missing else [_remeshing(remesher, case, extra) for extra in EXTRA]
        yield from _quickest(case, remesher.name, runs, goal, reached.nodes, seeds)
    runs = [adapting(case, passes) for passes in PASSES]
    yield from _quickest(case, "this package, default", runs, goal, reached.nodes, seeds)


def _quickest(
    case: Case, name: str, runs: Sequence[Run], goal: float, guess: int, seeds: Sequence[int]
) -> Iterator[tuple[str, Reached]]:
    order, least = getattr(case.problem, "order", 1), case.coarse().p.shape[1]
    found = [with_fewest_nodes(run, goal, guess, seeds, least, order) for run in runs]
    if any(found):
        yield name, min(filter(None, found), key=lambda reached: reached.seconds)


def with_fewest_nodes(
    run: Run, goal: float, guess: int, seeds: Sequence[int], least: int, order: int
) -> Reached | None:
    """The medians over seeds of the runs with the fewest nodes that come to the error, by elements of that order."""
    return fewest(lambda nodes: _medians([run(nodes, seed) for seed in seeds]), goal, guess, least, inf, order)


def _remeshing(remesher: Remesher, case: Case, extra: int) -> Run:
    start = case.coarse()

    def run(nodes: int, seed: int) -> Reached:
        counts = growing(start.p.shape[1], nodes)
        *before, last = remesher.loop(case, start, [*counts, *counts[-1:] * extra], trials=1)
        return _reached(len(before) + 1, last)

    return run


def _reached(solves: int, found: Found) -> Reached:
    return Reached(solves, found.nodes, found.error, found.seconds)


def _medians(runs: Sequence[Reached]) -> Reached:
    return Reached(
        solves=int(np.median([run.solves for run in runs])),
        nodes=int(np.median([run.nodes for run in runs])),
        error=float(np.median([run.error for run in runs])),
        seconds=float(np.median([run.seconds for run in runs])),
    )
