"""Interface of a problem, and the optional attributes and methods of a problem."""

from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any, Protocol

from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Ints
from kohonen_adapt.checks import checked_points, is_count
from kohonen_adapt.mesh.names import nodes_of_points

__all__ = [
    "HIGHEST_POLISHED",
    "AutoOrder",
    "CheckedProblem",
    "NotOffered",
    "Problem",
    "check_names",
    "checked_problem",
    "missing_norm_error",
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
    "singular_edges": "mesh, solution",
    "singular_nodes": "mesh, solution",
    "corner_exponents": "mesh",
    "aimed_at": "output",
    "metric": "mesh, solution",
}

DEFAULTS: dict[str, Any] = {
    "orders": None,
    "norm": "energy",
    "calibrated": False,
    "curved": None,
    "pairs": (),
    "points": {},
    "goal_unit": "",
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
    ``singular_edges(mesh, solution)``            in space, edges (2, k) and corners (n,) that get layers; default: from
                                                  ``ritz``
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


class AutoOrder(int):
    """Order that follows the tolerance of `adapt`, or else its value."""

    def __repr__(self) -> str:
        return "'auto'"

    def __str__(self) -> str:
        return int.__repr__(self)


class CheckedProblem:
    """Problem with the defaults of optional attributes, also at one of its orders.

    Names that are not here are those of the problem.
    """

    def __init__(self, problem: Any, order: int | None = None) -> None:
        if isinstance(problem, CheckedProblem):
            problem, order = problem.given, problem.chosen_order if order is None else order
        self.given: Any = problem
        self.chosen_order = order
        self.name = type(problem).__name__

    def __getattr__(self, name: str) -> Any:
        default = DEFAULTS.get(name)
        value = getattr(self.given, name, default) if name in DEFAULTS else getattr(self.given, name)
        return default if value is None else value

    @property
    def order(self) -> int:
        return getattr(self.given, "order", 1) if self.chosen_order is None else self.chosen_order

    @property
    def is_curved(self) -> bool | None:
        return self.curved and self.order > 1 if isinstance(self.curved, bool) else self.curved

    @property
    def has_goal(self) -> bool:
        return self.has("goal") and self.has("goal_error")

    @property
    def has_functional(self) -> bool:
        return self.norm == "energy" and self.has("ritz")

    def has(self, name: str) -> bool:
        return callable(getattr(self.given, name, None))

    def optional(self, name: str) -> Callable[..., Any]:
        reason = f"{self.name} has no method {name}(mesh, solution)"
        try:
            method = getattr(self.given, name)
        except AttributeError as error:
            raise NotOffered(str(error) if hasattr(type(self.given), name) else reason) from None
        if not callable(method):
            raise NotOffered(reason)
        return method

    def solve(self, mesh: Mesh, old_mesh: Mesh | None = None, old_solution: Any = None) -> Any:
        chosen = {} if self.chosen_order is None else {"order": self.chosen_order}
        if old_mesh is not None and self.has("solve_from"):
            return self.given.solve_from(mesh, old_mesh, old_solution, **chosen)
        return self.given.solve(mesh, **chosen)

    def points_on(self, mesh: Mesh) -> dict[str, Ints]:
        if not isinstance(self.points, Mapping):
            raise ValueError(f"points of the problem must be {ATTRIBUTES['points']}; got {self.points!r}.")
        positions = {
            name: checked_points(x, f"points[{name!r}] of the problem", mesh.dim()) for name, x in self.points.items()
        }
        return nodes_of_points(mesh, positions)

    def nodes_on(self, mesh: Mesh) -> list[int]:
        return [int(node) for rows in self.points_on(mesh).values() for node in rows]

    @property
    def takes_order(self) -> bool:
        takes = self.chosen_order is None and self.orders is not None
        return takes and "order" in signature(self.given.solve).parameters  # or overridden

    def final_orders(self, has_tolerance: bool) -> range:
        if not self.takes_order:
            return range(0)
        highest, order = self.orders[1], self.order
        if isinstance(order, AutoOrder) and order >= OF_PASSES:
            return range(HIGHEST_POLISHED + 1, highest + 1) if has_tolerance else range(0)
        return range(order, order + 1) if order > HIGHEST_POLISHED else range(0)

    @property
    def at_grading_order(self) -> "CheckedProblem":
        return CheckedProblem(self, OF_PASSES) if self.final_orders(has_tolerance=True) else self


def are_orders(value: object) -> bool:
    pair = value is None or (isinstance(value, tuple | list) and len(value) == 2 and all(map(is_count, value)))
    return pair and (value is None or 1 <= value[0] <= value[1])  # type: ignore[index]


def check_names(problem: CheckedProblem) -> None:
    kind = problem.name
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
    lowest, highest = (problem.orders if are_orders(problem.orders) else None) or (1, 4)
    valid = {
        "pairs": isinstance(problem.pairs, tuple | list),
        "norm": problem.norm in ("energy", "L2"),
        "calibrated": isinstance(problem.calibrated, bool),
        "curved": isinstance(problem.curved, bool | None),
        "orders": are_orders(problem.orders),
        "order": is_count(problem.order) and lowest <= problem.order <= highest,
    }
    for name, is_valid in valid.items():
        if not is_valid:
            raise ValueError(f"{name} of the problem must be {ATTRIBUTES[name]}; got {getattr(problem, name)!r}.")


def checked_problem(given: Problem, rtol: float | None) -> CheckedProblem:
    if isinstance(given, type):
        raise ValueError(f"problem must be an object, {given.__name__}(...); got the class {given.__name__}.")
    problem = CheckedProblem(given)
    missing = [name for name in ("solve", "indicators") if not problem.has(name)]
    if missing:
        raise ValueError(
            f"problem must have the methods solve(mesh) and indicators(mesh, solution); "
            f"{problem.name} has no {' and no '.join(missing)}."
        )
    check_names(problem)
    if rtol is not None:
        try:
            problem.optional("energy_norm")
        except NotOffered as reason:
            raise missing_norm_error(reason) from None
    return problem


def missing_norm_error(reason: object) -> ValueError:
    return ValueError(f"rtol requires the energy norm of the problem, but {reason}. Use atol instead.")
