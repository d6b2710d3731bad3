"""Compare this package with refinement, bisection and remeshers at equal numbers of nodes, on every case."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.peers import compare, methods
from benchmarks.peers.methods import Found
from benchmarks.problems import p1
from benchmarks.problems.cases import Case, cases
from benchmarks.problems.variants import DEFAULT, FLIP, POLISHED, Variant

LETTERS = "LHMCF"
NODES = (400, 4000)  # of the cases that are compared
OURS = (FLIP, POLISHED, DEFAULT)
LOOPS = 5  # of a remesher


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
    """A case in a word, its first figure, which is compared, and the results of all methods by name."""

    letter: str
    label: str
    figure: str
    results: dict[str, Result]


def comparisons(seeds: Sequence[int], quick: bool) -> Iterator[Comparison]:
    """Every method on every case."""
    ka.warmup()
    for letter in LETTERS:
        for case in cases(letter, quick):
            named = replace(case, start=_named(case.start), coarse=_named(case.coarse))
            if NODES[0] < named.start().p.shape[1] < NODES[1]:
                yield _comparison(letter, named, seeds)


def with_outside_named(mesh: MeshTri) -> MeshTri:
    """The mesh with its outer boundary called "outer", so that there is a name to lose."""
    return mesh.with_boundaries({"outer": mesh.boundary_facets()} | (mesh.boundaries or {}))


def lost_names(before: MeshTri, after: MeshTri) -> list[str]:
    """Names that are not there afterwards or have another area or length."""
    sizes, found = _sizes(before), _sizes(after)
    return sorted(name for name, size in sizes.items() if not np.isclose(size, found.get(name, np.nan), rtol=1e-9))


def _sizes(mesh: MeshTri) -> dict[str, float]:
    """Area of every subdomain and length of every boundary."""
    areas, _ = p1.shape_gradients(mesh)
    lengths = np.hypot(*np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0])
    return {name: areas[elements].sum() for name, elements in (mesh.subdomains or {}).items()} | {
        name: lengths[np.asarray(facets)].sum() for name, facets in (mesh.boundaries or {}).items()
    }


def _named(make: Callable[[], MeshTri]) -> Callable[[], MeshTri]:
    return lambda: with_outside_named(make())


def _comparison(letter: str, case: Case, seeds: Sequence[int]) -> Comparison:
    start = case.start()
    nodes, solution = start.p.shape[1], case.problem.solve(start)
    figure = next(iter(case.figures(start, solution)))
    runs = {methods.UNIFORM.name: [next(methods.measured(case, [(start, solution)]))]}
    for refiner in (methods.REFINED, methods.BISECTED):
        runs[refiner.name] = [_nearest(islice(refiner.loop(case), 1, None), nodes)]
    for remesher in methods.REMESHERS:
        if letter in remesher.letters and not remesher.missing:
            *_, last = remesher.loop(case, start, [nodes] * LOOPS)
            runs[remesher.name] = [last]
    if methods.GMSH.name in runs and hasattr(case.problem, "ritz"):
        runs[methods.POLISHED_GMSH] = [methods.polished(case, *runs[methods.GMSH.name])]
    for variant in OURS:
        if variant in case.variants:
            runs[variant.name] = [_adapted(case, variant, seed) for seed in seeds]
    return Comparison(
        letter, f"{case.name}, N = {nodes}", figure, {name: _result(case, start, found) for name, found in runs.items()}
    )


def _nearest(loop: Iterable[Found], nodes: int) -> Found:
    """Of a loop that goes on and on the mesh with the nearest number of nodes."""
    seen = []
    for found in loop:
        seen.append(found)
        if found.nodes >= nodes:
            break
    return min(seen, key=lambda found: abs(np.log(found.nodes / nodes)))


def _adapted(case: Case, variant: Variant, seed: int) -> Found:
    outcome = compare.adapted(case, variant, seed)
    return Found(outcome.mesh, next(iter(outcome.figures.values())), sum(outcome.seconds.values()))


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
