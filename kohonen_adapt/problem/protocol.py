"""Interface of a problem, and the optional attributes and methods of a problem."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from inspect import signature
from typing import Any, Protocol

from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.checks import checked_points, is_count
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.names import nodes_of_points

__all__ = [
    "HIGHEST_POLISHED",
    "AtOrder",
    "AutoOrder",
    "NotOffered",
    "Problem",
    "at_order_of_passes",
    "check_names",
    "check_problem",
    "final_orders",
    "goal_unit_of",
    "has_functional",
    "has_method",
    "is_calibrated",
    "is_curved",
    "missing_norm_error",
    "nodes_of_problem",
    "norm_of",
    "optional_method",
    "order_of",
    "pairs_of",
    "points_of",
    "takes_order",
]

ATTRIBUTES = {
    "orders": "the lowest and the highest degree of its elements, (1, 4) for instance, or None",
    "order": "the degree of its elements, from 1 to 4 or within its orders",
    "norm": "'energy' or 'L2'",
    "calibrated": "True or False",
    "curved": "True, False or None",
    "pairs": "a sequence of pairs of names of boundaries",
    "points": "a mapping of names to positions of shape (2, n)",
}
METHODS = {
    "solve_from": "mesh, old_mesh, old_solution",
    "energy_norm": "mesh, solution",
    "functional": "mesh, solution",
    "ritz": "mesh, solution",
    "curves": "mesh",
    "improved": "mesh, solution, outputs",
    "singular_nodes": "mesh, solution",
    "corner_exponents": "mesh",
    "aimed_at": "output",
    "metric": "mesh, solution",
}

OF_PASSES = 2  # order of the passes before a higher order; the polish of order 2 takes the least time to an error
HIGHEST_POLISHED = 3


class NotOffered(Exception):
    """Exception for an optional method, such as `ritz`, that does not apply.

    Parameters
    ----------
    reason
        Reason, as the end of a sentence: "its elements are of order 2".

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
    """Interface of a problem that can be adapted.

    The methods ``solve`` and ``indicators`` are required. All others are optional:

    ============================================  ====================================================================
    Optional name                                 Meaning
    ============================================  ====================================================================
    ``order = 1``                                 degree of the elements, 1 to 4
    ``orders = None``                             lowest and highest order that ``solve(mesh, order=...)`` takes. With
                                                  an `order` above 3 the passes have order 2, and the result has
                                                  layers at corners, see `refined_at`
    ``norm = "energy"``                           norm of the error to reduce, "energy" or "L2"
    ``calibrated = False``                        True if the estimate is close to the error, see below
    ``curved = None``                             True for curved sides, False for straight sides, see below
    ``pairs = ()``                                periodic and antiperiodic boundaries, see ``Rules.periodic``
    ``points = {}``                               positions (2, n) of nodes that must not move, by name
    ``curves(mesh)``                              curves of boundaries by name, see ``Rules.curves``
    ``solve_from(mesh, old_mesh, old_solution)``  warm start, called instead of ``solve`` except for the first mesh
    ``energy_norm(mesh, solution)``               energy norm of the solution, a float
    ``functional(mesh, solution)``                value of the functional that the solution minimises, a float; for the
                                                  share of curves in errors of orders 2 and 3
    ``ritz(mesh, solution)``                      functional that the solution minimises, a `Ritz`; the polish needs it
    ``singular_nodes(mesh, solution)``            numbers of the nodes that get layers; default: from ``ritz``
    ``corner_exponents(mesh)``                    exponents of the solution by number of the corner, a mapping; messages
                                                  name those below 0.35; default: from ``ritz``
    ``metric(mesh, solution)``                    tensors (nelements, d, d) for the directions of elements, as from
                                                  `metric_from_hessian`; default: from the values of the solution
    ``goal(solution)``                            value of a goal, a float, see below
    ``goal_error(solution)``                      estimated signed error of the goal, a float, see below
    ``goal_unit = ""``                            unit of the goal
    ``improved(mesh, solution, outputs)``         more accurate values of the outputs by name, for example from elements
                                                  of a higher degree
    ``aimed_at(output)``                          problem with an output as goal, or this problem; called if the output
                                                  alone has a tolerance
    ============================================  ====================================================================

    A method that does not apply to all problems of a class raises `NotOffered` with the reason.

    The problem gets a ``skfem.MeshTri`` or ``MeshTet`` if ``curved`` is False, and a ``skfem.MeshTri2`` or ``MeshTet2``
    if ``curved`` is True and a boundary or interface is curved, with midside nodes on the curve or surface. None keeps
    the type of the input mesh. At order 1, True is treated as False.

    ``goal`` and ``goal_error`` together mean that the indicators belong to a goal, and that the sum of their squares is
    an error of the goal in the unit ``goal_unit``. Tables, files and reports show the value, the estimated error and
    the sum of both. ``goal_error`` is called once, for the result.

    ``improved`` is called once if a run has stalled, and the message of the result lists the outputs that are less
    accurate than on the input.

    ``calibrated`` is True if the root of the sum of the squared indicators is close to the error, within about 30 %,
    also on adapted meshes with stretched elements. Tables, pictures and reports then show the estimate as a percentage
    of ``energy_norm``, under the title "Energy-norm error %", and otherwise as "indicator". The estimates of
    `kohonen_adapt.estimators.recovery` (0.9 to 1.1 times the error of a linear problem) and ``equilibrated`` (1.04 to
    1.3 times, an upper bound) are calibrated. ``residual`` is 3 to 4 times the error on good elements and up to 7 times
    on stretched elements, so that no factor makes it calibrated. To check another estimate, adapt a problem with a
    known solution and compare, as `python -m benchmarks effectivity` does.
    """

    def solve(self, mesh: Mesh) -> Any:
        """Return the solution on the mesh, of any type."""

    def indicators(self, mesh: Mesh, solution: Any) -> ArrayLike:
        """Return unsquared error indicators in the energy norm, shape (nelements,)."""


def order_of(problem: Problem) -> int:
    return getattr(problem, "order", 1)


def orders_of(problem: Problem) -> tuple[int, int] | None:
    return getattr(problem, "orders", None)


def are_orders(value: object) -> bool:
    pair = value is None or (isinstance(value, tuple | list) and len(value) == 2 and all(map(is_count, value)))
    return pair and (value is None or 1 <= value[0] <= value[1])  # type: ignore[index]


def norm_of(problem: Problem) -> str:
    return getattr(problem, "norm", "energy")


def has_functional(problem: Problem) -> bool:
    return norm_of(problem) == "energy" and has_method(problem, "ritz")


def is_calibrated(problem: Problem) -> bool:
    return getattr(problem, "calibrated", False)


def is_curved(problem: Problem) -> bool | None:
    wanted = getattr(problem, "curved", None)
    return wanted and order_of(problem) > 1 if isinstance(wanted, bool) else wanted


def goal_unit_of(problem: Problem) -> str:
    return str(getattr(problem, "goal_unit", ""))


def pairs_of(problem: Problem) -> Sequence[Pair]:
    return getattr(problem, "pairs", None) or ()


def points_of(problem: Problem, mesh: Mesh) -> dict[str, Ints]:
    points = getattr(problem, "points", None) or {}
    if not isinstance(points, Mapping):
        raise ValueError(f"points of the problem must be {ATTRIBUTES['points']}; got {points!r}.")
    positions = {name: checked_points(x, f"points[{name!r}] of the problem", mesh.dim()) for name, x in points.items()}
    return nodes_of_points(mesh, positions)


def nodes_of_problem(problem: Problem, mesh: Mesh) -> list[int]:
    return [int(node) for rows in points_of(problem, mesh).values() for node in rows]


def check_names(problem: Problem) -> None:
    kind = type(problem).__name__
    for name, wanted in ATTRIBUTES.items():
        if callable(getattr(problem, name, None)):
            raise ValueError(
                f"{name} of the problem must be {wanted}; {kind} has a method of this name. Make the method a "
                "property, or rename a method with another purpose."
            )
    for name, arguments in METHODS.items():
        value = getattr(problem, name, None)
        if value is not None and not callable(value):
            raise ValueError(
                f"{name} of the problem must be a method {name}({arguments}); {kind} has a {type(value).__name__} of "
                "this name. Rename an attribute with another purpose."
            )
    lowest, highest = (orders_of(problem) if are_orders(orders_of(problem)) else None) or (1, 4)
    valid = {
        "pairs": isinstance(pairs_of(problem), tuple | list),
        "norm": norm_of(problem) in ("energy", "L2"),
        "calibrated": isinstance(is_calibrated(problem), bool),
        "curved": isinstance(is_curved(problem), bool | None),
        "orders": are_orders(orders_of(problem)),
        "order": is_count(order_of(problem)) and lowest <= order_of(problem) <= highest,
    }
    for name, is_valid in valid.items():
        if not is_valid:
            raise ValueError(f"{name} of the problem must be {ATTRIBUTES[name]}; got {getattr(problem, name)!r}.")


def check_problem(problem: Problem, rtol: float | None) -> None:
    kind = type(problem).__name__
    missing = [name for name in ("solve", "indicators") if not has_method(problem, name)]
    if missing:
        raise ValueError(
            f"problem must have the methods solve(mesh) and indicators(mesh, solution); "
            f"{kind} has no {' and no '.join(missing)}."
        )
    check_names(problem)
    if rtol is not None:
        try:
            optional_method(problem, "energy_norm")
        except NotOffered as reason:
            raise missing_norm_error(reason) from None


def missing_norm_error(reason: object) -> ValueError:
    return ValueError(f"rtol requires the energy norm of the problem, but {reason}. Use atol instead.")


def has_method(problem: Problem, name: str) -> bool:
    return callable(getattr(problem, name, None))


def optional_method(problem: Problem, name: str) -> Callable[..., Any]:
    reason = f"{type(problem).__name__} has no method {name}(mesh, solution)"
    try:
        method = getattr(problem, name)
    except AttributeError as error:
        raise NotOffered(str(error) if hasattr(type(problem), name) else reason) from None
    if not callable(method):
        raise NotOffered(reason)
    return method


class AtOrder:
    """Problem solved with elements of one of its orders.

    All names but `order`, `solve` and `solve_from` are those of the problem.
    """

    def __init__(self, problem: Problem, order: int) -> None:
        self._problem, self.order = problem, order

    def solve(self, mesh: Mesh) -> Any:
        return self._problem.solve(mesh, order=self.order)  # type: ignore[call-arg]

    def indicators(self, mesh: Mesh, solution: Any) -> ArrayLike:
        return self._problem.indicators(mesh, solution)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._problem, name)
        return partial(value, order=self.order) if name == "solve_from" else value


class AutoOrder(int):
    """Order that follows the tolerance of `adapt`, or else its value."""


def takes_order(problem: Problem) -> bool:
    return orders_of(problem) is not None and "order" in signature(problem.solve).parameters  # or overridden


def final_orders(problem: Problem, has_tolerance: bool) -> range:
    if not takes_order(problem):
        return range(0)
    highest, order = (orders_of(problem) or (1, 1))[1], order_of(problem)
    if isinstance(order, AutoOrder) and order >= OF_PASSES:
        return range(HIGHEST_POLISHED + 1, highest + 1) if has_tolerance else range(0)
    return range(order, order + 1) if order > HIGHEST_POLISHED else range(0)


def at_order_of_passes(problem: Problem) -> Problem:
    return AtOrder(problem, OF_PASSES) if final_orders(problem, has_tolerance=True) else problem
