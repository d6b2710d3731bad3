"""Count unknowns and seconds from a coarse start to an error of `Magnetostatics`, by the order of its elements."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.checks import effectivity
from benchmarks.peers.fewest_nodes import fewest
from benchmarks.problems.c_core import c_core_mesh
from benchmarks.problems.steel import divided
from benchmarks.table import Cell, markdown
from kohonen_adapt.magnetostatics import Field, Magnetostatics

ERRORS = (3.0, 1.0, 0.3)  # % of the energy norm
ORDERS = (1, 2, 3)
PASSES = (0, 1, 2, 3, 4)  # the quickest counts
REACH = {1: 60_000, 2: 20_000, 3: 10_000}  # the most nodes that are tried
FINE = 5_000  # nodes of the mesh that is adapted for the reference, and then divided: finer than any of order 3
CAPTION = (
    "Processor seconds of `Magnetostatics` from a coarse start to an error in the energy norm, by the order of its "
    "elements. The fewest nodes were searched for off the clock, never fewer than the start has; of "
    f"{PASSES[0]} to {PASSES[-1]} passes the quickest. The exact co-energy is that of order 3 on a mesh adapted with "
    f"{FINE} nodes or more and divided once; behind the name is the error that order 2 has there by it:"
)


@dataclass(frozen=True)
class Model:
    """A start mesh and a problem."""

    name: str
    start: Callable[[], MeshTri]
    problem: Magnetostatics


@dataclass(frozen=True)
class Reached:
    """What a run came to, with how many passes."""

    passes: int
    nodes: int
    unknowns: int
    error: float
    seconds: float


def report(seeds: Sequence[int], quick: bool) -> str:
    """For every problem, error and order the run that is quickest there."""
    ka.warmup()
    errors = ERRORS[:1] if quick else ERRORS
    header = ["", "error %", "order", "passes", "nodes", "unknowns", "error reached", "seconds"]
    rows = [row for model in models() for row in _rows(model, errors, list(seeds)[:1] if quick else seeds)]
    return "\n\n".join([CAPTION, markdown(header, rows)])


@cache
def models() -> tuple[Model, ...]:
    """M, the C-core and the motor as in `effectivity`, from the coarsest mesh there is of each."""
    known = {case.name: case for case in effectivity.cases()}
    coarse = {"C": lambda: c_core_mesh("c_core_coarse.msh"), "C, saturated": lambda: c_core_mesh("c_core_coarse.msh")}
    names = ("M, mu_r = 1", "M, mu_r = 1000", "C", "motor", "C, saturated")
    return tuple(Model(name, coarse.get(name, known[name].start), known[name].problem("residual")) for name in names)


def _rows(model: Model, errors: Sequence[float], seeds: Sequence[int]) -> Iterator[list[Cell]]:
    start = model.start()
    exact, doubt = reference(model, start)
    name = f"{model.name} ({doubt:.2g} %)"
    for error in errors:
        for order in ORDERS:
            found = quickest(model, start, order, exact, error, seeds)
            if found is None:
                yield [name, error, order, "-", f"over {REACH[order]}", "", "", ""]
                continue
            figures = [found.passes, found.nodes, found.unknowns, f"{found.error:.3g}", f"{found.seconds:.3f}"]
            yield [name, error, order, *figures]


def reference(model: Model, start: MeshTri) -> tuple[float, float]:
    """Return the co-energy of order 3 on a fine mesh, and the error in % that order 2 has there by it."""
    problem = replace(model.problem, order=3)
    mesh = divided(ka.adapt(start, problem, target_nodes=max(FINE, start.p.shape[1])).mesh)
    exact = problem.solve(mesh).coenergy
    second = replace(problem, order=2)
    return exact, _error(second, mesh, second.solve(mesh), exact)


def _error(problem: Magnetostatics, mesh: MeshTri, field: Field, exact: float) -> float:
    """Return the error in % of the energy norm, by the co-energy."""
    return 100.0 * float(np.sqrt(2.0 * abs(exact - field.coenergy))) / problem.energy_norm(mesh, field)


def quickest(
    model: Model, start: MeshTri, order: int, exact: float, error: float, seeds: Sequence[int]
) -> Reached | None:
    """Of all numbers of passes the run that takes the least time, medians over seeds."""
    problem = replace(model.problem, order=order)
    found = [with_fewest_nodes(start, problem, passes, exact, error, seeds) for passes in PASSES]
    return min(filter(None, found), key=lambda run: run.seconds, default=None)


def with_fewest_nodes(
    start: MeshTri, problem: Magnetostatics, passes: int, exact: float, error: float, seeds: Sequence[int]
) -> Reached | None:
    """After so many passes the run with the fewest nodes that comes to the error, medians over seeds."""
    least = start.p.shape[1]

    def run(nodes: int) -> Reached:
        return _median([_run(start, problem, passes, exact, nodes, seed) for seed in seeds])

    return fewest(run, error, least, least, REACH[problem.order] if passes else least, problem.order)


def _run(start: MeshTri, problem: Magnetostatics, passes: int, exact: float, nodes: int, seed: int) -> Reached:
    begin = time.process_time()  # of all threads: what else the machine does has no say
    result = ka.adapt(start, problem, passes=passes, target_nodes=nodes if passes else None, seed=seed)
    seconds = time.process_time() - begin
    error = _error(problem, result.mesh, result.solution, exact)
    return Reached(passes, result.mesh.nvertices, result.best.unknowns, error, seconds)


def _median(runs: Sequence[Reached]) -> Reached:
    """The run whose time is in the middle, with the error in the middle."""
    middle = sorted(runs, key=lambda run: run.seconds)[len(runs) // 2]
    return replace(middle, error=float(np.median([run.error for run in runs])))
