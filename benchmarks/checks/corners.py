"""Hold estimates of adapted meshes at corners with small exponents against the error."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import kohonen_adapt as ka
from benchmarks.problems.four_squares import (
    RATIO,
    ByRecovery,
    Kellogg,
    PolishedByRecovery,
    Squares,
    Touching,
    error_of_field,
    in_magnetostatics,
    squares_mesh,
)
from benchmarks.table import markdown

PERMEABILITIES = (3.0, 10.0, 30.0, 100.0, RATIO, 1000.0)
HARD = 300.0  # permeability above which 5 % are out of reach


@dataclass(frozen=True)
class Run:
    """Error, estimate and tolerance, all relative to the computed energy norm."""

    error: float
    told: float
    rtol: float
    converged: bool


def report(seeds: Sequence[int], quick: bool) -> str:
    """Errors of runs to a tolerance, and estimate over error."""
    chosen = all_squares()[: 3 if quick else None]
    found = [[run_of(squares, problem, name) for name, problem in problems(squares)] for squares in chosen]
    rows = [[title(each), f"{exponent(each):.2f}", *map(cell, runs)] for each, runs in zip(chosen, found, strict=True)]
    worst = max(run.error / run.rtol for runs in found for run in runs if run.converged)
    names = [name for name, _ in problems(chosen[0])]
    table = markdown(["four squares: error %, estimate / error", "exponent", *names], rows)
    return f"{table}\n\nThe largest error of a run that converged is {worst:.2f} times its tolerance."


def cell(run: Run) -> str:
    """Error and estimate over error."""
    missed = "" if run.converged else " (missed)"
    return f"{100.0 * run.error:.3g}, {run.told / run.error:.2f}{missed}"


def all_squares() -> list[Squares]:
    """Flux through iron of several permeabilities, and Kellogg's solution."""
    return [*map(Touching, PERMEABILITIES), Kellogg()]


def title(squares: Squares) -> str:
    """What stands in the first column."""
    return "Kellogg" if isinstance(squares, Kellogg) else f"mu_r = {squares.permeability:.4g}"


def exponent(squares: Squares) -> float:
    """The exact exponent."""
    return float(4.0 / np.pi * np.arctan(squares.permeability**-0.5))


def problems(squares: Squares) -> Iterator[tuple[str, Any]]:
    """In magnetostatics and by recovery."""
    for order in (1, 2, "auto"):
        yield f"order {order}", in_magnetostatics(squares, order)
    yield "recovery, no ritz", ByRecovery(squares)
    yield "recovery", PolishedByRecovery(squares)


def run_of(squares: Squares, problem: Any, name: str) -> Run:
    """Adapt to a tolerance."""
    rtol = 0.05 if squares.permeability < HARD else 0.4
    rtol = 0.4 * rtol if name == "order auto" else 2.0 * rtol if "recovery" in name and rtol < 0.1 else rtol
    result = ka.adapt(squares_mesh(), problem, rtol=rtol)
    own = isinstance(problem, ByRecovery)
    error = problem.error(result.mesh, result.solution) if own else error_of_field(squares, result.solution)
    norm = problem.energy_norm(result.mesh, result.solution)
    return Run(error / norm, result.estimate / norm, rtol, result.status is ka.Status.CONVERGED)
