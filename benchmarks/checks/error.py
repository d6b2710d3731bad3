"""Compare errors with the tolerances that `adapt` was given, and the time with that of refinement."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from skfem import MeshTri, adaptive_theta

import kohonen_adapt as ka
from benchmarks.checks import effectivity
from benchmarks.checks.goal_orders import Case
from benchmarks.checks.goal_orders import cases as goal_cases
from benchmarks.problems.c_core import c_core_mesh
from benchmarks.table import markdown
from kohonen_adapt.magnetostatics import Field, Magnetostatics

MODELS = ("M, mu_r = 1", "M, mu_r = 1000", "C", "motor", "C, saturated")
TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4)
GOAL_TOLERANCES = (1e-2, 1e-3, 1e-4)
OWN_ORDERS = {2: (1e-2, 3e-3, 1e-3), 3: (1e-3, 3e-4)}  # tolerances for one order alone and for refinement
THETAS = (0.25, 0.5)  # of the largest indicator, in the marking of scikit-fem's refinement; the quicker counts
LAYERS, HIGHEST = 4, 8  # of the reference, on the mesh of each result
HEADER = ("", "rtol", "auto", "the order of refinement", "refined by scikit-fem")


@dataclass(frozen=True)
class Run:
    seconds: float
    unknowns: int
    order: int
    field: Field
    mesh: MeshTri
    estimate: float  # relative


def report(seeds: Sequence[int], quick: bool) -> str:
    """Time beside refinement, and error over tolerance, estimated and true, of the energy norm and of goals."""
    ka.warmup()
    some = slice(1 if quick else None)
    rows = [
        row for name, start, problem in models(MODELS[some]) for row in _rows(name, start, problem, TOLERANCES[some])
    ]
    rows += [row for case in goal_cases(1) for row in _goal_rows(case, GOAL_TOLERANCES[some])]
    ratios = np.array([float(row[2].rpartition(" ")[2]) for row in rows if row[2]])
    summary = (
        f"Error over tolerance of {ratios.size} runs of order auto: median {np.median(ratios):.2f}, 95 % at most "
        f"{np.quantile(ratios, 0.95):.2f}, largest {ratios.max():.2f}."
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
            # scikit-fem does not refine pairs alike
            yield [
                name,
                f"{rtol:g}",
                auto,
                *("" if problem.pairs else cell(run, order, rtol) for run in (adapted, refined)),
            ]
            auto = ""


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
        yield [case.name, f"{rtol:g}", _cell(found, rtol, abs(best.goal / case.exact - 1.0)), "", ""]


def adapted(start: MeshTri, problem: Magnetostatics, rtol: float) -> Run:
    began = time.process_time()
    result = ka.adapt(start, problem, rtol=rtol)
    seconds, best = time.process_time() - began, result.best
    return Run(seconds, best.unknowns, best.order, result.solution, result.mesh, best.estimate / best.energy_norm)


def refined(start: MeshTri, problem: Magnetostatics, rtol: float) -> Run:
    """Refine as scikit-fem does, by the threshold that takes less time."""

    def named(mesh: MeshTri) -> MeshTri:
        return mesh.with_boundaries(dict.fromkeys(start.boundaries or (), mesh.boundary_facets()))

    def run(theta: float) -> Run:
        mesh, began = MeshTri(start.p, start.t).with_subdomains(start.subdomains or {}), time.process_time()
        while True:
            known = named(mesh)
            field = problem.solve(known)
            indicators = problem.indicators(known, field)
            estimate = float(np.linalg.norm(indicators)) / problem.energy_norm(known, field)
            if estimate <= rtol:
                unknowns, seconds = field.elements.doflocs.shape[1], time.process_time() - began
                return Run(seconds, unknowns, problem.order, field, known, estimate)
            mesh = mesh.refined(adaptive_theta(indicators, theta=theta))

    return min((run(theta) for theta in THETAS), key=lambda found: found.seconds)


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
