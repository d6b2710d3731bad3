"""Share work among threads, so that no result depends on their number.

The kernels release Python's global lock, so plain threads run them side by side.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.kernels.compilation import number_of_threads

__all__ = ["LIGHT", "Nodes", "by_turns", "even_cuts", "number_of_threads", "shared", "shared_in_parts"]

Nodes = NDArray[np.int32]
Result = TypeVar("Result")

LIGHT = 15_000  # nodes or elements of a light loop are not worth another thread: to hand it over takes as long
NODES = 50_000  # per compiled call: Python hears Ctrl-C at least every half second

_pools: dict[int, ThreadPoolExecutor] = {}  # idle threads, the one thing that calls share; no result depends on them
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pools.clear)  # a fork does not take threads with it


def even_cuts(count: int, least: int, multiple: int = 1) -> list[int]:
    """Where to cut `count` things for the threads: evenly, at multiples, but into pieces of at least `least`."""
    pieces = max(1, min(number_of_threads(), count // least))
    return [0, *(i * count // pieces // multiple * multiple for i in range(1, pieces)), count]


def shared(task: Callable[[int, int, int], Result], cuts: Sequence[int]) -> list[Result]:
    """Call ``task(thread, cuts[i], cuts[i + 1])`` for every i, each in a thread of its own; the results in order.

    The task must not care where the cuts are. Ctrl-C and exceptions come through when all threads are done.
    """
    spans = [(i, int(cuts[i]), int(cuts[i + 1])) for i in range(len(cuts) - 1)]
    if len(spans) == 1:
        return [task(*spans[0])]
    pool = _pools.get(len(spans)) or _pools.setdefault(len(spans), ThreadPoolExecutor(len(spans) - 1))
    others = [pool.submit(task, *span) for span in spans[1:]]
    try:
        first = task(*spans[0])
    finally:
        results = [other.result() for other in others]
    return [first, *results]


def by_turns(task: Callable[[int, int], Result], count: int) -> list[Result]:
    """Call ``task(thread, i)`` for every i below `count`, each by the first thread that is free; the results in order.

    What a task gives must depend on i alone. Ctrl-C and exceptions come through when no thread is at work any more, and
    none takes a turn after them.
    """
    turns, results = iter(range(count)), dict[int, Result]()

    def take(thread: int, first: int, last: int) -> None:
        try:
            for i in turns:
                results[i] = task(thread, i)
        except BaseException:
            list(turns)
            raise

    shared(take, range(min(number_of_threads(), max(1, count)) + 1))
    return [results[i] for i in range(count)]


def shared_in_parts(task: Callable[[int, Nodes], float], order: Nodes, *ways: tuple[Nodes, NDArray[np.bool_]]) -> float:
    """Call ``task(thread, nodes)`` for nodes in their order, part by part, and add up what it returns.

    `ways` of cutting nodes into parts are the part of each, (n,), and whether it is deep there, so that all neighbours
    are of its part. Threads take the parts of one way side by side, in each the nodes that are deep; those that are so
    in no way come last. What a task does to a node must depend on the neighbours alone: then nothing depends on the
    number of threads.
    """
    gains = list[float]()
    for part, deep in ways:
        alone = deep[order]
        inside, order = order[alone], order[~alone]
        inside = inside[np.argsort(part[inside], kind="stable")]
        cuts = np.searchsorted(part[inside], np.arange(part.max() + 2)).tolist()
        gains += by_turns(partial(_one_part, task, inside, cuts), len(cuts) - 1)
    gains += [task(0, order[first : first + NODES]) for first in range(0, len(order), NODES)]
    return float(np.sum(gains))


def _one_part(task: Callable[[int, Nodes], float], nodes: Nodes, cuts: Sequence[int], thread: int, i: int) -> float:
    return task(thread, nodes[cuts[i] : cuts[i + 1]])
