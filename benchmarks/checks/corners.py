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
from benchmarks.table import aligned

PERMEABILITIES = (3.0, 10.0, 30.0, 100.0, RATIO, 1000.0)
HARD = 300.0  # permeability above which 5 % are out of reach
TITLES = ["four squares", "exponent", "elements", "rtol %", "status", "N", "error %", "told / error", "error / rtol"]


@dataclass(frozen=True)
class Run:
    """A result, its error, and the tolerance, all relative to the computed energy norm."""

    result: ka.AdaptResult
    error: float
    told: float
    rtol: float


def report(seeds: Sequence[int], quick: bool) -> str:
    """Estimate over error of runs to a tolerance, and the error over the tolerance."""
    rows = []
    for squares in all_squares()[: 3 if quick else None]:
        for name, problem in problems(squares):
            run = run_of(squares, problem, name)
            status, nodes = run.result.status.value, run.result.mesh.nvertices
            figures = 100.0 * run.rtol, status, nodes, 100.0 * run.error, run.told / run.error, run.error / run.rtol
            rows.append([title(squares), exponent(squares), name, *figures])
    return aligned(TITLES, rows)


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
    return Run(result, error / norm, result.estimate / norm, rtol)
