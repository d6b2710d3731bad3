"""Results of a higher order than the passes, on layers at corners and edges.

The passes grade the mesh at order 2. Then layers at the corners of the field and one solve of a higher order take less
time than more nodes, because the error falls exponentially (B. Guo and I. Babuska, Comput. Mech. 1, 1986).
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.geometry.movable import Work
from kohonen_adapt.geometry.plane.movable import MovableMesh
from kohonen_adapt.geometry.singular_layers import with_layers
from kohonen_adapt.loop.corners import corner_remark, singular_parts
from kohonen_adapt.loop.growth import predicted_nodes
from kohonen_adapt.loop.history import History, run_loop
from kohonen_adapt.loop.passes import Pass, Status, StepFailed
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.sides import Sides, on_whole_curves
from kohonen_adapt.loop.step import Adaptation
from kohonen_adapt.loop.stopping import (
    Ending,
    StopTest,
    beside_goal_remark,
    best_pass_text,
    count_text,
    failed_ending,
    interrupted_ending,
)
from kohonen_adapt.mesh.cells import TETRAHEDRON, TRIANGLE
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.problem.protocol import OF_PASSES, CheckedProblem

__all__ = ["HIGH_ORDERS", "GradingTolerance", "run_to_order"]

logger = logging.getLogger("kohonen_adapt")

DIRECT = 0.5  # fraction of this error from which a tolerance is met by passes alone
OF_GOAL = 10.0  # tolerance of passes for goals, as a multiple of the tolerance of the estimate
SMOOTH = 2.0  # least gain of a raised order; below, the solution is not smooth and the passes go on alone
SAFE = 0.8  # of the tolerance of passes before a higher order
FINER = 0.7  # of the tolerance of the passes after a raised order that did not suffice, at most


@dataclass(frozen=True)
class HighOrders:
    """Gains of high orders on layers, in the plane or in space.

    Attributes
    ----------
    graded
        Relative error at order 2 of a mesh that is graded well enough for higher orders.
    enough
        Relative error up to which no pass follows: one order more takes less time than a pass that only adds nodes.
    gains
        Error at order 2 over the error of a higher order, on a mesh of the former error with layers.
    orders_per_layer
        Order of the elements, over the number of layers.
    few
        Nodes at order 2 that take less time than a higher order, relative to the nodes of the last pass.
    """

    graded: float
    enough: float
    gains: Mapping[int, float]
    orders_per_layer: float
    few: float = 0.0

    def gain(self, order: int) -> float:
        return self.gains[min(order, max(self.gains))]

    def layers(self, order: int) -> int:
        return int(order / self.orders_per_layer)


HIGH_ORDERS = {
    TRIANGLE.dim: HighOrders(0.019, 0.03, {4: 8.0, 5: 17.0, 6: 34.0, 7: 60.0, 8: 100.0}, 2.0),  # C-core, 211 nodes
    TETRAHEDRON.dim: HighOrders(0.1, 0.15, {4: 9.0, 5: 16.0, 6: 25.0}, 2.5, 6.5),  # Fichera's corner, 120 and 250 nodes
}


@dataclass
class GradingTolerance:
    """Tolerance of the passes at order 2, lowered if higher orders do not suffice.

    Attributes
    ----------
    stop
        Stop test with the tolerance of the result.
    orders
        Orders for the result.
    high
        What these orders bring.
    relative
        Tolerance of the passes, relative to the energy norm, or to the tolerance of a goal.
    """

    stop: StopTest
    orders: range
    high: HighOrders
    relative: float | None = None

    def __call__(self, last: Pass) -> float | None:
        return self._within(last, self.high.enough)

    def _within(self, last: Pass, enough: float) -> float | None:
        tolerance = self.stop.tolerance(last)
        if tolerance is None:
            return None
        if last.energy_norm is None:
            return max(1.0, OF_GOAL if self.relative is None else self.relative) * tolerance
        aim, graded = (self.high.graded, enough) if self.relative is None else (self.relative,) * 2
        if tolerance > DIRECT * aim * last.energy_norm or self._needs_few(last, tolerance):
            return tolerance
        return min(graded * last.energy_norm, self.high.gain(self.orders[-1]) * tolerance)

    def _needs_few(self, last: Pass, tolerance: float) -> bool:
        # True if order 2 meets the tolerance with few nodes, and no higher order is prescribed
        nodes = predicted_nodes(last, tolerance, OF_PASSES, last.mesh.dim())
        return len(self.orders) > 1 and nodes < self.high.few * last.mesh.nvertices

    def aim(self, last: Pass) -> float | None:
        # Return the estimate that passes aim at, to meet the tolerance at once.
        tolerance = self._within(last, self.high.graded)
        return tolerance and (tolerance if tolerance == self.stop.tolerance(last) else SAFE * tolerance)

    def lower(self, last: Pass, factor: float) -> None:
        unit = last.energy_norm if last.energy_norm is not None else self.stop.tolerance(last)
        self.relative = factor * last.estimate / unit if unit else 0.0


def run_to_order(
    adaptation: Adaptation,
    history: History,
    problem: CheckedProblem,
    stop: StopTest,
    grading: GradingTolerance,
) -> AdaptResult:
    result, orders = run_loop(adaptation, history), grading.orders
    while result.status not in (Status.STOPPED, Status.FAILED) and not (len(orders) > 1 and is_met(result, stop)):
        if stop.asked.unreachable_text(result.history):
            return result
        try:
            raised = at_orders(result, problem, adaptation, stop, grading, history.best_curved)
        except (KeyboardInterrupt, StepFailed) as cause:
            ending = interrupted_ending(result.history, result.best)
            if isinstance(cause, StepFailed):
                ending = failed_ending(cause, result.best)
            return replace(result, status=ending.status, message=ending.message, error=ending.error)
        tolerance = stop.tolerance(raised.best)
        more = result.history[-1].number < stop.passes and result.status is Status.CONVERGED
        if raised.status is Status.CONVERGED or tolerance is None or not (more and raised.estimate):
            history.report(raised)
            return raised
        missing = tolerance / raised.estimate
        smooth = result.estimate > SMOOTH * raised.estimate
        grading.lower(result.best, min(FINER, missing) if smooth else tolerance / result.estimate)
        logger.info("order %d has %.3g times the tolerance; passes go on", raised.best.order, 1.0 / missing)
        history.reopen()
        result = run_loop(adaptation, history)
    return result


def is_met(result: AdaptResult, stop: StopTest) -> bool:
    tolerance = stop.tolerance(result.best)
    return tolerance is not None and result.estimate <= tolerance


def at_orders(
    result: AdaptResult,
    problem: CheckedProblem,
    adaptation: Adaptation,
    stop: StopTest,
    grading: GradingTolerance,
    curved: MovableMesh | None,
) -> AdaptResult:
    tolerance, orders, high = stop.tolerance(result.best), grading.orders, grading.high
    wanted = result.estimate / tolerance if tolerance else np.inf
    order = next((order for order in orders if high.gain(order) > wanted), orders[-1])
    while True:
        raised = at_order(result, problem, adaptation, stop, order, high.layers(order), curved)
        if raised.status is Status.CONVERGED or order >= orders[-1] or not tolerance:
            return raised
        if result.estimate < SMOOTH * raised.estimate:
            return raised
        order = min(orders[-1], order + (1 if raised.estimate < FINER**-2 * tolerance else 2))


def at_order(
    result: AdaptResult,
    problem: CheckedProblem,
    adaptation: Adaptation,
    stop: StopTest,
    order: int,
    layers: int,
    curved: MovableMesh | None,
) -> AdaptResult:
    steps = adaptation.steps
    steps.next_pass(len(result.history))
    with steps("relocate"):
        mesh, places, remark = layered(result, adaptation, layers, curved)
    with steps("solve"):
        if problem.has("on_curves"):
            problem = problem.on_curves(adaptation.settings.rules.curves or {})
        problem = CheckedProblem(problem, order)
        solution = problem.solve(mesh, result.mesh, result.solution)
    record = assessed(result, problem, adaptation, mesh, solution)
    record = replace(record, seconds=steps.seconds, compile_seconds=steps.compile_seconds)
    history = (*result.history, record)
    ending = ending_at_order(history, result.status, stop)
    on_layers = f" on {layers} layer{'s' * (layers > 1)} at {places}" if places else ""
    made = f"Solved with order {order}{on_layers}, {record.unknowns} unknowns.{remark}"
    named = corner_remark(ending.status, problem, mesh, None)
    return replace(
        result,
        mesh=mesh,
        solution=solution,
        indicators=record.indicators,
        estimate=record.estimate,
        history=history,
        status=ending.status,
        message=" ".join(filter(None, [ending.message, made, named, beside_goal_remark(record)])),
        nodes=record.nodes,
    )


def layered(
    result: AdaptResult, adaptation: Adaptation, layers: int, curved: MovableMesh | None
) -> tuple[Mesh, str, str]:
    # Returned are the mesh with layers, the corners or edges that have them, and a remark.
    rules, whole, remark = adaptation.settings.rules, result.mesh, ""
    corners, edges = singular_parts(adaptation.problem, result.mesh, result.solution)
    if edges is not None:
        mesh, nodes = with_layers(whole, np.union1d(corners, edges), layers, edges=edges)
        places = f"singular edges with {nodes.size} nodes"
    else:
        if curved is not None:
            whole = on_whole_curves(result.mesh, curved)
            remark = remark_on_sides(curved.flattened(whole))
        mesh, nodes = with_layers(whole, corners, layers, rules.periodic, rules.curves)
        places = f"{nodes.size} corner{'s' * (nodes.size > 1)}"
    number_facets(mesh)
    return mesh, places * bool(nodes.size), remark


def ending_at_order(history: tuple[Pass, ...], status: Status, stop: StopTest) -> Ending:
    record, ending = history[-1], stop(history, history[-1], False, False)
    if ending is not None and ending.status is Status.CONVERGED:
        return ending
    text = f"Stopped after {count_text(history)}{stop.asked.missed_text(record)}"
    return Ending(status if stop.tolerance(record) is None else Status.MAX_PASSES, f"{text}. {best_pass_text(record)}")


def remark_on_sides(distance: float) -> str:
    if not distance:
        return ""
    return f" Sides are up to {distance:.2g} off their curves, which no estimate includes; use more nodes there."


def assessed(result: AdaptResult, problem: CheckedProblem, adaptation: Adaptation, mesh: Mesh, solution: Any) -> Pass:
    best, last, sides = result.best, result.history[-1], Sides(problem, mesh, solution)
    with adaptation.steps("estimate"):
        figures = adaptation.figures(sides, problem.order, has_all_errors=True)
        has_goal = figures["goal"] is not None
        outputs = adaptation.figures_of_outputs(sides, figures, best, has_errors=has_goal)
    return replace(
        best,
        **vars(Work()),  # no node moves
        **figures,
        **outputs,
        number=last.number + 1,
        mesh=mesh,
        nodes=np.append(best.nodes, np.full(mesh.nvertices - best.nodes.size, -1)),
        functional=None,
        comparable=False,
        unpolished="",
    )
