"""Sentences on the coils and the plan of a run before the first solve."""

from collections.abc import Iterator, Mapping

import numpy as np
from skfem import Mesh

from kohonen_adapt.cases.case import Case
from kohonen_adapt.checks import point_text
from kohonen_adapt.loop.growth import MAX_NODES
from kohonen_adapt.loop.settings import percent
from kohonen_adapt.magnetostatics.problem import Magnetostatics
from kohonen_adapt.problem.protocol import at_order_of_passes, final_orders, order_of

__all__ = ["allowed_errors", "coil_sentences", "plan_sentence"]


def plan_sentence(case: Case, mesh: Mesh) -> str:
    if case.most_passes == 0:
        return f"Plan: solve and estimate {mesh.nvertices} nodes without a pass."
    allowed, count = allowed_errors(case), case.most_passes
    until = f", until {allowed}," if allowed else " without a tolerance (rtol),"
    return f"Plan: at most {count} pass{'es' * (count != 1)}{until} with {_nodes(case, mesh)} of {_orders(case)}."


def coil_sentences(case: Case) -> Iterator[str]:
    problem = case.problem
    for name, coil in () if isinstance(problem, Magnetostatics) else (problem.coils or {}).items():
        low, high = coil.winding.edges.min(axis=(0, 2)), coil.winding.edges.max(axis=(0, 2))
        density = abs(coil.ampere_turns) / (coil.width * coil.height)
        yield (
            f"Coil '{name}': {coil.ampere_turns:g} A around {point_text(np.round(coil.axis, 6) + 0.0)}, from "
            f"{point_text(low)} to {point_text(high)} m, section {coil.width:g} x {coil.height:g} m, "
            f"{density:.4g} A/m^2."
        )


def allowed_errors(case: Case) -> str:
    given, texts = case.adapt, list[str]()
    relative, absolute = given.get("rtol"), given.get("atol")
    of_estimate = [] if relative is None else [f"{percent(relative)} of the energy norm"]
    if absolute is not None and case.goal is not None:
        of_estimate.append(f"{absolute**2:.4g} {case.problem.goal_unit}")
    elif absolute:
        of_estimate.append(f"{absolute:.4g} sqrt({case.energy_unit})")
    if of_estimate:
        texts.append(f"the estimated error is at most {' plus '.join(of_estimate)}")
    if "goal_rtol" in given:
        texts.append(f"that of the goal is at most {percent(given['goal_rtol'])}")
    of_outputs = given.get("output_rtol", {})
    if isinstance(of_outputs, Mapping):
        texts += [f"that of '{name}' is at most {percent(tolerance)}" for name, tolerance in of_outputs.items()]
    else:
        texts.append(f"that of every output is at most {percent(of_outputs)}")
    return " and ".join(texts).replace("that of", "the estimated error of", not of_estimate)


def _nodes(case: Case, mesh: Mesh) -> str:
    start = mesh.nvertices
    if case.follows_tolerance:
        return f"at most {case.adapt.get('max_nodes', MAX_NODES)} nodes"
    target = case.adapt.get("target_nodes", start)
    return f"{start} nodes" if target == start else f"{start} to {target} nodes"


def _orders(case: Case) -> str:
    problem, last = case.problem, final_orders(case.problem, case.follows_tolerance)
    order = order_of(at_order_of_passes(problem) if last else problem)
    if not last:
        return f"order {order}"
    return f"order {order}, then one solve of order {last[-1]}" if len(last) == 1 else f"orders {order} to {last[-1]}"
