"""Compare errors with the tolerances that `adapt` was given, and the time with that of refinement and bisection."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from skfem import MeshTri, adaptive_theta

import kohonen_adapt as ka
from benchmarks.checks import effectivity
from benchmarks.checks.goal_orders import Case
from benchmarks.checks.goal_orders import cases as goal_cases
from benchmarks.peers.bisection import Bisection, mark_bulk
from benchmarks.problems.c_core import c_core_mesh
from benchmarks.problems.l_shape import LShape, l_shaped_mesh
from benchmarks.problems.orders import OfOrder
from benchmarks.problems.orders import problem as of_order
from benchmarks.problems.poisson_l import PoissonL
from benchmarks.table import markdown
from kohonen_adapt.magnetostatics import Field, Magnetostatics

State = TypeVar("State")

MODELS = ("M, mu_r = 1", "M, mu_r = 1000", "C", "motor", "C, saturated")
TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4)
GOAL_TOLERANCES = (1e-2, 1e-3, 1e-4)
OWN_ORDERS = {2: (1e-2, 3e-3, 1e-3), 3: (1e-3, 3e-4)}  # tolerances for one order alone and for refinement
THETA = 0.25  # of the squared estimate, in the marking of bisection
THETAS = (0.25, 0.5)  # of the largest indicator, in the marking of scikit-fem's refinement; the quicker counts
LAYERS, HIGHEST = 4, 8  # of the reference, on the mesh of each result
HEADER = ("", "rtol", "auto, or the only order", "the order of the others", "bisected", "refined")
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
    """Time beside refinement, and error over tolerance, estimated and true, of the energy norm and of goals."""
    ka.warmup()
    some = slice(1 if quick else None)
    rows = [
        row for name, start, problem in models(MODELS[some]) for row in _rows(name, start, problem, TOLERANCES[some])
    ]
    rows += [_own_row(Own(letter, order)) for letter in "LF"[some] for order in OWN_TOLERANCES]
    rows += [row for case in goal_cases(1) for row in _goal_rows(case, GOAL_TOLERANCES[some])]
    ratios = np.array([float(row[2].rpartition(" ")[2]) for row in rows if row[2]])
    summary = (
        f"error / tolerance of {ratios.size} runs: median {np.median(ratios):.2f}, 95 % at most "
        f"{np.quantile(ratios, 0.95):.2f}, largest {ratios.max():.2f}"
    )
    return "\n\n".join([markdown(HEADER, rows), summary])


def models(names: Sequence[str]) -> Iterator[tuple[str, MeshTri, Magnetostatics]]:
    """As in `effectivity`, from the coarsest mesh there is of each."""
    known = {case.name: case for case in effectivity.cases()}
    for name in names:
        start = c_core_mesh("c_core_coarse.msh") if name.startswith("C") else known[name].start()
        yield name, start, known[name].problem("residual")


def _rows(name: str, start: MeshTri, problem: Magnetostatics, tolerances: Sequence[float]) -> Iterator[list[str]]:
    second = replace(problem, order=2)

    def cell(run: Callable[..., Run], order: int | str, rtol: float) -> str:
        found = run(start, replace(problem, order=order), rtol)
        return _cell(found, rtol, true_error(found, second))

    for rtol in tolerances:
        auto = cell(adapted, "auto", rtol)
        for order in (order for order, chosen in OWN_ORDERS.items() if rtol in chosen):
            if order == 3 and problem.pairs:
                continue  # bisection leaves sides of pairs with different nodes
            others = [cell(run, order, rtol) for run in (adapted, bisected)]
            # scikit-fem does not keep names of boundaries
            yield [name, f"{rtol:g}", auto, *others, "" if problem.pairs else cell(refined, order, rtol)]
            auto = ""
        if auto:
            yield [name, f"{rtol:g}", auto, "", "", ""]


def _own_row(problem: Own) -> list[str]:
    rtol, cells = OWN_TOLERANCES[problem.order], []
    for run in (adapted, bisected, refined):
        found = run(l_shaped_mesh(OWN_START), problem, rtol)
        error = problem.problem.error(found.mesh, found.field) / problem.energy_norm(found.mesh, found.field)
        cells.append(_cell(found, rtol, error))
    return [problem.name, f"{rtol:g}", cells[0], "", *cells[1:]]


def _cell(found: Run, rtol: float, error: float) -> str:
    ratios = f"{found.estimate / rtol:.2f}, {error / rtol:.2f}"
    return f"{found.seconds:.3g} s, {found.unknowns}, p {found.order}, {ratios}"


def _goal_rows(case: Case, tolerances: Sequence[float]) -> Iterator[list[str]]:
    problem = replace(case.problem, order="auto")
    for rtol in tolerances:
        began = time.process_time()
        result = ka.adapt(case.mesh, problem, goal_rtol=rtol)
        seconds, best = time.process_time() - began, result.best
        told = abs(best.goal_error / best.goal)
        found = Run(seconds, best.unknowns, best.order, result.solution, result.mesh, told)
        yield [case.name, f"{rtol:g}", _cell(found, rtol, abs(best.goal / case.exact - 1.0)), "", "", ""]


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
