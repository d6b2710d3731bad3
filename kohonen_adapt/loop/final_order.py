"""Result of a higher order than the passes, with layers at corners."""

from dataclasses import replace
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.geometry.plane.corner_layers import refined_at
from kohonen_adapt.geometry.plane.movable import Work
from kohonen_adapt.loop.passes import Pass, Status
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.step import Adaptation, root_of_squares
from kohonen_adapt.loop.step_timer import StepFailed
from kohonen_adapt.loop.stopping import StopTest, failed_ending, interrupted_ending
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.mesh.polynomials import count_unknowns
from kohonen_adapt.problem.evaluation import energy_norm, estimate, goal_error_of, goal_of, ritz_of, solve
from kohonen_adapt.problem.protocol import NotOffered, Problem, has_method, order_of
from kohonen_adapt.problem.singular_nodes import Materials, singular_nodes

__all__ = ["at_final_order"]

LAYERS_PER_ORDER = 0.5  # the error at the corners falls with the layers as the error of smooth parts with the order


def at_final_order(result: AdaptResult, problem: Problem, adaptation: Adaptation, stop: StopTest) -> AdaptResult:
    """Refine at the corners, and solve and estimate with the order of the problem.

    A run that was stopped or has failed stays as it is.
    """
    if result.status in (Status.STOPPED, Status.FAILED):
        return result
    try:
        return raised(result, problem, adaptation, stop)
    except KeyboardInterrupt:
        ending = interrupted_ending(result.history, result.best)
    except StepFailed as failure:
        ending = failed_ending(failure, result.best)
    return replace(result, status=ending.status, message=ending.message, error=ending.error)


def raised(result: AdaptResult, problem: Problem, adaptation: Adaptation, stop: StopTest) -> AdaptResult:
    order, steps, rules = order_of(problem), adaptation.steps, adaptation.settings.rules
    layers = int(LAYERS_PER_ORDER * order)
    steps.next_pass(len(result.history))
    with steps("relocate"):
        nodes = corners_of_field(result, adaptation.problem)
        mesh = replace(result.mesh)  # a pass is known by its mesh
        if nodes.size:
            mesh = refined_at(mesh, nodes, layers, periodic=rules.periodic, curves=rules.curves)
        number_facets(mesh)
    with steps("solve"):
        if has_method(problem, "on_curves"):
            problem = problem.on_curves(rules.curves or {})  # type: ignore[attr-defined]
        solution = solve(problem, mesh, result.mesh, result.solution)
    record = replace(assessed(result, problem, adaptation, mesh, solution), seconds=steps.seconds)
    ending = stop((*result.history, record), record, False, False)
    converged = ending if ending is not None and ending.status is Status.CONVERGED else None
    before = (converged or result).message
    made = f"Solved with order {order} on {layers} layers at {nodes.size} corners, {record.unknowns} unknowns"
    return replace(
        result,
        mesh=mesh,
        solution=solution,
        indicators=record.indicators,
        estimate=record.estimate,
        history=(*result.history, record),
        status=converged.status if converged else result.status,
        message=f"{before} {made}: estimate {record.estimate_text}.",
        nodes=record.nodes,
    )


def corners_of_field(result: AdaptResult, problem: Problem) -> Ints:
    mesh, solution = result.mesh, result.solution
    if has_method(problem, "singular_nodes"):
        return np.asarray(problem.singular_nodes(mesh, solution))  # type: ignore[attr-defined]
    try:
        return singular_nodes(mesh, Materials.of(mesh, ritz_of(problem, mesh, solution)))
    except NotOffered:
        return np.zeros(0, dtype=np.int64)


def assessed(result: AdaptResult, problem: Problem, adaptation: Adaptation, mesh: Mesh, solution: Any) -> Pass:
    best, last = result.best, result.history[-1]
    with adaptation.steps("estimate"):
        indicators = estimate(problem, mesh, solution)
        norm = energy_norm(problem, mesh, solution, adaptation.settings.rtol)
        goal = goal_of(problem, solution)
        error = None if goal is None else goal_error_of(problem, solution)
    qualities, total = quality(mesh), root_of_squares(indicators)
    return replace(
        best,
        **vars(Work()),  # no node moves
        number=last.number + 1,
        mesh=mesh,
        indicators=indicators,
        nodes=np.append(best.nodes, np.full(mesh.nvertices - best.nodes.size, -1)),
        order=int(order_of(problem)),
        unknowns=count_unknowns(mesh, order_of(problem)),
        estimate=total,
        worth=total,
        energy_norm=norm,
        min_quality=float(qualities.min()),
        mean_quality=float(qualities.mean()),
        functional=None,
        comparable=False,
        unpolished="",
        goal=goal,
        goal_error=error,
        outputs=adaptation.outputs(solution),
    )
