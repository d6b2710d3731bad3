"""Compare adaptation with a metric, with a density alone, and by an anisotropic remesher, at equal nodes."""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from skfem import Mesh

import kohonen_adapt as ka
from benchmarks.peers import wheels
from benchmarks.peers.mmg_remesh import mmg_remesh
from benchmarks.peers.remeshing import curvature_metric, equidistributing, gradient_metric, remeshed_meshes
from benchmarks.problems.cases import CASES
from benchmarks.problems.helmholtz import square_mesh
from benchmarks.problems.layers import (
    BoundaryLayer,
    Layer,
    PolishedBoundaryLayer,
    PolishedLayer,
    closed_layer,
    wave_front,
)
from benchmarks.problems.solids import CUBE, EDGE, FICHERA, Solid
from benchmarks.table import Cell, markdown

SQUARES = 32  # 1089 nodes
STEEPNESS = (30.0, 60.0, 120.0)
FRONT, EPS = 100.0, 1e-4
LOOPS = {2: 9, 3: 5}  # of Mmg, by dimension
NODES = {"L": 3201, "M": 1681, "C": 2983, "F": 3201, "H": 441}  # of the start meshes
SOLIDS: tuple[tuple[Solid, int], ...] = ((EDGE, 6), (FICHERA, 5), (CUBE, 10))  # cells per unit
WAYS = {"density": False, "metric": "auto"}  # `anisotropic` of adapt
Measure = Callable[[Mesh, Any], float]
Loop = Callable[[Mesh], Mesh]


class Row(NamedTuple):
    """A problem with its start, its error, the rate of the error in nodes, and the loop of Mmg."""

    name: str
    start: Mesh
    problem: Any
    error: Measure
    rate: float
    loop: Loop


class Found(NamedTuple):
    """Error at the nodes of the start, and seconds of the processor, solves included."""

    error: float
    seconds: float


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors and seconds at equal nodes; medians over the seeds."""
    ka.warmup()
    rows = list(layers(quick)) if quick else [*layers(quick), *planes(), *solids()]
    header = [
        "",
        "N",
        "uniform",
        *WAYS,
        "Mmg",
        "metric / density",
        "metric / Mmg",
        "density, s",
        "metric, s",
        "Mmg, s",
        "time / Mmg",
    ]
    return "\n\n".join(
        filter(None, [markdown(header, [compared(row, seeds) for row in rows]), wheels.missing("mmgpy")])
    )


def layers(quick: bool) -> Iterator[Row]:
    """All layers, with and without a functional."""
    for name, problem in layer_problems().items():
        if not quick or "60" in name:
            yield row_of(name, square_mesh(SQUARES), problem, lambda m, u, p=problem: 100 * p.error(m, u), 0.5)


def layer_problems() -> dict[str, Any]:
    """By name; the errors are in percent."""
    found: dict[str, Any] = {}
    for suffix, layer, boundary in (("", PolishedLayer, PolishedBoundaryLayer), (", no `ritz`", Layer, BoundaryLayer)):
        for steepness in STEEPNESS:
            found[f"closed layer, K = {steepness:g}{suffix}"] = layer(**closed_layer(steepness))
        found[f"wave front{suffix}"] = layer(**wave_front(FRONT))
        found[f"boundary layer{suffix}"] = boundary(EPS)
    return found


def planes() -> Iterator[Row]:
    """The problems of the comparison with peers."""
    for letter, nodes in NODES.items():
        for case in CASES[letter]:
            if case.start().nvertices == nodes:
                yield row_of(case.name, case.start(), case.problem, case.error, case.rate)


def solids() -> Iterator[Row]:
    """Tetrahedra."""
    for solid, cells in SOLIDS:
        yield row_of(f"{solid.name}, tetrahedra", solid.mesh(cells), solid, solid.error, 1 / 3)


def row_of(name: str, start: Mesh, problem: Any, error: Measure, rate: float) -> Row:
    """A row with the loop of Mmg."""
    return Row(name, start, problem, error, rate, partial(remeshed, problem))


def remeshed(problem: Any, start: Mesh) -> Mesh:
    """The last mesh of the loop of Mmg, in the plane round at interfaces, across which its Hessian averages."""
    dim = start.dim()
    metric = curvature_metric if dim == 3 else equidistributing if start.subdomains else gradient_metric
    trials = 1 if dim == 2 else None
    *_, (mesh, _) = remeshed_meshes(problem, start, [start.nvertices] * LOOPS[dim], metric, mmg_remesh, trials)
    return mesh


def compared(row: Row, seeds: Sequence[int]) -> list[Cell]:
    """All ways on one problem."""
    ways: dict[str, Callable[[int], Mesh]] = {
        name: partial(adapted, row.start, row.problem, {"anisotropic": option}) for name, option in WAYS.items()
    }
    found = {name: medians(row, way, seeds) for name, way in ways.items()}
    mmg = None if wheels.missing("mmgpy") else medians(row, lambda seed: row.loop(row.start), seeds[:1])
    density, metric = found.values()
    uniform = row.error(row.start, row.problem.solve(row.start))
    errors = [uniform, density.error, metric.error, mmg and mmg.error]
    ratios = [metric.error / density.error, mmg and metric.error / mmg.error]
    seconds = [density.seconds, metric.seconds, mmg and mmg.seconds, mmg and metric.seconds / mmg.seconds]
    return [row.name, int(row.start.nvertices), *errors, *ratios, *seconds]


def adapted(start: Mesh, problem: Any, options: dict[str, Any], seed: int) -> Mesh:
    """The mesh of this package."""
    return ka.adapt(start, problem, seed=seed, **options).mesh


def medians(row: Row, way: Callable[[int], Mesh], seeds: Sequence[int]) -> Found:
    """Of the runs of a way."""
    runs = []
    for seed in seeds:
        began = time.process_time()
        mesh = way(seed)
        seconds = time.process_time() - began
        error = row.error(mesh, row.problem.solve(mesh)) * (mesh.nvertices / row.start.nvertices) ** row.rate
        runs.append((error, seconds))
    return Found(*map(float, np.median(runs, axis=0)))
