"""Assess a mesh: solve, estimate, and see what functional the solution minimises."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import Settings
from kohonen_adapt.loop.steps import Steps
from kohonen_adapt.mesh.measures import area, quality
from kohonen_adapt.outline.movable import MovableMesh, Work
from kohonen_adapt.polishing.functional import Functional, VariesInside
from kohonen_adapt.polishing.polish import descend
from kohonen_adapt.polishing.transfer import carried
from kohonen_adapt.problem.outputs import output_value
from kohonen_adapt.problem.protocol import (
    NotOffered,
    Problem,
    energy_norm,
    estimate,
    norm_of,
    order_of,
    ritz_of,
    solve,
    solve_again,
)
from kohonen_adapt.problem.ritz import functional_value
from kohonen_adapt.som.density import density_from_indicators
from kohonen_adapt.som.relocate import Moved
from kohonen_adapt.som.training_points import Density, density_of

__all__ = ["UNSOLVED", "Solved", "assess", "assessed_again", "density_for", "polish_moved"]

UNSOLVED = object()
"""In place of the solution of a pass that was not solved in this process."""


@dataclass(frozen=True)
class Solved:
    """A pass with what the next one starts from, which no file keeps.

    Attributes
    ----------
    record
        The pass.
    solution
        What the problem's ``solve`` returned; `UNSOLVED` in a process that did not solve it.
    functional
        What the polish can lower, or None.
    """

    record: Pass
    solution: Any
    functional: Functional | None = None


def assess(
    problem: Problem,
    movable: MovableMesh,
    settings: Settings,
    steps: Steps,
    before: Solved | None = None,
    moved: Moved | None = None,
    polish_gain: float = 0.0,
) -> Solved:
    """Solve and estimate a movable mesh as it is now.

    Parameters
    ----------
    problem, movable, settings
        What is solved, where, and with which outputs.
    steps
        Times the steps.
    before, moved, polish_gain
        The pass before, and what made this mesh from that one's; None for the input.
    """
    mesh = movable.mesh() if before else movable.came_from
    with steps("solve"):
        solution = solve(problem, mesh, before.record.mesh if before else None, before.solution if before else None)
    with steps("estimate"):
        indicators = estimate(problem, mesh, solution)
        norm = energy_norm(problem, mesh, solution, settings.rtol)
        functional, value, unpolished = functional_of(problem, movable, mesh, solution, settings)
    qualities, weight = quality(mesh), 1.0 if norm_of(problem) == "energy" else np.sqrt(area(mesh))
    record = Pass(
        **vars(moved.work(movable, polish_gain) if moved else Work()),
        number=before.record.number + 1 if before else 0,
        mesh=mesh,
        indicators=indicators,
        nodes=numbers_in_input(before, moved, movable),
        estimate=root_of_squares(indicators),
        worth=root_of_squares(weight * indicators),
        energy_norm=norm,
        min_quality=float(qualities.min()),
        mean_quality=float(qualities.mean()),
        functional=value,
        comparable=functional is not None and functional.comparable,
        unpolished=unpolished,
        outputs=outputs_of(solution, settings, steps),
        seconds=steps.seconds,  # last, for outputs take their time, too
    )
    return Solved(record, solution, functional)


def outputs_of(solution: Any, settings: Settings, steps: Steps) -> dict[str, float]:
    """The values of all outputs of a solution."""
    values = {}
    for name, function in settings.outputs.items():
        with steps("estimate", f"output {name!r}"):
            values[name] = output_value(name, function, solution)
    return values


def assessed_again(problem: Problem, movable: MovableMesh, settings: Settings, record: Pass) -> Solved:
    """Solve a mesh that another process solved and estimated, to go on from there.

    Raises
    ------
    ValueError
        If its indicators are no longer those of before, so that it is another problem.
    """
    solution = solve_again(problem, record.mesh, record.indicators)
    return Solved(record, solution, functional_of(problem, movable, record.mesh, solution, settings)[0])


def functional_of(
    problem: Problem, movable: MovableMesh, mesh: MeshTri, solution: Any, settings: Settings
) -> tuple[Functional | None, float | None, str]:
    """What the solution minimises and its value, None where there is no polish, and then why not."""
    if not settings.polish:
        return None, None, "it is switched off"
    if norm_of(problem) != "energy":
        return None, None, f"its norm is {norm_of(problem)!r}, not 'energy'"
    try:
        ritz = ritz_of(problem, mesh, solution)
        value = functional_value(mesh, ritz)
        return Functional.of(ritz, movable), value, ""
    except NotOffered as offered:
        return None, None, str(offered)
    except VariesInside:
        return None, None, "its coefficients vary inside a region of the mesh"


def density_for(problem: Problem, movable: MovableMesh, solved: Solved) -> Density:
    """The density of nodes for which all elements of the mesh would carry the same error."""
    record = solved.record
    density = density_from_indicators(record.mesh, record.indicators, order=order_of(problem), norm=norm_of(problem))
    return density_of(movable.triangulation, density)


def polish_moved(movable: MovableMesh, moved: Moved, functional: Functional | None) -> float:
    """Carry the last solution to the moved mesh and descend its functional there; returns what that gained."""
    if functional is None:
        return 0.0
    values, fixed = carried(functional, moved.before, movable, moved.recycled.hint)
    return descend(movable, functional, values, fixed)


def numbers_in_input(before: Solved | None, moved: Moved | None, movable: MovableMesh) -> Ints:
    """Number in the input of every node of a mesh, -1 for a new one."""
    if before is None or moved is None:
        return np.arange(movable.nnodes)
    old = moved.recycled.old
    return np.where(old >= 0, before.record.nodes[old], -1)


def root_of_squares(values: Floats) -> float:
    """Square root of the sum of squares, scaled so that neither tiny nor huge values are lost."""
    largest = values.max()
    return float(largest * np.linalg.norm(values / largest)) if largest > 0.0 else 0.0
