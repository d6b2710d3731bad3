"""Functional of a pass for the polish and for the comparison of passes."""

from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.polishing.energy_tables import VariesInside
from kohonen_adapt.polishing.functional import Functional
from kohonen_adapt.polishing.unresolved_data import UnresolvedData
from kohonen_adapt.problem.evaluation import ritz_of
from kohonen_adapt.problem.functional_value import functional_value
from kohonen_adapt.problem.protocol import CheckedProblem, NotOffered
from kohonen_adapt.problem.ritz import Ritz

FROZEN = "the functional is another one in every pass, as with a term frozen at the solution"
# Change of a functional by the data of the pass before, relative to its change since then, of another functional
ANOTHER = 0.1


@dataclass(frozen=True)
class FunctionalOfPass:
    """Functional of a solution.

    Attributes
    ----------
    functional
        The functional, or None.
    value
        Its value, or None if it only shapes elements.
    unpolished
        Reason for having no functional, or an empty string.
    oscillation
        Data oscillation if the mesh does not resolve the data of the functional, else 0.
    """

    functional: Functional | None = None
    value: float | None = None
    unpolished: str = ""
    oscillation: float = 0.0


def functional_of(
    problem: CheckedProblem, method: ModuleType, movable: Any, mesh: Mesh, solution: Any, share: float | None = None
) -> FunctionalOfPass:
    # A dual gets the weight `share` of an earlier pass.
    in_energy_norm = problem.norm == "energy"
    if not in_energy_norm and not problem.calibrated:  # the polish stretches elements, which residuals overrate
        return FunctionalOfPass(unpolished=f"the norm {problem.norm!r} requires `calibrated` indicators")
    try:
        ritz = ritz_of(problem, mesh, solution)
        ritz = ritz if in_energy_norm else replace(ritz, comparable=False)
        ritz = ritz if share is None else replace(ritz, share=share)
        functional = method.functional(ritz, movable, mesh)
        return FunctionalOfPass(functional, None if ritz.shapes_only else method.value(functional, ritz, movable, mesh))
    except UnresolvedData as reason:
        return FunctionalOfPass(unpolished=str(reason), oscillation=reason.oscillation)
    except NotOffered as reason:
        return FunctionalOfPass(unpolished=str(reason))
    except VariesInside:
        return FunctionalOfPass(unpolished="coefficients vary inside a region of the mesh")


def differs_on(mesh: Mesh, ritz: Ritz, old: Ritz, before: Pass) -> bool:
    # True if the data of an earlier pass give another value at the same solution
    changed = {}
    for name in ("coefficient", "source", "flux"):
        data, now = getattr(old, name), getattr(ritz, name)
        if callable(data) != callable(now) or np.shape(data) != np.shape(now):
            continue
        if data != now if callable(data) else not np.array_equal(data, now):
            changed[name] = data
    if not changed or before.functional is None:
        return False
    value, by_old_data = functional_value(mesh, ritz), functional_value(mesh, replace(ritz, **changed))
    return abs(by_old_data - value) > ANOTHER * abs(before.functional - value)
