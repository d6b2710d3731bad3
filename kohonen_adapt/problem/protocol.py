"""What the loop asks of a problem, and the answers checked."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Mask
from kohonen_adapt.checks import as_reals, checked_points
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.names import nodes_of_points
from kohonen_adapt.mesh.polynomials import count_unknowns
from kohonen_adapt.problem.ritz import VECTORS, Ritz

__all__ = [
    "NotOffered",
    "Problem",
    "check_names",
    "check_problem",
    "curves_of",
    "energy_norm",
    "estimate",
    "goal_error_of",
    "goal_of",
    "goal_unit_of",
    "improved",
    "is_calibrated",
    "is_curved",
    "nodes_held",
    "norm_of",
    "offered",
    "offers",
    "order_of",
    "pairs_of",
    "ritz_of",
    "solve",
    "solve_again",
]


ATTRIBUTES = {
    "order": "the degree of its elements, 1 to 4",
    "norm": "'energy' or 'L2'",
    "calibrated": "True or False",
    "curved": "True, False or None",
    "pairs": "a sequence of pairs of names of boundaries",
    "points": "a mapping of names to places of shape (2, n)",
}
METHODS = {
    "solve_from": "mesh, old_mesh, old_solution",
    "energy_norm": "mesh, solution",
    "ritz": "mesh, solution",
    "curves": "mesh",
    "improved": "mesh, solution, outputs",
}

SAME = 1e-4  # of the largest indicator: what a nonlinear solution may owe to where it was started from


class NotOffered(Exception):
    """An optional method of a problem has nothing to give: `ritz`, `energy_norm` and others raise this.

    Parameters
    ----------
    reason
        Why, as the end of a sentence: "its elements are of order 2".

    Examples
    --------
    >>> import kohonen_adapt as ka
    >>> class Curl:
    ...     def ritz(self, mesh, solution):
    ...         raise ka.NotOffered("its functional has no minimum")
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)


class Problem(Protocol):
    """Anything with these two methods can be adapted.

    It may offer more, each used where present: ``order`` (degree of the elements, 1), ``norm`` (in which the error is
    to be small: "energy" or "L2"), ``solve_from(mesh, old_mesh, old_solution)`` (a warm start, called in place of
    ``solve`` on every mesh but the first), ``energy_norm(mesh, solution) -> float`` and
    ``ritz(mesh, solution) -> kohonen_adapt.Ritz``, the functional that the solution minimises; ``pairs``, its periodic
    and antiperiodic boundaries as pairs, as ``Rules.periodic`` has them; ``points``, names to places (2, n) where the
    mesh has nodes that must stay; ``curves(mesh)``, curves of boundaries by name that it knows of, for
    ``Rules.curves``. A method that a class has for some of its problems only raises `NotOffered` for the others, with
    the reason.

    ``curved`` says whether the problem is solved on elements with bent sides: True asks for a ``skfem.MeshTri2`` where
    an outline is curved, with mid-side nodes on the curve (`MeshTri` where none is), False for a ``skfem.MeshTri``.
    Without it the problem gets what `adapt` was given; of order 1 a ``skfem.MeshTri`` in any case where it says one.

    ``improved(mesh, solution, outputs)`` has better values of these functions of a solution, by name: from elements of
    a higher degree on the same mesh, for instance. Where a run has stalled, it is asked once, and `message` says which
    outputs are worse than the input's.

    ``goal(solution) -> float`` and ``goal_error(solution) -> float`` together say that the indicators are those of a
    goal, so that the sum of their squares is an error of the goal in its unit, ``goal_unit`` (""). Tables, files and
    reports show value, estimated error and their sum; ``goal_error`` is called once, for the result.

    ``calibrated`` (False) says that the root of the sum of the squared indicators is near the error itself, say within
    30 %, on adapted meshes, too, whose elements are stretched. Then tables, pictures and reports show it as a share of
    ``energy_norm`` and call it "Energy-norm error %"; otherwise "indicator", because its size is not known.
    `kohonen_adapt.estimators.recovery` (0.9 to 1.1 times the error of a linear problem) and ``equilibrated``
    (1.04 to 1.3 times, a bound) are such estimates as they are. ``residual`` is 3 to 4 times the error on good elements
    and up to 7 on stretched ones, so no factor makes it one. To vouch for another, solve a problem whose solution is
    known, adapt, and compare, as `python -m benchmarks effectivity` does.
    """

    def solve(self, mesh: Mesh) -> Any:
        """Solve on the mesh; the solution may be of any type."""

    def indicators(self, mesh: Mesh, solution: Any) -> ArrayLike:
        """Error indicators of the energy norm, unsquared, (nelements,)."""


def order_of(problem: Problem) -> int:
    """Degree of the problem's elements, 1 where it does not say."""
    return getattr(problem, "order", 1)


def norm_of(problem: Problem) -> str:
    """Norm in which the problem wants the error to be small, "energy" where it does not say."""
    return getattr(problem, "norm", "energy")


def has_functional(problem: Problem) -> bool:
    """Whether there is something for the polish to lower, as far as can be told before it is solved."""
    return norm_of(problem) == "energy" and offers(problem, "ritz")


def is_calibrated(problem: Problem) -> bool:
    """Whether the problem vouches for the scale of its indicators, False where it does not say."""
    return getattr(problem, "calibrated", False)


def is_curved(problem: Problem) -> bool | None:
    """Whether the problem wants bent sides on curved outlines, not with elements of order 1; None where it does not
    say.
    """
    wanted = getattr(problem, "curved", None)
    return wanted and order_of(problem) > 1 if isinstance(wanted, bool) else wanted


def improved(problem: Problem, mesh: Mesh, solution: Any, outputs: Mapping[str, Any]) -> dict[str, float]:
    """Better values of functions of the solution that `solve` returned for the mesh, by name.

    Raises
    ------
    NotOffered
        If the problem has none.
    """
    return offered(problem, "improved")(mesh, solution, outputs)


def goal_of(problem: Problem, solution: Any) -> float | None:
    """Return the value of the problem's goal, None for a problem without a goal and its error."""
    if not (offers(problem, "goal") and offers(problem, "goal_error")):
        return None
    return float(problem.goal(solution))  # type: ignore[attr-defined]


def goal_error_of(problem: Problem, solution: Any) -> float:
    """Return the estimated error of the goal with its sign, for a problem that has one."""
    return float(problem.goal_error(solution))  # type: ignore[attr-defined]


def goal_unit_of(problem: Problem) -> str:
    """Return the unit of the problem's goal, empty for a problem that states none."""
    return str(getattr(problem, "goal_unit", ""))


def pairs_of(problem: Problem) -> Sequence[Pair]:
    """Pairs of boundaries on which the problem's solution is periodic or antiperiodic, none where it does not say."""
    return getattr(problem, "pairs", None) or ()


def nodes_held(problem: Problem, mesh: Mesh) -> list[int]:
    """Nodes of the mesh that must stay where they are, those at the problem's points.

    Raises
    ------
    ValueError
        If the points are no mapping of names to places, or the mesh has no node at one of them.
    """
    points = getattr(problem, "points", None) or {}
    if not isinstance(points, Mapping):
        raise ValueError(f"points of the problem must be {ATTRIBUTES['points']}; got {points!r}.")
    places = {name: checked_points(x, f"points[{name!r}] of the problem", mesh.dim()) for name, x in points.items()}
    return [int(node) for rows in nodes_of_points(mesh, places).values() for node in rows]


def check_names(problem: Problem) -> None:
    """Refuse a problem that has something else under a name of the protocol.

    Raises
    ------
    ValueError
        If an attribute is a method, or a method none, or if ``order``, ``norm``, ``calibrated`` or ``curved`` is
        unknown.
    """
    kind = type(problem).__name__
    for name, wanted in ATTRIBUTES.items():
        if callable(getattr(problem, name, None)):
            raise ValueError(
                f"{name} of the problem must be {wanted}; {kind} has a method of that name. Rename it if it is there "
                "for something else; otherwise make it a property."
            )
    for name, arguments in METHODS.items():
        value = getattr(problem, name, None)
        if value is not None and not callable(value):
            raise ValueError(
                f"{name} of the problem must be a method {name}({arguments}); {kind} has a {type(value).__name__} of "
                "that name. Rename it if it is there for something else."
            )
    if not isinstance(pairs_of(problem), tuple | list):
        raise ValueError(f"pairs of the problem must be {ATTRIBUTES['pairs']}; got {pairs_of(problem)!r}.")
    if norm_of(problem) not in ("energy", "L2"):
        raise ValueError(f"norm of the problem must be 'energy' or 'L2'; got {norm_of(problem)!r}.")
    if not isinstance(is_calibrated(problem), bool):
        raise ValueError(f"calibrated of the problem must be True or False; got {is_calibrated(problem)!r}.")
    if not isinstance(is_curved(problem), bool | None):
        raise ValueError(f"curved of the problem must be True, False or None; got {is_curved(problem)!r}.")
    if isinstance(order_of(problem), bool) or order_of(problem) not in (1, 2, 3, 4):
        raise ValueError(f"order of the problem must be the degree of its elements, 1 to 4; got {order_of(problem)!r}.")


def check_problem(problem: Problem, rtol: float | None) -> None:
    """Refuse a problem that the loop cannot use, before anything is solved.

    Raises
    ------
    ValueError
        If a method is missing (``energy_norm`` too, where there is an `rtol`), or as `check_names` says.
    """
    kind = type(problem).__name__
    missing = [name for name in ("solve", "indicators") if not offers(problem, name)]
    if missing:
        raise ValueError(
            f"problem must have the methods solve(mesh) and indicators(mesh, solution); "
            f"{kind} has no {' and no '.join(missing)}."
        )
    check_names(problem)
    if rtol is not None:
        try:
            offered(problem, "energy_norm")
        except NotOffered as reason:
            raise without_norm(reason) from None


def solve(problem: Problem, mesh: Mesh, old_mesh: Mesh | None = None, old_solution: Any = None) -> Any:
    """Solve, from the old solution where there is one and the problem offers ``solve_from``."""
    if old_mesh is not None and offers(problem, "solve_from"):
        return problem.solve_from(mesh, old_mesh, old_solution)  # type: ignore[attr-defined]
    return problem.solve(mesh)


def estimate(problem: Problem, mesh: Mesh, solution: Any) -> Floats:
    """The problem's indicators (nelements,), as a copy: a problem may write the next ones into the same array.

    Raises
    ------
    ValueError
        If they have another shape, or are not finite numbers >= 0.
    """
    values = as_reals("indicators of the problem", problem.indicators(mesh, solution), {"nelements": mesh.t.shape[1]})
    _check_values(values, np.isfinite(values), "finite; check the solution")
    _check_values(values, values >= 0.0, ">= 0; take their absolute values")
    largest = np.finfo(float).max / np.sqrt(len(values))
    _check_values(values, values <= largest, "small enough for the sum of their squares; check units")
    return values


def solve_again(problem: Problem, mesh: Mesh, indicators: Floats) -> Any:
    """Solve a mesh that was solved before, in another process.

    Raises
    ------
    ValueError
        If its indicators (nelements,) are no longer those of before, so that it is another problem.
    """
    solution = problem.solve(mesh)
    off = float(np.abs(estimate(problem, mesh, solution) - indicators).max())
    if off > SAME * indicators.max():
        raise ValueError(
            f"the problem is not the one of the checkpoint: on the same mesh its indicators differ by up to {off:.3g}. "
            "Go on with the problem of before, or choose another folder."
        )
    return solution


def energy_norm(problem: Problem, mesh: Mesh, solution: Any, rtol: float | None = None) -> float | None:
    """The problem's energy norm of the solution, or None where it offers none.

    Raises
    ------
    ValueError
        If it is not a finite number >= 0, or there is none though there is an `rtol`.
    """
    try:
        value = float(offered(problem, "energy_norm")(mesh, solution))
    except NotOffered as reason:
        if rtol is not None:
            raise without_norm(reason) from None
        return None
    if not 0.0 <= value < np.inf:
        raise ValueError(f"energy_norm of the problem must be a finite number >= 0; got {value}.")
    return value


def without_norm(reason: object) -> ValueError:
    """The error of an `rtol` for a problem that has no energy norm, for this reason."""
    return ValueError(f"rtol needs the energy norm of the problem, but {reason}: use atol instead.")


def ritz_of(problem: Problem, mesh: Mesh, solution: Any) -> Ritz:
    """The problem's functional with the solution that `solve` returned for the mesh.

    Raises
    ------
    NotOffered
        If it has none, or one of another order than its own.
    ValueError
        If it is no `Ritz`.
    """
    try:
        method = offered(problem, "ritz")
    except NotOffered as reason:
        if has_several_per_node(mesh, solution):
            raise NotOffered(f"{reason}, and {VECTORS}") from None
        raise
    ritz = method(mesh, solution)
    if not isinstance(ritz, Ritz):
        raise ValueError(f"ritz of the problem must return a kohonen_adapt.Ritz; got {type(ritz).__name__}.")
    if ritz.order != order_of(problem):
        raise NotOffered(f"the Ritz of the problem is of order {ritz.order}, its elements of order {order_of(problem)}")
    return ritz


def has_several_per_node(mesh: Mesh, solution: Any) -> bool:
    """Return True if a solution is an array of more unknowns than one per node, and of no scalar elements."""
    size = np.size(solution) if isinstance(solution, np.ndarray) else 0
    return size >= 2 * mesh.nvertices and size not in {count_unknowns(mesh, order) for order in (1, 2, 3, 4)}


def curves_of(problem: Problem, mesh: Mesh, given: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """The curves given for boundaries, and those that the problem itself knows of, its ``curves(mesh)``."""
    tell = getattr(problem, "curves", None)
    if not callable(tell) or not (given is None or isinstance(given, Mapping)):
        return given
    told = tell(mesh)
    if not isinstance(told, Mapping | None):
        raise ValueError(f"curves of the problem must return a mapping of boundaries to curves, or None; got {told!r}.")
    return {**told, **(given or {})} if told else given


def offers(problem: Problem, name: str) -> bool:
    """Whether a problem has a method of that name."""
    return callable(getattr(problem, name, None))


def offered(problem: Problem, name: str) -> Callable[..., Any]:
    """The method of that name, called with a mesh and its solution.

    Raises
    ------
    NotOffered
        If the problem has none; for the reason that its AttributeError gives, where its class has one.
    """
    reason = f"{type(problem).__name__} has no method {name}(mesh, solution)"
    try:
        method = getattr(problem, name)
    except AttributeError as error:
        raise NotOffered(str(error) if hasattr(type(problem), name) else reason) from None
    if not callable(method):
        raise NotOffered(reason)
    return method


def _check_values(values: Floats, good: Mask, wanted: str) -> None:
    if not good.all():
        first = int(np.argmin(good))
        raise ValueError(
            f"indicators of the problem must be {wanted}: got {values[first]} at element {first}, "
            f"{np.sum(~good)} such in all."
        )
