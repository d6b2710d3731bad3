"""Run the other methods of adaptation, each as a loop that yields every mesh with its error and the seconds so far."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.peers import compare, remeshing, wheels
from benchmarks.peers.bisection import bisected_meshes
from benchmarks.peers.gmsh_remesh import gmsh_remesh
from benchmarks.peers.mmg_remesh import mmg_remesh
from benchmarks.problems.cases import Case


@dataclass(frozen=True)
class Found:
    """A mesh, the first figure of its case, and the seconds that it took with every solve and estimate on the way."""

    mesh: MeshTri
    error: float
    seconds: float

    @property
    def nodes(self) -> int:
        """N."""
        return self.mesh.p.shape[1]

    def error_at(self, nodes: int, rate: float) -> float:
        """The error that as good a mesh of another number of nodes would have."""
        return self.error * (self.nodes / nodes) ** rate


@dataclass(frozen=True)
class Refiner:
    """A method that starts coarse and adds nodes, without end; `numbering`: what becomes of the numbers of nodes."""

    name: str
    loop: Callable[[Case], Iterator[Found]]
    numbering: str = "kept, new ones added"


@dataclass(frozen=True)
class Remesher:
    """A method that makes a new mesh of any number of nodes; `wheel` is what must be installed."""

    name: str
    wheel: str
    remesh_of: Callable[[Case], remeshing.Remesh]
    metric_of: remeshing.MetricOf = remeshing.equidistributing
    letters: str = "LHMCF"
    numbering: str = "lost"

    @property
    def missing(self) -> str:
        """Why it cannot run, empty if it can."""
        return wheels.missing(self.wheel)

    def loop(
        self, case: Case, start: MeshTri, counts: Sequence[int], trials: int = remeshing.TRIALS
    ) -> Iterator[Found]:
        """From a start mesh through meshes of these numbers of nodes."""
        remesh = self.remesh_of(case)
        return measured(case, remeshing.remeshed_meshes(case.problem, start, counts, self.metric_of, remesh, trials))


def measured(case: Case, meshes: Iterable[tuple[MeshTri, Any]]) -> Iterator[Found]:
    """Time a loop; what its meshes are worth is found out off the clock."""
    seconds, start = 0.0, time.perf_counter()
    for mesh, solution in meshes:
        seconds += time.perf_counter() - start
        yield Found(mesh, first_figure(case, mesh, solution), seconds)
        start = time.perf_counter()


def polished(case: Case, found: Found) -> Found:
    """A mesh of another method after the polish of this package."""
    start = time.perf_counter()
    mesh = ka.polish(found.mesh, case.problem)
    solution = case.problem.solve(mesh)
    seconds = found.seconds + time.perf_counter() - start
    return Found(mesh, first_figure(case, mesh, solution), seconds)


def first_figure(case: Case, mesh: MeshTri, solution: Any) -> float:
    """The error."""
    return next(iter(case.figures(mesh, solution).values()))


def _uniform(case: Case) -> Iterator[Found]:
    return measured(case, _halved_meshes(case.problem, case.coarse()))


def _halved_meshes(problem: Any, mesh: MeshTri) -> Iterator[tuple[MeshTri, Any]]:
    while True:
        yield mesh, problem.solve(mesh)
        mesh = mesh.refined()


def _refined(case: Case) -> Iterator[Found]:
    for outcome in compare.refined_meshes(case):
        yield Found(outcome.mesh, next(iter(outcome.figures.values())), sum(outcome.seconds.values()))


def _bisected(case: Case) -> Iterator[Found]:
    return measured(case, bisected_meshes(case.problem, case.coarse()))


UNIFORM = Refiner("uniform", _uniform)
REFINED = Refiner("refined by scikit-fem", _refined)
BISECTED = Refiner("bisected", _bisected)
REFINERS = (UNIFORM, REFINED, BISECTED)
GMSH = Remesher("Gmsh", "gmsh", lambda case: partial(gmsh_remesh, case.geometry))
POLISHED_GMSH = "Gmsh, then our polish"
MMG = Remesher("Mmg", "mmgpy", lambda case: mmg_remesh)
ANISOTROPIC = Remesher("Mmg, anisotropic", "mmgpy", lambda case: mmg_remesh, remeshing.curvature_metric, letters="LH")
REMESHERS = (GMSH, MMG, ANISOTROPIC)
