"""Compare errors with the tolerances that `adapt` was given, and the time with that of refinement and bisection."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from skfem import MeshTri, adaptive_theta

import kohonen_adapt as ka
from benchmarks.checks.goal_orders import Case
from benchmarks.checks.goal_orders import cases as goal_cases
from benchmarks.peers.bisection import Bisection, mark_bulk
from benchmarks.peers.orders_to_error import models
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.orders import OfOrder
from benchmarks.problems.orders import problem as of_order
from benchmarks.problems.poisson_l import PoissonL
from benchmarks.table import Cell, aligned
from kohonen_adapt.magnetostatics import Field, Magnetostatics

State = TypeVar("State")

TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4)
GOAL_TOLERANCES = (1e-2, 1e-3, 1e-4)
OWN_ORDERS = {2: (1e-2, 3e-3, 1e-3), 3: (1e-3, 3e-4)}  # tolerances for one order alone and for refinement
THETA = 0.25  # of the squared estimate, in the marking of bisection
THETAS = (0.25, 0.5)  # of the largest indicator, in the marking of scikit-fem's refinement; the quicker counts
LAYERS, HIGHEST = 4, 8  # of the reference, on the mesh of each result
COUNTED = ("auto", "adapt")  # runs whose errors are summed up
OWN_TOLERANCES = {1: 1e-2, 2: 1e-3}  # of own problems, by order
OWN_START = 4  # squares per unit of the coarse mesh
SCALES = {("L", 1): 1.0 / 3.4, ("F", 1): 1.0 / 7.7, ("L", 2): 1.0 / 6.3, ("F", 2): 1.0 / 6.3}  # error over residual


@dataclass(frozen=True)
class Run:
    seconds: float
    unknowns: int
    order: int
    field: Field | np.ndarray
    mesh: MeshTri
    estimate: float  # relative


class Own:
    """Problem L or F by scikit-fem's elements, with a calibrated estimate."""

    calibrated = True

    def __init__(self, letter: str, order: int) -> None:
        linear: LShape | PoissonL = LShape() if letter == "L" else PoissonL()
        self.problem: LShape | PoissonL | OfOrder = linear if order == 1 else of_order(letter, order)
        self.name, self.order, self.scale = letter, order, SCALES[letter, order]
        self.solve, self.ritz, self.energy_norm = self.problem.solve, self.problem.ritz, self.problem.energy_norm

    def indicators(self, mesh: MeshTri, u: np.ndarray) -> np.ndarray:
        return self.scale * self.problem.indicators(mesh, u)


def report(seeds: Sequence[int], quick: bool) -> str:
    """Error over tolerance, estimated and true, of the energy norm and of goals, and time beside refinement."""
    ka.warmup()
    tolerances, chosen = (TOLERANCES[:1], models()[:1]) if quick else (TOLERANCES, models())
    header = ["by tolerance", "rtol", "run", "s", "unknowns", "order", "estimate / tol", "error / tol"]
    rows = [row for model in chosen for row in _rows(model.name, model.start(), model.problem, tolerances)]
    own = [Own(letter, order) for letter in "LF"[: 1 if quick else None] for order in OWN_TOLERANCES]
    rows += [row for problem in own for row in _own_rows(problem)]
    goals = [row for case in goal_cases(1) for row in _goal_rows(case, GOAL_TOLERANCES[: 1 if quick else None])]
    ratios = np.array([float(row[-1]) for row in [*rows, *goals] if row[2] in COUNTED and row[-1] is not None])
    summary = (
        f"error / tolerance of {ratios.size} runs: median {np.median(ratios):.2f}, 95 % at most "
        f"{np.quantile(ratios, 0.95):.2f}, largest {ratios.max():.2f}"
    )
    return "\n\n".join([aligned(header, rows), aligned(header, goals), summary])


def _rows(name: str, start: MeshTri, problem: Magnetostatics, tolerances: Sequence[float]) -> Iterator[list[Cell]]:
    second = replace(problem, order=2)
    for rtol in tolerances:
        runs = [("auto", adapted, replace(problem, order="auto"))]
        for order in (order for order, chosen in OWN_ORDERS.items() if rtol in chosen):
            if order == 3 and problem.pairs:
                continue  # bisection leaves sides of pairs with different nodes
            stated = replace(problem, order=order)
            runs += [(f"order {order}", adapted, stated), (f"bisected, {order}", bisected, stated)]
            if not problem.pairs:  # scikit-fem does not keep names of boundaries
                runs += [(f"refined, {order}", refined, stated)]
        for label, run, stated in runs:
            found = run(start, stated, rtol)
            yield _row(name, rtol, label, found, true_error(found, second))


def _own_rows(problem: Own) -> Iterator[list[Cell]]:
    rtol = OWN_TOLERANCES[problem.order]
    for label, run in (("adapt", adapted), ("bisected", bisected), ("refined", refined)):
        found = run(l_shaped_mesh(OWN_START), problem, rtol)
        error = problem.problem.error(found.mesh, found.field) / problem.energy_norm(found.mesh, found.field)
        yield _row(problem.name, rtol, label, found, error)


def _row(name: str, rtol: float, label: str, found: Run, error: float) -> list[Cell]:
    return [name, rtol, label, found.seconds, found.unknowns, found.order, found.estimate / rtol, error / rtol]


def _goal_rows(case: Case, tolerances: Sequence[float]) -> Iterator[list[Cell]]:
    problem = replace(case.problem, order="auto")
    for rtol in tolerances:
        began = time.process_time()
        result = ka.adapt(case.mesh, problem, goal_rtol=rtol)
        seconds, best = time.process_time() - began, result.best
        estimated = abs(best.goal_error / best.goal) / rtol
        error = abs(best.goal / case.exact - 1.0) / rtol
        yield [case.name, rtol, "auto", seconds, best.unknowns, best.order, estimated, error]


def adapted(start: MeshTri, problem: Magnetostatics | Own, rtol: float) -> Run:
    began = time.process_time()
    result = ka.adapt(start, problem, rtol=rtol)
    seconds, best = time.process_time() - began, result.best
    return Run(seconds, best.unknowns, best.order, result.solution, result.mesh, best.estimate / best.energy_norm)


def bisected(start: MeshTri, problem: Magnetostatics | Own, rtol: float) -> Run:
    """Bisect the elements that hold a fraction of the squared estimate, until it is within the tolerance."""

    def smaller(state: Bisection, indicators: np.ndarray) -> Bisection:
        return state.refined(mark_bulk(indicators, THETA))

    return _until(rtol, problem, Bisection.of(start), Bisection.mesh, smaller)


def refined(start: MeshTri, problem: Magnetostatics | Own, rtol: float) -> Run:
    """Refine as scikit-fem does, by the threshold that takes less time."""

    def named(mesh: MeshTri) -> MeshTri:
        return mesh.with_boundaries(dict.fromkeys(start.boundaries or (), mesh.boundary_facets()))

    def run(theta: float) -> Run:
        def smaller(mesh: MeshTri, indicators: np.ndarray) -> MeshTri:
            return mesh.refined(adaptive_theta(indicators, theta=theta))

        return _until(rtol, problem, MeshTri(start.p, start.t).with_subdomains(start.subdomains or {}), named, smaller)

    return min((run(theta) for theta in THETAS), key=lambda found: found.seconds)


def _until(
    rtol: float,
    problem: Magnetostatics | Own,
    state: State,
    mesh_of: Callable[[State], MeshTri],
    smaller: Callable[[State, np.ndarray], State],
) -> Run:
    began = time.process_time()
    while True:
        mesh = mesh_of(state)
        field = problem.solve(mesh)
        indicators = problem.indicators(mesh, field)
        estimate = float(np.linalg.norm(indicators)) / problem.energy_norm(mesh, field)
        if estimate <= rtol:
            seconds = time.process_time() - began
            unknowns = field.size if isinstance(field, np.ndarray) else field.elements.doflocs.shape[1]
            return Run(seconds, unknowns, problem.order, field, mesh, estimate)
        state = smaller(state, indicators)


def true_error(run: Run, problem: Magnetostatics) -> float:
    """Return the relative error in the energy norm, by functionals, of problems whose prescribed values are zero."""
    field, mesh = run.field, run.mesh
    corners = problem.singular_nodes(mesh, field)
    fine = ka.refined_at(mesh, corners, layers=LAYERS, periodic=problem.pairs) if corners.size else mesh
    best = problem.solve(fine, order=HIGHEST)
    squared = 2.0 * (functional(field) - functional(best))
    return float(np.sqrt(max(squared, 0.0) / best.squared_norm))


def functional(field: Field) -> float:
    return field.newton[-1].functional if field.newton else -0.5 * field.squared_norm
