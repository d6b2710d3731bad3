"""Values that a problem and its outputs return, validated."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.checks import as_reals, check_fraction, checked_mapping, listed
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.problem.protocol import (
    CheckedProblem,
    NotOffered,
    missing_norm_error,
)
from kohonen_adapt.problem.ritz import VECTORS, Ritz
from kohonen_adapt.problem.uncertain import Uncertain

__all__ = [
    "Output",
    "check_outputs",
    "check_signs",
    "curves_of",
    "energy_norm",
    "estimate",
    "functional_of_solution",
    "goal_error_of",
    "goal_of",
    "output_value",
    "ritz_of",
    "solve_again",
]

RESTART_TOLERANCE = 1e-4  # of the largest indicator: allowed effect of the start values of a nonlinear solver

Output = Callable[[Any], float]  # of the solution


def estimate(problem: CheckedProblem, mesh: Mesh, solution: Any) -> Floats:
    """Return a copy of the indicators, shape (nelements,).

    Raises ValueError for another shape, and for values that are not finite numbers >= 0.
    """
    values = as_reals("indicators of the problem", problem.indicators(mesh, solution), {"nelements": mesh.nelements})
    _check_values(values, np.isfinite(values), "finite; check the solution")
    _check_values(values, values >= 0.0, ">= 0; take their absolute values")
    largest = np.finfo(float).max / np.sqrt(len(values))
    _check_values(values, values <= largest, "small enough for the sum of their squares; check units")
    return values


def _check_values(values: Floats, good: Mask, wanted: str) -> None:
    if not good.all():
        first = int(np.argmin(good))
        raise ValueError(
            f"indicators of the problem must be {wanted}: got {values[first]} at element {first}, "
            f"{np.sum(~good)} such elements."
        )


def solve_again(problem: CheckedProblem, mesh: Mesh, indicators: Floats) -> Any:
    solution = problem.solve(mesh)
    difference = float(np.abs(estimate(problem, mesh, solution) - indicators).max())
    if difference > RESTART_TOLERANCE * indicators.max():
        raise ValueError(
            f"the problem differs from the problem of the checkpoint: indicators on the same mesh differ by up to "
            f"{difference:.3g}. Use the same problem, or another folder."
        )
    return solution


def check_signs(before: Mapping[str, float], now: Mapping[str, float]) -> None:
    # A linear problem has the same indicators after a change of the signs of its sources.
    for name, value in before.items():
        if value and abs(now[name] + value) <= RESTART_TOLERANCE * abs(value):
            raise ValueError(
                f"the problem differs from the problem of the checkpoint: output {name!r} was {value:.6g}, now "
                f"{now[name]:.6g}. Use the same problem, or another folder."
            )


def energy_norm(problem: CheckedProblem, mesh: Mesh, solution: Any, rtol: float | None = None) -> float | None:
    try:
        value = float(problem.optional("energy_norm")(mesh, solution))
    except NotOffered as reason:
        if rtol is not None:
            raise missing_norm_error(reason) from None
        return None
    if not 0.0 <= value < np.inf:
        raise ValueError(f"energy_norm of the problem must be a finite number >= 0; got {value}.")
    return value


def functional_of_solution(problem: CheckedProblem, mesh: Mesh, solution: Any) -> float:
    # by default of a linear problem with homogeneous conditions
    try:
        return float(problem.optional("functional")(mesh, solution))
    except NotOffered:
        return -0.5 * (energy_norm(problem, mesh, solution) or 0.0) ** 2


def ritz_of(problem: CheckedProblem, mesh: Mesh, solution: Any) -> Ritz:
    try:
        method = problem.optional("ritz")
    except NotOffered as reason:
        size = np.size(solution) if isinstance(solution, np.ndarray) else 0
        if size >= 2 * mesh.nvertices and all(size != count_unknowns(mesh, order) for order in (1, 2, 3, 4)):
            raise NotOffered(f"{reason}; {VECTORS}") from None
        raise
    ritz = method(mesh, solution)
    if not isinstance(ritz, Ritz):
        raise ValueError(f"ritz of the problem must return a kohonen_adapt.Ritz; got {type(ritz).__name__}.")
    if ritz.order != problem.order:
        raise NotOffered(f"the order of Ritz is {ritz.order}, the order of the problem is {problem.order}")
    return ritz


def curves_of(problem: CheckedProblem, mesh: Mesh, given: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    method = getattr(problem, "curves", None)
    if not callable(method) or not (given is None or isinstance(given, Mapping)):
        return given
    found = method(mesh)
    if not isinstance(found, Mapping | None):
        raise ValueError(
            f"curves of the problem must return a mapping of boundaries to curves, or None; got {found!r}."
        )
    return {**found, **(given or {})} if found else given


def goal_of(problem: CheckedProblem, solution: Any) -> float | None:
    return float(problem.goal(solution)) if problem.has_goal else None


def goal_error_of(problem: CheckedProblem, solution: Any) -> Uncertain:
    error = problem.goal_error(solution)
    return error if isinstance(error, Uncertain) else Uncertain(error, 0.0)


def check_outputs(outputs: Any, output_rtol: Any) -> dict[str, Output]:
    found = checked_mapping(outputs, "outputs must map names to functions of the solution, or be None")
    for name, function in found.items():
        if not isinstance(name, str):
            raise ValueError(f"the names of outputs must be strings; got {name!r}.")
        if not callable(function):
            raise ValueError(f"outputs[{name!r}] must be a function of the solution; got {function!r}.")
    if not isinstance(output_rtol, Mapping):
        check_fraction("output_rtol", output_rtol)
    if output_rtol is not None and not found:
        raise ValueError("output_rtol requires outputs; add outputs={name: function}.")
    if isinstance(output_rtol, Mapping):
        for name, tolerance in output_rtol.items():
            if name not in found:
                raise ValueError(f"output_rtol has {name!r}, which is no output; outputs are {listed(found)}.")
            check_fraction(f"output_rtol[{name!r}]", tolerance)
    return found


def output_value(name: str, function: Output, solution: Any) -> float:
    value = np.asarray(function(solution))
    if value.dtype.kind not in "iuf":
        raise ValueError(f"outputs[{name!r}] must return a real number; got {value.dtype}.")
    if value.shape != ():
        raise ValueError(
            f"outputs[{name!r}] must return one number; got an array of shape {value.shape}: "
            "return one component, or add an output for each component."
        )
    if not np.isfinite(value):
        raise ValueError(f"outputs[{name!r}] must return a finite number; got {value}.")
    return float(value)
