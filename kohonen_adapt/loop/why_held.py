"""Reasons for which nodes stay where they are."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from kohonen_adapt.geometry.held_nodes import with_pins
from kohonen_adapt.geometry.plane.surgery import with_thin_layers
from kohonen_adapt.geometry.rules import Rules, check_for, with_pinned
from kohonen_adapt.loop.dimension import method_of
from kohonen_adapt.loop.functional_of_pass import functional_of
from kohonen_adapt.mesh.cells import check_kind
from kohonen_adapt.problem.evaluation import curves_of
from kohonen_adapt.problem.protocol import CheckedProblem, Problem, check_names


def why_held(mesh: Mesh, problem: Problem | Rules | None = None, rules: Rules | None = None) -> NDArray[np.str_]:
    """Return why each node of a mesh is held.

    Layers hold no node, because they refuse flips, collapses and splits only. The quality, the reach of a move and the
    schedule depend on the pass: `Pass` counts the moves that they refused.

    Parameters
    ----------
    mesh
        A mesh of triangles with straight or curved sides, or of tetrahedra.
    problem
        A problem as for `adapt`, which is solved once on the mesh. None stands for no problem. `Rules` are accepted
        here, too.
    rules
        Rules beside those of the problem. As in `adapt`, curves of a boundary replace those of the problem, pinned
        nodes are added to its points, and pairs, if any, replace its pairs. None stands for ``Rules()``.

    Returns
    -------
    ndarray (nnodes,) of str
        The reason in words: a pin with the boundary or subdomain that pins the node, a point of the problem, a corner
        or junction with the names of boundaries or subdomains and the turn, a turn at which no curve is recognised, or
        a periodic pair. Reasons that hold a node in the polish only begin with ``polish:``, for example Dirichlet
        values that are not linear, or an open boundary. An empty string stands for a node that moves or slides.

    Raises
    ------
    ValueError
        If the mesh or a rule is invalid.
    TypeError
        If `problem` is neither a problem nor `Rules`, or if `rules` are no `Rules` or given twice.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2).with_boundaries({"rim": lambda x: x[0] < 2.0})
    >>> why = ka.why_held(mesh, rules=ka.Rules(pinned=[12]))
    >>> str(why[0]), str(why[12]), int((why == "").sum())
    ("corner of boundary 'rim', 90 degrees", 'pinned by number', 20)
    """
    check_kind(mesh, curved=True, space=True)
    if isinstance(problem, Rules):
        if rules is not None:
            raise TypeError("why_held requires Rules once, as problem or as rules; got both.")
        problem, rules = None, problem
    rules = Rules() if rules is None else rules
    if not isinstance(rules, Rules):
        raise TypeError(f"rules of why_held must be kohonen_adapt.Rules; got {rules!r}.")
    if problem is None:
        return reasons_at(mesh, None, rules)
    checked = CheckedProblem(problem)
    if not checked.has("solve"):
        raise TypeError(f"why_held requires a problem with the method solve(mesh), or Rules; got {problem!r}.")
    check_names(checked)
    return reasons_at(mesh, checked, rules)


def reasons_at(mesh: Mesh, problem: CheckedProblem | None, rules: Rules, solution: Any = None) -> NDArray[np.str_]:
    orders = range(0) if problem is None else problem.final_orders(False)
    if problem is not None and orders:  # the solution is not of the order of the passes
        problem, solution = problem.at_grading_order, None
    if problem is not None:
        curves, pairs = curves_of(problem, mesh, rules.curves), rules.periodic or problem.pairs
        rules = replace(rules, curves=curves, periodic=pairs)
    check_for(rules, mesh.dim())
    movable = opened(mesh, rules, problem)
    reasons = method_of(mesh).reasons(movable)
    reasons = with_pins(reasons, mesh, rules.pinned, None if problem is None else problem.points_on(mesh))
    if problem is not None:
        polish = polish_reasons(mesh, movable, problem, solution)
        reasons = [why or (f"polish: {other}" if other else "") for why, other in zip(reasons, polish, strict=False)]
    return np.array(reasons, dtype=np.str_)


def opened(mesh: Mesh, rules: Rules, problem: CheckedProblem | None) -> Any:
    if problem is not None:
        rules = with_pinned(rules, problem.nodes_on(mesh))
    layered = with_thin_layers(mesh, rules)  # nodes of missing layers follow the nodes of the input
    return method_of(mesh).open(layered, rules.guarded(), None if problem is None else problem.is_curved)


def polish_reasons(mesh: Mesh, movable: Any, problem: CheckedProblem, solution: Any) -> list[str]:
    method, start = method_of(mesh), movable.start()
    solution = problem.solve(start) if solution is None else solution
    found = functional_of(problem, method, movable, start, solution)
    if found.functional is None:
        return [found.unpolished] * movable.nnodes
    return method.polish_reasons(movable, found.functional)
