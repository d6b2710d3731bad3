"""Compare this package with refinement, bisection and remeshers at equal numbers of nodes, on every case."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.peers import methods
from benchmarks.peers.lost_names import lost_names
from benchmarks.peers.methods import DEFAULT, GMSH, OURS, POLISHED, POLISHED_GMSH, REFINERS, REMESHERS, Found
from benchmarks.problems.cases import CASES, Case
from benchmarks.table import Cell, markdown

NODES = {False: (400, 4000), True: (400, 900)}  # of the cases that are compared, by `quick`
LOOPS = 5  # of a remesher
NUMBERING = {method.name: method.numbering for method in (*REFINERS, *REMESHERS, *OURS)} | {POLISHED_GMSH: "lost"}


@dataclass(frozen=True)
class Result:
    """What one method made of one case; `error` is that at the start mesh's number of nodes."""

    error: float
    seconds: float
    worst: float
    mean: float
    lost: list[str]


@dataclass(frozen=True)
class Comparison:
    """The results of all methods on a case by their names."""

    label: str
    figure: str
    results: dict[str, Result]


def report(seeds: Sequence[int], quick: bool) -> str:
    """Run every method on every case; the tables, and which wheels are not there."""
    missing = sorted({remesher.missing for remesher in REMESHERS} - {""})
    return "\n\n".join([tables(list(comparisons(seeds, quick))), *missing])


def comparisons(seeds: Sequence[int], quick: bool) -> Iterator[Comparison]:
    """Every method on every case."""
    ka.warmup()
    for letter, cases in CASES.items():
        for case in cases:
            named = replace(case, start=_named(case.start), coarse=_named(case.coarse))
            if NODES[quick][0] < named.start().p.shape[1] < NODES[quick][1]:
                yield comparison(letter, named, seeds)


def with_outside_named(mesh: MeshTri) -> MeshTri:
    """The mesh with its outer boundary called "outer", so that there is a name to lose."""
    return mesh.with_boundaries({"outer": mesh.boundary_facets()} | (mesh.boundaries or {}))


def _named(make: Callable[[], MeshTri]) -> Callable[[], MeshTri]:
    return lambda: with_outside_named(make())


def comparison(letter: str, case: Case, seeds: Sequence[int]) -> Comparison:
    """Every method on one case."""
    start = case.start()
    nodes, has_functional = start.p.shape[1], hasattr(case.problem, "ritz")
    runs = {"uniform": [next(methods.measured(case, [(start, case.problem.solve(start))]))]}
    for refiner in REFINERS[1:]:
        runs[refiner.name] = [_nearest(islice(refiner.loop(case), 1, None), nodes)]
    for remesher in REMESHERS:
        if letter in remesher.letters and not remesher.missing:
            *_, last = remesher.loop(case, start, [nodes] * LOOPS)
            runs[remesher.name] = [last]
    if GMSH.name in runs and has_functional:
        runs[POLISHED_GMSH] = [methods.polished(case, *runs[GMSH.name])]
    for way in OURS:
        if has_functional or way is not POLISHED:
            runs[way.name] = [way.run(case, seed) for seed in seeds]
    results = {name: _result(case, start, found) for name, found in runs.items()}
    return Comparison(f"{case.name}, N = {nodes}", case.figure, results)


def _nearest(loop: Iterable[Found], nodes: int) -> Found:
    """Of a loop that goes on and on the mesh with the nearest number of nodes."""
    seen = []
    for found in loop:
        seen.append(found)
        if found.nodes >= nodes:
            break
    return min(seen, key=lambda found: abs(np.log(found.nodes / nodes)))


def _result(case: Case, start: MeshTri, runs: list[Found]) -> Result:
    """Medians over the runs, but the worst quality of all of them."""
    qualities = [ka.quality(run.mesh) for run in runs]
    return Result(
        error=float(np.median([run.error_at(start.p.shape[1], case.rate) for run in runs])),
        seconds=float(np.median([run.seconds for run in runs])),
        worst=float(min(values.min() for values in qualities)),
        mean=float(np.median([values.mean() for values in qualities])),
        lost=sorted({name for run in runs for name in lost_names(start, run.mesh)}),
    )


def tables(rows: list[Comparison]) -> str:
    """All tables, and what a peer does better."""
    columns = list(dict.fromkeys(name for row in rows for name in row.results))
    seconds = [[row.label, *_cells(row, columns, lambda result: f"{result.seconds:.2f}")] for row in rows]
    parts = [
        "Errors at equal N, in bold the best:",
        markdown(["", *columns], [_errors(row, columns) for row in rows]),
        _better(rows, columns),
        "Seconds, with every solve and estimate on the way:",
        markdown(["", *columns], seconds),
        "Worst quality, median of the mean qualities, names lost, and whether a node keeps its number:",
        markdown(["", "min q", "mean q", "names", "numbers"], [_properties(name, rows) for name in columns]),
    ]
    return "\n\n".join(parts)


def _cells(row: Comparison, columns: list[str], cell: Callable[[Result], Cell]) -> Iterator[Cell]:
    return (cell(row.results[name]) if name in row.results else None for name in columns)


def _errors(row: Comparison, columns: list[str]) -> list[Cell]:
    best = min(result.error for result in row.results.values())
    cells = _cells(row, columns, lambda result: f"**{best:#.4g}**" if result.error == best else result.error)
    return [f"{row.label} ({row.figure})", *cells]


def _better(rows: list[Comparison], columns: list[str]) -> str:
    """Where a peer has the smaller error than the default of this package, and how many times."""
    lines = []
    for name in columns:
        ratios = {
            row.label: row.results[DEFAULT.name].error / row.results[name].error for row in rows if name in row.results
        }
        better = [f"{label} ({ratio:.3f})" for label, ratio in ratios.items() if ratio > 1]
        lines.append(f"* {name} has the smaller error on {'; '.join(better)}." if better else f"* {name}: nowhere.")
    return "\n".join([f"Where others do better than {DEFAULT.name}, and how many times:", "", *lines])


def _properties(name: str, rows: list[Comparison]) -> list[Cell]:
    results = [row.results[name] for row in rows if name in row.results]
    lost = sorted({lost for result in results for lost in result.lost})
    return [
        name,
        f"{min(result.worst for result in results):.2f}",
        f"{np.median([result.mean for result in results]):.2f}",
        f"{', '.join(lost)} lost" if lost else "kept",
        NUMBERING[name],
    ]
