"""A problem with elements of several orders, at one of them."""

from functools import partial
from inspect import signature
from typing import Any

from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.problem.protocol import Problem, order_of, orders_of

__all__ = ["HIGHEST_POLISHED", "AtOrder", "AutoOrder", "at_order_of_passes", "final_orders"]

OF_PASSES = 2  # order of the passes before a higher order; the polish of order 2 takes the least time to an error
HIGHEST_POLISHED = 3


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


def final_orders(problem: Problem, has_tolerance: bool) -> range:
    if orders_of(problem) is None or "order" not in signature(problem.solve).parameters:  # overridden by a subclass
        return range(0)
    highest, order = (orders_of(problem) or (1, 1))[1], order_of(problem)
    if isinstance(order, AutoOrder) and order >= OF_PASSES:
        return range(HIGHEST_POLISHED + 1, highest + 1) if has_tolerance else range(0)
    return range(order, order + 1) if order > HIGHEST_POLISHED else range(0)


def at_order_of_passes(problem: Problem) -> Problem:
    return AtOrder(problem, OF_PASSES) if final_orders(problem, has_tolerance=True) else problem
