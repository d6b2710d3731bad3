"""Check the arguments of a magnetostatic problem, each by itself and then together."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from kohonen_adapt.checks import is_number, listed
from kohonen_adapt.magnetostatics.estimation import ESTIMATORS
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.goals import Goal

if TYPE_CHECKING:
    from kohonen_adapt.magnetostatics.problem import Magnetostatics

__all__ = ["check_problem", "checked_pairs", "checked_turns"]


def check_problem(problem: "Magnetostatics") -> None:
    """Refuse arguments of another kind, and those that do not go together."""
    if problem.estimator not in ESTIMATORS:
        names = ", ".join(repr(name) for name in ESTIMATORS)
        raise ValueError(f"estimator must be one of {names}; got {problem.estimator!r}.")
    if not isinstance(problem.materials, Mapping):
        raise ValueError(f"materials must map subdomain names to Materials; got {problem.materials!r}.")
    for name, material in problem.materials.items():
        if not isinstance(material, Material):
            raise ValueError(f"materials[{name!r}] must be a Material; got {material!r}.")
    _check_fixed(problem)
    _check_order(problem)
    _check_depth(problem)
    _check_bound(problem)
    if problem.goal is not None:
        _check_goal(problem)


def _check_fixed(problem: "Magnetostatics") -> None:
    elsewhere = problem.open_boundary is not None or problem.antiperiodic or problem.axisymmetric
    given = isinstance(problem.potential, Mapping) and len(problem.potential) > 0
    if not given and not (elsewhere and problem.potential in (None, {})):
        raise ValueError(
            "potential must fix A on at least one boundary, for instance {'outer': 0.0}: "
            f"otherwise A is known only up to a constant; got {problem.potential!r}."
        )


def _check_order(problem: "Magnetostatics") -> None:
    if problem.order not in (1, 2) or isinstance(problem.order, bool):
        raise ValueError(f"order of the elements must be 1 or 2; got {problem.order!r}.")
    if problem.order == 2 and problem.axisymmetric:
        raise ValueError("axisymmetric problems have elements of order 1 only; got order 2.")
    if problem.order == 2 and problem.estimator != "residual":
        raise ValueError(f"elements of order 2 have the estimator 'residual' only; got {problem.estimator!r}.")


def _check_depth(problem: "Magnetostatics") -> None:
    if problem.depth is None:
        return
    if problem.axisymmetric:
        raise ValueError(f"an axisymmetric problem has no depth, its results are totals; got depth {problem.depth!r}.")
    if not is_number(problem.depth) or not 0.0 < problem.depth < np.inf:
        raise ValueError(f"depth must be a finite number > 0 in metres, or None; got {problem.depth!r}.")


def _check_bound(problem: "Magnetostatics") -> None:
    beyond = {
        "an axis": problem.axisymmetric,
        "an open boundary": problem.open_boundary is not None,
        "periodic sides": bool(problem.periodic),
        "antiperiodic sides": bool(problem.antiperiodic),
    }
    has = [name for name, there in beyond.items() if there]
    if problem.estimator == "equilibrated" and has:
        raise ValueError(
            f"estimator 'equilibrated' bounds the error of planar problems with potentials and natural conditions; "
            f"this one has {' and '.join(has)}: take 'residual' or 'recovery'."
        )


def _check_goal(problem: "Magnetostatics") -> None:
    if isinstance(problem.goal, type) or not isinstance(problem.goal, Goal):
        raise ValueError(
            "goal must be a Force, Torque, FluxLinkage, StoredEnergy or another object with goal(field) and "
            f"goal.derivative(field), or None; got {problem.goal!r}."
        )
    if problem.order == 2:
        raise ValueError("a goal needs elements of order 1; got order 2.")
    if problem.estimator != "residual":
        raise ValueError(f"a goal has its own indicators; leave the estimator out, got {problem.estimator!r}.")


def checked_turns(given: Any, materials: Mapping[str, Material]) -> dict[str, float]:
    """The ampere-turns of a problem as a dict of its own.

    Raises
    ------
    ValueError
        If they are no mapping of the names of materials to finite numbers, or a material has a current density besides.
    """
    if given is not None and not isinstance(given, Mapping):
        raise ValueError(f"ampere_turns must map subdomain names to amperes; got {given!r}.")
    for name, total in (given or {}).items():
        if name not in materials:
            raise ValueError(f"ampere_turns has {name!r}, which is not among the materials: {listed(materials)}.")
        if not is_number(total) or not np.isfinite(total):
            raise ValueError(f"ampere_turns of {name!r} must be a finite number in A; got {total!r}.")
        if materials[name].current_density != 0.0:
            raise ValueError(
                f"the coil {name!r} has ampere_turns or a current density; got both, "
                f"{materials[name].current_density:g} A/m^2 of its material."
            )
    return {name: float(total) for name, total in (given or {}).items()}


def checked_pairs(name: str, given: Any) -> tuple[tuple[str, str], ...]:
    """The pairs of an argument as a tuple of tuples.

    Raises
    ------
    ValueError
        If they are none.
    """
    pairs = list(given) if isinstance(given, list | tuple) else None
    if pairs is None or not all(isinstance(pair, tuple | list) and len(pair) == 2 for pair in pairs):
        raise ValueError(f"{name} must hold pairs of names of boundaries, as [('left', 'right')]; got {given!r}.")
    return tuple((one, other) for one, other in pairs)
