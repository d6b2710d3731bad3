"""Run one case by three methods: uniform mesh, scikit-fem's refinement, and this package."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from skfem import MeshTri, adaptive_theta

import kohonen_adapt as ka
from benchmarks.problems.cases import RELOCATIONS, Case, Figures
from benchmarks.problems.variants import Variant

STEPS = ("solve", "estimate", "relocate", "polish")
TOLERANCE_OF_WORST = 1.03  # the worst seed may miss a target by this factor


@dataclass
class Clock:
    """Seconds per step, summed."""

    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STEPS, 0.0))

    @contextmanager
    def time(self, step: str) -> Iterator[None]:
        """Add the time of the block to a step."""
        start = time.perf_counter()
        yield
        self.seconds[step] += time.perf_counter() - start


@dataclass(frozen=True)
class Outcome:
    """What one run of one method gave. `last` are the figures of the last pass, where a better one was returned."""

    mesh: MeshTri
    figures: Figures
    seconds: dict[str, float]
    last: Figures | None = None


def uniform(case: Case) -> Outcome:
    """The start mesh itself."""
    clock = Clock()
    mesh = case.start()
    solution, _ = _solve_and_estimate(case.problem, mesh, clock)
    return Outcome(mesh, case.figures(mesh, solution), clock.seconds)


def refinement(case: Case, nodes: int) -> Outcome:
    """Of the meshes of scikit-fem's adaptive loop, its start mesh apart, that with the nearest number of nodes."""
    meshes = refined_meshes(case)
    next(meshes)
    outcomes = [next(meshes)]
    while outcomes[-1].mesh.p.shape[1] < nodes:
        outcomes.append(next(meshes))
    return min(outcomes, key=lambda outcome: abs(np.log(outcome.mesh.p.shape[1] / nodes)))


def refined_meshes(case: Case) -> Iterator[Outcome]:
    """scikit-fem's adaptive loop with theta = 0.5 without end; seconds are those since its start."""
    clock = Clock()
    mesh = case.coarse()
    while True:
        solution, indicators = _solve_and_estimate(case.problem, mesh, clock)
        yield Outcome(mesh, case.figures(mesh, solution), dict(clock.seconds))
        with clock.time("relocate"):
            mesh = mesh.refined(adaptive_theta(indicators**2 if case.squared else indicators, theta=0.5))


def adapted(case: Case, variant: Variant, seed: int) -> Outcome:
    """This package: what a user gets after the variant's passes."""
    if case.density is not None:
        return _relocated(case, variant.options["topology"], seed)
    result = ka.adapt(case.start(), case.problem, passes=variant.passes, seed=seed, **variant.options)
    last = result.history[-1].mesh
    seconds = {step: sum(entry.seconds.get(step, 0.0) for entry in result.history) for step in STEPS}
    return Outcome(
        result.mesh,
        case.figures(result.mesh, result.solution),
        seconds,
        None if last is result.mesh else case.figures(last, case.problem.solve(last)),
    )


def verdict(target: float | None, judged: Sequence[float]) -> str:
    """Whether the median over the seeds, and the worst within its tolerance, reach the target."""
    if target is None:
        return ""
    if np.median(judged) > target:
        return "missed"
    return "met" if max(judged) <= TOLERANCE_OF_WORST * target else "worst missed"


def _relocated(case: Case, topology: str, seed: int) -> Outcome:
    clock = Clock()
    mesh = case.start()
    for number in range(RELOCATIONS):
        # no two calls draw the same points, as in `adapt`
        with clock.time("relocate"):
            mesh = ka.relocate(mesh, case.density, topology=topology, seed=seed * RELOCATIONS + number)
    return Outcome(mesh, case.figures(mesh, None), clock.seconds)


def _solve_and_estimate(problem: Any, mesh: MeshTri, clock: Clock) -> tuple[Any, np.ndarray]:
    with clock.time("solve"):
        solution = problem.solve(mesh)
    with clock.time("estimate"):
        indicators = problem.indicators(mesh, solution)
    return solution, indicators
