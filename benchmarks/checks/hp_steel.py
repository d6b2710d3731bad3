"""Time orders 4 to 8 on the saturated C-core beside refinement with elements of order 2."""

import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.peers.bisection import bisected_meshes
from benchmarks.peers.contest import Call, Run, best_of, quickest
from benchmarks.problems.corner_models import STEEL, CornerModel, c_core
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Field, Magnetostatics

ERRORS = (0.1, 0.03)  # % of the energy norm
ORDERS, PASSES, NODES = range(4, 9), (1, 2), (211, 300, 600)
FINE, FINE_LAYERS, FINE_ORDER = 1000, 5, 8  # nodes, layers and order of the solution that errors are told by
SHARES = (0.5,)  # of the squared indicators that refinement marks; 0.25 takes 1.7 times as long
REPEATS = 3


class Exact:
    """The functional of a fine solution, for errors of coarser ones."""

    def __init__(self, model: CornerModel, nodes: int, layers: int, order: int) -> None:
        mesh = ka.adapt(model.start(), model.problem(2), passes=2, target_nodes=nodes).mesh
        self.field = model.problem(order).solve(model.with_layers(mesh, layers))
        self.norm = model.problem(order).energy_norm(self.field.mesh, self.field)

    def error(self, field: Field) -> float:
        """Return the error in % of the energy norm: the functional exceeds its minimum by half of the square."""
        excess = field.newton[-1].functional - self.field.newton[-1].functional
        return 100.0 * float(np.sqrt(2.0 * abs(excess))) / self.norm


class Warm:
    """A problem whose solves start from the solution on the last mesh."""

    def __init__(self, problem: Magnetostatics) -> None:
        self.problem, self.indicators = problem, problem.indicators
        self.last: tuple[Any, ...] = ()

    def solve(self, mesh: MeshTri) -> Field:
        field = self.problem.solve_from(mesh, *self.last) if self.last else self.problem.solve(mesh)
        self.last = mesh, field
        return field


def report(quick: bool) -> str:
    """Times and unknowns to errors."""
    model = c_core(STEEL)
    exact = Exact(model, *((300, 3, 6) if quick else (FINE, FINE_LAYERS, FINE_ORDER)))
    errors = [0.3] if quick else ERRORS
    orders, nodes = ((4, 5), (211,)) if quick else (ORDERS, NODES)
    return to_errors(model, exact, errors, orders, nodes)


def to_errors(
    model: CornerModel,
    exact: Exact,
    errors: Sequence[float],
    orders: Sequence[int],
    nodes: Sequence[int],
    repeats: int = REPEATS,
) -> str:
    """Print the quickest runs of both."""
    header = [
        "C, saturated: error %",
        "refinement, p 2",
        "s",
        "unknowns",
        "this package",
        "s",
        "unknowns",
        "time ratio",
    ]
    refined = [run for share in SHARES for run in refinement(model, exact, min(errors), share)]
    calls: list[Call] = [
        partial(_adapted, model, exact, order, passes, count)
        for order in orders
        for passes in PASSES
        for count in nodes
    ]
    (runs,) = best_of([calls], errors, repeats)
    rows: list[list[Cell]] = []
    for error in errors:
        first, second = quickest(refined, error), quickest(runs, error)
        row: list[Cell] = [f"{error:g}"]
        for run in (first, second):
            row += [None, None, None] if run is None else [run.settings, f"{run.seconds:.3f}", run.unknowns]
        rows.append([*row, f"{second.seconds / first.seconds:.3f}" if first and second else None])
    return markdown(header, rows)


def refinement(model: CornerModel, exact: Exact, error: float, share: float) -> Iterator[Run]:
    """Bisect what has that share of the squared indicators, until the error is reached."""
    problem = model.problem(2)
    loop, seconds = bisected_meshes(Warm(problem), model.start(), share), 0.0
    while True:
        begin = time.process_time()
        mesh, field = next(loop)
        seconds += time.process_time() - begin
        run = Run(f"{mesh.nvertices} nodes", len(field.values), exact.error(field), seconds)
        yield run
        if run.error <= error:
            return


def _adapted(model: CornerModel, exact: Exact, order: int, passes: int, nodes: int) -> Run:
    start, problem = model.start(), model.problem(order)
    begin = time.process_time()
    result = ka.adapt(start, problem, passes=passes, target_nodes=nodes)
    seconds = time.process_time() - begin
    settings = f"{passes} passes, {nodes} nodes, p {order}"
    return Run(settings, result.best.unknowns, exact.error(result.solution), seconds)
