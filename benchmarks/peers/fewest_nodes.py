"""Search for the fewest nodes with which a method comes to an error."""

from collections.abc import Callable
from typing import Protocol, TypeVar

__all__ = ["fewest"]

MARGIN = 1.02  # a mesh may be better than wanted by this factor before fewer nodes are tried
TRIALS = 6


class Reached(Protocol):
    """What a run came to."""

    @property
    def nodes(self) -> int:
        """N."""

    @property
    def error(self) -> float:
        """Of its last mesh."""


Run = TypeVar("Run", bound=Reached)


def fewest(run: Callable[[int], Run], goal: float, guess: int, least: int, most: float, order: int) -> Run | None:
    """The run with the fewest nodes, from `least` to `most`, whose error is small enough, None if none is.

    `run` takes the wanted number of nodes; the next is found from the error being N^(-order / 2).
    """
    nodes, best = max(guess, least), None
    for _ in range(TRIALS):
        reached = run(nodes)
        if reached.error <= goal and (best is None or reached.nodes < best.nodes):
            best = reached
        if reached.error <= goal and (nodes == least or reached.error >= goal / MARGIN):
            break
        nodes = max(least, round(nodes * (reached.error / goal * MARGIN**0.5) ** (2.0 / order)))
        if nodes > most:
            break
    return best
