"""A problem with elements of several orders, at one of them."""

from functools import partial
from typing import Any

from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.problem.protocol import Problem, order_of, orders_of

__all__ = ["AtOrder", "at_order_of_passes", "has_final_order"]

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


def has_final_order(problem: Problem) -> bool:
    """Return True if the passes of `adapt` have a lower order than the result."""
    return orders_of(problem) is not None and order_of(problem) > HIGHEST_POLISHED


def at_order_of_passes(problem: Problem) -> Problem:
    return AtOrder(problem, OF_PASSES) if has_final_order(problem) else problem
