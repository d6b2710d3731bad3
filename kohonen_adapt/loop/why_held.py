"""Reasons for which nodes stay where they are."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from kohonen_adapt.geometry.rules import Rules, check_for
from kohonen_adapt.loop.dimension import method_of
from kohonen_adapt.loop.step import functional_of
from kohonen_adapt.mesh.cells import check_kind
from kohonen_adapt.problem.evaluation import curves_of, solve
from kohonen_adapt.problem.protocol import Problem, check_names, has_method, is_curved, nodes_of_problem, pairs_of

__all__ = ["why_held"]


def why_held(mesh: Mesh, problem: Problem | Rules | None = None) -> NDArray[np.str_]:
    """Return why each node of a mesh is held.

    Parameters
    ----------
    mesh
        A mesh of triangles with straight or curved sides, or of tetrahedra.
    problem
        A problem as for `adapt`, which is solved once on the mesh, or `Rules`. None stands for ``Rules()``.

    Returns
    -------
    ndarray (nnodes,) of str
        The reason in words: a corner or junction with the names of boundaries or subdomains and the turn, a turn at
        which no curve is recognised, ``pinned``, ``point of the problem``, or a periodic pair. Reasons that hold a node
        in the polish only begin with ``polish:``. An empty string stands for a node that moves or slides. The quality,
        the reach of a move and the schedule depend on the pass and are not included.

    Raises
    ------
    ValueError
        If the mesh or a rule is invalid.
    TypeError
        If `problem` is neither a problem nor `Rules`.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2).with_boundaries({"rim": lambda x: x[0] < 2.0})
    >>> why = ka.why_held(mesh, ka.Rules(pinned=[12]))
    >>> str(why[0]), str(why[12]), int((why == "").sum())
    ("corner of boundary 'rim', 90 degrees", 'pinned', 20)
    """
    check_kind(mesh, curved=True, space=True)
    if problem is None or isinstance(problem, Rules):
        return np.array(method_of(mesh).reasons(opened(mesh, problem or Rules(), None)), dtype=np.str_)
    if not has_method(problem, "solve"):
        raise TypeError(f"why_held requires a problem with the method solve(mesh), or Rules; got {problem!r}.")
    check_names(problem)
    points = nodes_of_problem(problem, mesh)
    rules = Rules(pinned=points, curves=curves_of(problem, mesh, None), periodic=pairs_of(problem))
    movable = opened(mesh, rules, is_curved(problem))
    reasons = method_of(mesh).reasons(movable)
    for node in points:
        reasons[node] = "point of the problem"
    polish = polish_reasons(mesh, movable, problem)
    both = [why or (f"polish: {other}" if other else "") for why, other in zip(reasons, polish, strict=True)]
    return np.array(both, dtype=np.str_)


def opened(mesh: Mesh, rules: Rules, curved: bool | None) -> Any:
    method = method_of(mesh)
    check_for(rules, method.dim)
    return method.open(mesh, rules.guarded(), curved)


def polish_reasons(mesh: Mesh, movable: Any, problem: Problem) -> list[str]:
    method, start = method_of(mesh), movable.start()
    functional, _, reason = functional_of(problem, method, movable, start, solve(problem, start))
    return [reason] * movable.nnodes if functional is None else method.polish_reasons(movable, functional)
