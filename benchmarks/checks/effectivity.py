"""Hold every estimate of the energy norm's error against the error, before and after adapting by it."""

import runpy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from skfem import MeshTri

import kohonen_adapt as ka
from benchmarks.problems.c_core import EXAMPLES, c_core_mesh
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.poisson_l import PoissonL
from benchmarks.problems.square_magnet import magnet_mesh
from benchmarks.table import aligned
from kohonen_adapt import estimators
from kohonen_adapt.magnetostatics import Froehlich, Magnetostatics, Material

NAMES = ("residual", "recovery", "equilibrated")
SCALE = 1 / 3.6  # of the bare residual; see `kohonen_adapt.magnetostatics.estimation`
PASSES = 4
AIR, IRON, STEEL = Material(), Material(1000.0), Material(bh=Froehlich(2000.0, 0.8))


@dataclass(frozen=True)
class Case:
    """A start mesh, the problem with an estimator of that name, and the error of a solution in the energy norm."""

    name: str
    start: Callable[[], MeshTri]
    problem: Callable[[str], Any]
    error: Callable[[MeshTri, Any], float]
    names: Sequence[str] = NAMES


class Estimated:
    """A problem of the comparisons with a constant source, and indicators by an estimator of the package."""

    def __init__(self, problem: Any, source: float, name: str) -> None:
        self.solve, self.ritz, self.energy_norm = problem.solve, problem.ritz, problem.energy_norm
        self.source, self.name = source, name

    def indicators(self, mesh: MeshTri, solution: np.ndarray) -> np.ndarray:
        """By the name, the residual scaled."""
        one = np.ones(mesh.t.shape[1])
        found = getattr(estimators, self.name)(mesh, solution, one, source=self.source * one)
        return found * (SCALE if self.name == "residual" else 1.0)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Estimate over error on the first mesh, and on the mesh adapted by that estimate, medians over the seeds."""
    rows = [_row(case, list(seeds)[: 1 if quick else None]) for case in cases()]
    header = [f"{name}, {when}" for name in NAMES for when in ("before", "after")]
    return aligned(["effectivity (of the residual / 3.6)", "N", "error %", "after", *header], rows)


def effectivities(case: Case, name: str, seeds: Sequence[int]) -> tuple[float, float]:
    """Estimate over error of that estimator on the first mesh, and the median on those adapted by it."""
    problem, mesh = case.problem(name), case.start()
    before = float(np.linalg.norm(problem.indicators(mesh, problem.solve(mesh)))) / _error_before(case)
    after = [ka.adapt(mesh, problem, passes=PASSES, seed=seed) for seed in seeds]
    ratio = [result.estimate / case.error(result.mesh, result.solution) for result in after]
    return before, float(np.median(ratio))


@cache
def _error_before(case: Case) -> float:
    """That of the first mesh, which all estimators share."""
    mesh = case.start()
    return case.error(mesh, case.problem(NAMES[0]).solve(mesh))


def _row(case: Case, seeds: Sequence[int]) -> list[str | float | int | None]:
    mesh, problem = case.start(), case.problem(NAMES[0])
    results = [ka.adapt(mesh, problem, passes=passes, seed=seeds[0]) for passes in (0, PASSES)]
    errors = [
        100.0 * case.error(result.mesh, result.solution) / problem.energy_norm(result.mesh, result.solution)
        for result in results
    ]
    pairs = [effectivities(case, name, seeds) if name in case.names else (None, None) for name in NAMES]
    return [case.name, mesh.p.shape[1], *errors, *(ratio for pair in pairs for ratio in pair)]


def cases() -> list[Case]:
    """All that are compared."""
    laplace, poisson, magnet = LShape(), PoissonL(), Material(remanence=(0.0, 1.0))
    core = {"magnet": Material(1.05, remanence=(0.0, 1.2)), "air": AIR}
    motor = runpy.run_path(str(EXAMPLES / "motor.py"))
    pole = motor["sector"](motor["materials"]())
    return [
        Case("L", lambda: l_shaped_mesh(16), lambda name: Estimated(laplace, 0.0, name), laplace.error),
        Case("F", lambda: l_shaped_mesh(16), lambda name: Estimated(poisson, 1.0, name), poisson.error),
        _magnetic("M, mu_r = 1", lambda: _square(False), {"magnet": magnet, "air": AIR}),
        _magnetic("M, mu_r = 1000", lambda: _square(True), {"magnet": magnet, "iron": IRON, "air": AIR}),
        _magnetic("C", lambda: c_core_mesh("c_core.msh"), core | {"iron": IRON}),
        _magnetic("C, saturated", lambda: c_core_mesh("c_core.msh"), core | {"iron": STEEL}),
        _of_problem("motor", lambda: ka.read_mesh(EXAMPLES / "motor.msh", scale=1e-3), pole, NAMES[:2]),
    ]


def _square(iron: bool) -> MeshTri:
    mesh = magnet_mesh(40, iron)
    rest = np.setdiff1d(np.arange(mesh.t.shape[1]), np.concatenate(list(mesh.subdomains.values())))
    everywhere = mesh.with_boundaries({"outer": lambda x: np.ones(x.shape[1], dtype=bool)}, boundaries_only=True)
    return everywhere.with_subdomains({"air": rest})


def _magnetic(name: str, start: Callable[[], MeshTri], materials: dict[str, Material]) -> Case:
    return _of_problem(name, start, Magnetostatics(materials, {"outer": 0.0}, order=1), NAMES)


def _of_problem(name: str, start: Callable[[], MeshTri], problem: Magnetostatics, names: Sequence[str]) -> Case:
    """The error by co-energies: that of a Galerkin solution falls short by half the square of its error.

    In place of the exact one is that of P2 elements on the same mesh, refined once.
    """

    def error(mesh: MeshTri, field: Any) -> float:
        better = replace(problem, order=2).solve(mesh.refined())
        return float(np.sqrt(2.0 * (better.coenergy - field.coenergy)))

    return Case(name, start, lambda estimator: replace(problem, estimator=estimator), error, names)
