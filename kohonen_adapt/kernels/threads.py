"""Share work among threads, so that no result depends on their number.

The kernels release Python's global lock, so plain threads run them side by side.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.kernels.compilation import number_of_threads

__all__ = ["Nodes", "even_cuts", "number_of_threads", "shared", "shared_in_parts"]

Nodes = NDArray[np.int32]
Result = TypeVar("Result")

NODES = 50_000  # per compiled call: Python hears Ctrl-C at least every half second

_pools: dict[int, ThreadPoolExecutor] = {}  # idle threads, the one thing that calls share; no result depends on them
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pools.clear)  # a fork does not take threads with it


def even_cuts(count: int, least: int, multiple: int = 1) -> list[int]:
    """Where to cut `count` things for the threads: evenly, at multiples, but into pieces of at least `least`."""
    pieces = max(1, min(number_of_threads(), count // least))
    inner = np.arange(1, pieces) * count // pieces // multiple * multiple
    return [0, *inner.tolist(), count]


def shared(task: Callable[[int, int, int], Result], cuts: Sequence[int]) -> list[Result]:
    """Call ``task(thread, cuts[i], cuts[i + 1])`` for every i, each in a thread of its own; the results in order.

    The task must not care where the cuts are. Ctrl-C and exceptions come through when all threads are done.
    """
    spans = [(i, int(cuts[i]), int(cuts[i + 1])) for i in range(len(cuts) - 1)]
    if len(spans) == 1:
        return [task(*spans[0])]
    pool = _pools.setdefault(len(spans), ThreadPoolExecutor(len(spans) - 1))
    others = [pool.submit(task, *span) for span in spans[1:]]
    try:
        first = task(*spans[0])
    finally:
        results = [other.result() for other in others]
    return [first, *results]


def shared_in_parts(task: Callable[[int, Nodes], float], order: Nodes, part: Nodes, deep: NDArray[np.bool_]) -> float:
    """Call ``task(thread, nodes)`` for nodes in their order, part by part, and add up what it returns.

    Threads take parts side by side; the nodes that are not `deep` in their part, so that they have neighbours in
    another one, come last. What a task does to a node must depend on the neighbours alone: then nothing depends on the
    number of threads. The parts are stretches of the order.
    """
    alone = deep[order]
    inside, across = order[alone], order[~alone]
    parts = int(part[order[-1]]) + 1
    cuts = np.searchsorted(part[inside], np.arange(parts + 1))
    gains = np.zeros(parts + 1)

    def several(thread: int, first: int, last: int) -> None:
        for i in range(first, last):
            gains[i] = task(thread, inside[cuts[i] : cuts[i + 1]])

    shared(several, even_cuts(parts, 1))
    for first in range(0, len(across), NODES):
        gains[parts] += task(0, across[first : first + NODES])
    return float(gains.sum())
