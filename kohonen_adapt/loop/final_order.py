"""Solves of a higher order than the passes, on layers at corners and edges.

The passes grade the mesh at order 2. Then layers at the corners of the field and one solve of a higher order take less
time than more nodes, because the error falls exponentially (B. Guo and I. Babuska, Comput. Mech. 1, 1986).
"""

from dataclasses import replace

import numpy as np
from skfem import Mesh

from kohonen_adapt.display import counted
from kohonen_adapt.geometry.singular_layers import with_layers_at
from kohonen_adapt.log import logger
from kohonen_adapt.loop.corners import singular_parts
from kohonen_adapt.loop.passes import Status
from kohonen_adapt.loop.sides import on_whole_curves
from kohonen_adapt.loop.state import State, curved_of
from kohonen_adapt.loop.step import Adaptation
from kohonen_adapt.loop.stopping import StopTest
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.host import count_unknowns
from kohonen_adapt.problem.protocol import CheckedProblem, NotOffered

SMOOTH = 2.0  # least gain of a raised order; below, the solution is not smooth and the passes go on alone
FINER = 0.7  # of the tolerance of the passes after a raised order that did not suffice, at most


def raise_order(adaptation: Adaptation, stop: StopTest, state: State) -> State:
    """Solve at the order that meets the tolerance, with layers at corners.

    If no order suffices and passes are left, the state is returned without its ending, and the passes get a lower
    tolerance. The state is also returned before an order that takes more time than more nodes, or for a goal more
    unknowns than order 2.
    """
    grading, best = stop.grading, state.best.record
    if grading is None or state.ending is None:
        raise RuntimeError("the passes have not ended, or no order follows.")
    tolerance, orders, high = stop.asked.estimate(best), grading.orders, grading.high
    wanted = best.estimate / tolerance if tolerance else np.inf
    chosen = high.least(orders, wanted)
    mesh, on_layers, remark = layered(adaptation, state, chosen.layers)
    if not on_layers:
        chosen = high.least(orders, wanted, smooth=True)
    more = state.passes[-1].number < stop.passes and state.ending.status is Status.CONVERGED
    while True:
        if more and grading.prefers_nodes(best, count_unknowns(mesh, chosen.order)):
            return replace(state, ending=None, notes=())
        raised = stop.at_order(at_order(adaptation, state, chosen.order, mesh, on_layers, remark))
        last, is_met = raised.passes[-1], raised.ending is not None and raised.ending.status is Status.CONVERGED
        is_smooth = best.estimate >= SMOOTH * last.estimate
        following = tolerance and high.after(orders, chosen, last.estimate / tolerance, bool(on_layers))
        if is_met or not following or not is_smooth:
            break
        if more and following.order > chosen.order and tolerance and last.estimate < high.by_nodes * tolerance:
            break
        chosen = following
        mesh, on_layers, remark = layered(adaptation, state, chosen.layers)
    allowed = stop.asked.estimate(last)
    if is_met or allowed is None or not (more and last.estimate):
        return raised
    missing = allowed / last.estimate
    grading.lower(best, min(FINER, missing) if is_smooth else allowed / best.estimate)
    logger.info("order %d has %.3g times the tolerance; passes go on", last.order, 1.0 / missing)
    return replace(state, ending=None, notes=())


def at_order(adaptation: Adaptation, state: State, order: int, mesh: Mesh, on_layers: str, remark: str) -> State:
    problem = adaptation.problem
    if problem.has("on_curves"):
        with adaptation.steps("relocate"):
            problem = CheckedProblem(problem.on_curves(adaptation.settings.rules.curves or {}))
    solved = adaptation.assess_at(CheckedProblem(problem, order), mesh, state.best)
    passes, raised = (*state.passes, solved.record), f"Solved with order {order}{on_layers}"
    raised += f", {solved.record.unknowns} unknowns.{remark}"
    return replace(state, passes=passes, last=solved, chosen=solved, raised=raised, notes=())


def layered(adaptation: Adaptation, state: State, layers: int) -> tuple[Mesh, str, str]:
    # Returned are the mesh with layers at the corners or edges that have them, their place, and a remark.
    adaptation.steps.next_pass(len(state.passes))
    with adaptation.steps("relocate"):
        rules, whole, curved = adaptation.settings.rules, state.best.record.mesh, curved_of(state.best.movable)
        try:
            wanted, edges = singular_parts(adaptation.problem, whole, state.best.solution)
        except NotOffered:
            wanted, edges = np.zeros(0, int), np.zeros((2, 0), int) if whole.dim() == TETRAHEDRON.dim else None
        remark = ""
        if edges is not None:
            wanted = np.union1d(wanted, edges)
        elif curved is not None:
            whole = on_whole_curves(whole, curved)
            if distance := curved.flattened(whole):
                remark = (
                    f" Sides are up to {distance:.2g} off their curves, which no estimate includes; use more nodes "
                    "there."
                )
        mesh, nodes = with_layers_at(whole, wanted, layers, rules.periodic, rules.curves, edges)
        corners = f"{nodes.size} corner{'s' * (nodes.size > 1)}"
        places = corners if edges is None else f"singular edges with {nodes.size} nodes"
        if none := int(wanted.size - nodes.size):
            remark += (
                f" No layers at {counted(none, 'singular node')}, where they would invert elements or be too small."
            )
        return mesh, f" on {layers} layer{'s' * (layers > 1)} at {places}" * bool(nodes.size), remark
