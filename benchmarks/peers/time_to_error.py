"""Count nodes and seconds from a coarse start to a given true error, method by method."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

import kohonen_adapt as ka
from benchmarks.peers import methods
from benchmarks.peers.methods import Found, Remesher
from benchmarks.problems.cases import CASES, Case
from benchmarks.problems.square_magnet import MagnetOfOrder, named
from benchmarks.table import Cell, markdown

GOALS = {"L": 0.013, "M, mu_r = 1": 3.0, "M, mu_r = 1000": 3.0}  # L: |u - u_h|_1, M: per cent
UNITS = {"L": "", "M": " %"}
EASIER = 2.0  # times the goal, with --quick
ROWS = (*((1, name) for name in GOALS), (2, "M, mu_r = 1"), (2, "M, mu_r = 1000"))  # with the order of all methods
GROWTH = 4  # of the number of nodes from one mesh of a remesher to the next
EXTRA = (0, 1)  # loops of a remesher at the last number of nodes; the quicker counts
PASSES = (1, 2, 3, 4, 5, 6)  # of this package; the quickest counts
MARGIN = 1.02  # a mesh may be better than wanted by this factor before fewer nodes are tried
TRIALS = 6
CAPTION = (
    "Nodes and seconds from a coarse start to an error. The number of nodes was searched for off the clock; of a "
    f"remesher with or without one more loop, and of {PASSES[0]} to {PASSES[-1]} passes of this package, the quickest:"
)


@dataclass(frozen=True)
class Reached:
    """What a run came to, or its repetitions in the median."""

    nodes: int
    error: float
    seconds: float


Run = Callable[[int, int], Reached]
"""From the wanted number of nodes and a seed."""


def report(seeds: Sequence[int], quick: bool) -> str:
    """For every method, and every order, the run with the fewest nodes that reach the error, found off the clock."""
    ka.warmup()
    chosen = {case.name: case for letter in "LM" for case in CASES[letter]}
    found = dict[str, dict[str, Reached]]()
    for order, name in ROWS:
        case, goal = chosen[name], GOALS[name] * (EASIER if quick else 1)
        reached = _all(case if order == 1 else _of_order(case, order), goal, seeds)
        found[f"order {order}, {name}: {goal:g}{UNITS[name[0]]}"] = dict(reached)
    names = list(dict.fromkeys(name for reached in found.values() for name in reached))
    rows = [[label, *(_cell(reached.get(name)) for name in names)] for label, reached in found.items()]
    missing = sorted({remesher.missing for remesher in methods.REMESHERS} - {""})
    return "\n\n".join([CAPTION, markdown(["to an error of", *names], rows), *missing])


def until(loop: Iterator[Found], goal: float) -> Reached:
    """The first mesh that is good enough."""
    return next(_reached(found) for found in loop if found.error <= goal)


def adapting(case: Case, passes: int) -> Run:
    """This package from the coarse mesh, as it comes."""
    start = case.coarse()

    def run(nodes: int, seed: int) -> Reached:
        return _reached(methods.adapted(case, start, passes=passes, target_nodes=nodes, seed=seed))

    return run


def growing(start: int, end: int) -> list[int]:
    """Numbers of nodes from one mesh to another, evenly, each at most `GROWTH` times the one before."""
    steps = max(1, int(np.ceil(np.log(end / start) / np.log(GROWTH))))
    return [round(start * (end / start) ** (step / steps)) for step in range(1, steps + 1)]


def _cell(reached: Reached | None) -> Cell:
    return reached and f"{reached.nodes}, {reached.seconds:.3f} s"


def _of_order(case: Case, order: int) -> Case:
    """Problem M by elements of another order."""
    problem = MagnetOfOrder.of(order, case.name.endswith("1000"))
    return replace(case, problem=problem, coarse=lambda: named(case.coarse()), renamed=named)


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
    """The medians over seeds of the runs with the fewest nodes, `least` or more, that come to the error, if any do.

    The next number of nodes is found from the error being N^(-order / 2).
    """
    nodes, best = max(guess, least), None
    for _ in range(TRIALS):
        reached = _medians([run(nodes, seed) for seed in seeds])
        if reached.error <= goal and (best is None or reached.nodes < best.nodes):
            best = reached
        if reached.error <= goal and (nodes == least or reached.error >= goal / MARGIN):
            break
        nodes = max(least, round(nodes * (reached.error / goal * MARGIN**0.5) ** (2.0 / order)))
    return best


def _remeshing(remesher: Remesher, case: Case, extra: int) -> Run:
    start = case.coarse()

    def run(nodes: int, seed: int) -> Reached:
        counts = growing(start.p.shape[1], nodes)
        *_, last = remesher.loop(case, start, [*counts, *counts[-1:] * extra], trials=1)
        return _reached(last)

    return run


def _reached(found: Found) -> Reached:
    return Reached(found.nodes, found.error, found.seconds)


def _medians(runs: Sequence[Reached]) -> Reached:
    nodes, error, seconds = np.median([(run.nodes, run.error, run.seconds) for run in runs], axis=0)
    return Reached(int(nodes), float(error), float(seconds))
