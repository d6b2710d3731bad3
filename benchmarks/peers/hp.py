"""Compare orders 4 to 8 with NGSolve's hp refinement."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import kohonen_adapt as ka
from benchmarks.checks import hp_steel
from benchmarks.peers import ngsolve_hp, wheels
from benchmarks.peers.contest import Call, Run, best_of, fewest_unknowns, quickest
from benchmarks.problems.corner_models import CornerModel, c_core, magnet_over_iron
from benchmarks.table import Cell, markdown

ERRORS = (0.3, 0.1, 0.03, 0.01)  # % of the energy norm
NODES = {"C": (211, 260, 300, 400, 500, 600), "M over iron": (42, 60, 85, 120, 160, 240)}  # after passes
REPEATS = 3


@dataclass(frozen=True)
class Grid:
    """Settings that are tried: of NGSolve edge lengths, levels, factors and orders, of this package passes and orders.

    `nodes` is how many of `NODES` are tried.
    """

    sizes: Sequence[float] = (0.5, 0.3, 0.2)  # half boxes
    levels: Sequence[int] = range(2, 7)
    factors: Sequence[float] = (0.15, 0.2, 0.25)  # of the sizes of successive levels
    their_orders: Sequence[int] = range(4, 9)
    passes: Sequence[int] = (0, 1, 2)
    nodes: int = 6
    orders: Sequence[int] = range(4, 9)


QUICK = Grid((0.5, 0.3), range(2, 5), (0.15,), range(3, 7), (0, 1), 3, (4, 5, 6))


def parts(quick: bool) -> Iterator[str]:
    """Yield all tables of one run."""
    ka.warmup()
    models, grid = [c_core(), magnet_over_iron()], QUICK if quick else Grid()
    missing = wheels.missing("ngsolve")
    if missing:
        yield missing
    else:
        yield against_hp(models, grid, ERRORS[: 2 if quick else 4])
    yield hp_steel.report(quick)


def against_hp(models: Sequence[CornerModel], grid: Grid, errors: Sequence[float]) -> str:
    """Print times and unknowns to errors beside those of NGSolve's hp refinement."""
    header = ["", "error %", "NGSolve's hp", "s", "unknowns", "this package", "s", "unknowns"]
    header += ["time ratio", "ratio of unknowns", "of the fewest"]
    header += ["by rtol", "s", "unknowns", "error %", "time ratio"]
    return markdown(header, [row for model in models for row in _hp_rows(model, grid, errors)])


def _hp_rows(model: CornerModel, grid: Grid, errors: Sequence[float]) -> Iterator[list[Cell]]:
    stated = [partial(run_to, model, error) for error in errors]
    sides = [list(theirs(model, grid)), list(ours(model, grid)), stated]
    for side in sides:
        side[0]()  # warm
    hp, adapted, by_tolerance = best_of(sides, errors, REPEATS)
    for error, own in zip(errors, by_tolerance, strict=True):
        first, second = quickest(hp, error), quickest(adapted, error)
        row: list[Cell] = [model.name, f"{error:g}"]
        for run in (first, second):
            row += [None, None, None] if run is None else [run.settings, f"{run.seconds:.4f}", run.unknowns]
        if first and second:
            fewest = [fewest_unknowns(runs, error) or 0 for runs in (hp, adapted)]
            ratios = second.seconds / first.seconds, second.unknowns / first.unknowns, fewest[1] / fewest[0]
            row += [f"{ratio:.2f}" for ratio in ratios]
        row += [None] * (11 - len(row)) + [own.settings, f"{own.seconds:.4f}", own.unknowns, f"{own.error:.2g}"]
        yield [*row, f"{own.seconds / first.seconds:.2f}" if first else None]


def theirs(model: CornerModel, grid: Grid) -> Iterator[Call]:
    """All settings of NGSolve."""
    for size, order, levels, factor in product(grid.sizes, grid.their_orders, grid.levels, grid.factors):
        yield partial(ngsolve_hp.hp, model, size, levels, order, factor)


def ours(model: CornerModel, grid: Grid) -> Iterator[Call]:
    """All settings of this package."""
    nodes = NODES[model.name][: grid.nodes]
    for order in grid.orders:
        for passes in grid.passes:
            for count in nodes if passes else nodes[:1]:  # without a pass the start keeps its nodes
                yield partial(adapted_run, model, order, passes, count)


def run_to(model: CornerModel, error: float) -> Run:
    """Run `adapt` to a tolerance in %, warm."""
    start, problem = model.start(), replace(model.problem(2), order="auto")
    begin = time.process_time()
    result = ka.adapt(start, problem, rtol=0.01 * error)
    seconds, best = time.process_time() - begin, result.best
    return Run(f"p {best.order}", best.unknowns, model.error(result.solution), seconds)


def adapted_run(model: CornerModel, order: int, passes: int, nodes: int) -> Run:
    """Run `adapt` with all that it does, warm."""
    start, problem = model.start(), model.problem(order)
    begin = time.process_time()
    result = ka.adapt(start, problem, passes=passes, target_nodes=nodes if passes else None)
    seconds = time.process_time() - begin
    settings = f"{passes} passes, {nodes} nodes, p {order}"
    return Run(settings, result.best.unknowns, model.error(result.solution), seconds)
