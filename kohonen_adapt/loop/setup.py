"""Checks and choices of an adaptive loop before its first pass."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from skfem import Mesh

from kohonen_adapt.checks import is_count
from kohonen_adapt.geometry.rules import Rules, check_for, with_pinned
from kohonen_adapt.log import logger
from kohonen_adapt.loop.grading import HIGH_ORDERS, GradingTolerance
from kohonen_adapt.loop.growth import MAX_NODES, Growth, GrowthByTolerance, NodeCounts
from kohonen_adapt.loop.passes import Pass
from kohonen_adapt.loop.settings import PASSES, PASSES_TO_TOLERANCE, Tolerance
from kohonen_adapt.loop.stopping import StopTest
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.problem.evaluation import Output, curves_of
from kohonen_adapt.problem.protocol import CheckedProblem


def rules_for(problem: CheckedProblem, mesh: Mesh, rules: Rules, periodic: Sequence[Pair] | None) -> Rules:
    pairs = problem.pairs if periodic is None else periodic
    rules = replace(rules, curves=curves_of(problem, mesh, rules.curves), periodic=pairs)
    check_for(rules, mesh.dim())
    return with_pinned(rules.guarded(), problem.nodes_on(mesh))


def graded(stop: StopTest, problem: CheckedProblem, dim: int) -> tuple[StopTest, CheckedProblem]:
    """Return the stop test and the problem of passes before a higher order."""
    orders = problem.final_orders(stop.max_nodes is not None)
    if not orders:
        return stop, problem
    grading = GradingTolerance(stop.asked, orders, HIGH_ORDERS[dim])
    return replace(stop, grading=grading), problem.at_grading_order


def stop_test(
    mesh: Mesh,
    passes: int | None,
    tolerance: Tolerance,
    target_nodes: int | None,
    callback: Callable[[Pass], Any] | None,
    max_nodes: int | None,
) -> StopTest:
    follows = bool(tolerance) and target_nodes is None
    if follows and not any(vars(tolerance).values()):
        raise ValueError("a tolerance of 0 is never met; give one above 0, for instance rtol=1e-3, or target_nodes.")
    if max_nodes is not None and not follows:
        raise ValueError("max_nodes needs a tolerance (rtol or atol) and no target_nodes, which fixes the number.")
    if max_nodes is not None and (not is_count(max_nodes) or max_nodes < mesh.nvertices):
        raise ValueError(f"max_nodes must be at least the nodes of the mesh, {mesh.nvertices}; got {max_nodes!r}.")
    most_passes = (PASSES_TO_TOLERANCE if follows else PASSES) if passes is None else passes
    return StopTest(most_passes, tolerance, callback, (max_nodes or MAX_NODES) if follows else None)


def node_counts(
    problem: CheckedProblem, mesh: Mesh, rules: Rules, target_nodes: int | None, stop: StopTest
) -> NodeCounts:
    start, dim = int(mesh.nvertices), mesh.dim()
    if stop.max_nodes is None:
        # At order 1 in the plane the misplaced nodes cost 0.5 to 1 % of the error after three or four passes, and save
        # a pass over all nodes, with 1.4 to 1.9 times the time. At higher orders they cost several per cent, and on
        # tetrahedra as well, because growth by density shortens long elements.
        corrected = dim == TRIANGLE.dim and problem.has_functional and problem.order == 1
        return Growth.of(start, target_nodes, stop.passes, corrected)
    allowed = stop.grading.aim if stop.grading else stop.tolerance
    removes = rules.topology == "recycle"
    return GrowthByTolerance(start, stop.max_nodes, allowed, problem.order, dim, removes)


def check_goal(problem: CheckedProblem, goal_rtol: float | None, outputs: Mapping[str, Output] | None) -> None:
    if goal_rtol is not None and not problem.has_goal:
        raise ValueError(
            "goal_rtol requires a problem with a goal and its goal_error; use rtol or output_rtol instead."
        )
    if "goal" in (outputs or {}) and problem.has_goal:
        raise ValueError("outputs must not have the name 'goal' beside a goal of the problem; rename the output.")


def aimed(problem: CheckedProblem, outputs: Mapping[str, Output], stop: StopTest) -> CheckedProblem:
    """Return the problem with the only output that has a tolerance as goal."""
    names = stop.asked.only_outputs(outputs)
    if stop.max_nodes is None or len(names) != 1 or not problem.has("aimed_at"):
        return problem
    found = CheckedProblem(problem.aimed_at(outputs[names[0]]))
    if found.given is not problem.given:
        logger.info("%s is the goal of the passes", names[0])
    return found
