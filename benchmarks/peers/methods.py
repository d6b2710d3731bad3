"""Run methods of adaptation in the plane, each as a loop that yields every mesh with its error and seconds so far."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from skfem import MeshTri, adaptive_theta

import kohonen_adapt as ka
from benchmarks.peers import remeshing, wheels
from benchmarks.peers.bisection import bisected_meshes
from benchmarks.peers.gmsh_remesh import gmsh_remesh
from benchmarks.peers.mmg_remesh import mmg_remesh
from benchmarks.problems.cases import Case

Solved = tuple[MeshTri, Any]
THETA = 0.5  # of the largest indicator: what scikit-fem's refinement marks


@dataclass(frozen=True)
class Found:
    """A mesh, its error, and the seconds that it took with every solve and estimate on the way."""

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
    meshes: Callable[[Case], Iterator[Solved]]
    numbering: str = "kept, new ones added"

    def loop(self, case: Case) -> Iterator[Found]:
        """From the coarse mesh."""
        return measured(case, self.meshes(case))


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

    def loop(self, case: Case, start: MeshTri, counts: Sequence[int], trials: int | None = None) -> Iterator[Found]:
        """From a start mesh through meshes of these numbers of nodes."""
        remesh = self.remesh_of(case)
        return measured(case, remeshing.remeshed_meshes(case.problem, start, counts, self.metric_of, remesh, trials))


@dataclass(frozen=True)
class Ours:
    """A way to call `adapt`."""

    name: str
    passes: int
    options: dict[str, Any] = field(default_factory=dict)
    numbering: str = "kept"

    def run(self, case: Case, seed: int = 0) -> Found:
        """From the start mesh."""
        return adapted(case, case.start(), passes=self.passes, seed=seed, **self.options)


def adapted(case: Case, start: MeshTri, **options: Any) -> Found:
    """What `adapt` makes of a mesh."""
    begin = time.perf_counter()
    result = ka.adapt(start, case.problem, **options)
    seconds = time.perf_counter() - begin
    return Found(result.mesh, case.error(result.mesh, result.solution), seconds)


def measured(case: Case, meshes: Iterable[Solved]) -> Iterator[Found]:
    """Time a loop; what its meshes are worth is found out off the clock."""
    seconds, start = 0.0, time.perf_counter()
    for mesh, solution in meshes:
        seconds += time.perf_counter() - start
        yield Found(mesh, case.error(mesh, solution), seconds)
        start = time.perf_counter()


def polished(case: Case, found: Found) -> Found:
    """A mesh of another method after the polish of this package."""
    start = time.perf_counter()
    mesh = ka.polish(found.mesh, case.problem)
    solution = case.problem.solve(mesh)
    seconds = found.seconds + time.perf_counter() - start
    return Found(mesh, case.error(mesh, solution), seconds)


def halved(case: Case) -> Iterator[Solved]:
    """Every element cut in four, again and again."""
    mesh = case.coarse()
    while True:
        yield mesh, case.problem.solve(mesh)
        mesh = mesh.refined()


def refined(case: Case) -> Iterator[Solved]:
    """scikit-fem's adaptive loop."""
    mesh = case.coarse()
    while True:
        solution = case.problem.solve(mesh)
        indicators = case.problem.indicators(mesh, solution)
        yield mesh, solution
        mesh = case.renamed(mesh.refined(adaptive_theta(indicators**2 if case.squared else indicators, theta=THETA)))


UNIFORM = Refiner("uniform", halved)
REFINED = Refiner("refined by scikit-fem", refined)
BISECTED = Refiner("bisected", lambda case: bisected_meshes(case.problem, case.coarse()))
REFINERS = (UNIFORM, REFINED, BISECTED)
GMSH = Remesher("Gmsh", "gmsh", lambda case: partial(gmsh_remesh, case.geometry))
POLISHED_GMSH = "Gmsh, then our polish"
MMG = Remesher("Mmg", "mmgpy", lambda case: mmg_remesh)
ANISOTROPIC = Remesher("Mmg, anisotropic", "mmgpy", lambda case: mmg_remesh, remeshing.curvature_metric, letters="LH")
REMESHERS = (GMSH, MMG, ANISOTROPIC)
FLIP = Ours("map only, flip", 4, {"topology": "flip", "polish": False})
POLISHED = Ours("map + polish, flip", 4, {"topology": "flip"})
DEFAULT = Ours("default (recycle)", 3, numbering="in `nodes`")
OURS = (FLIP, POLISHED, DEFAULT)
