"""Distribution of work among threads, with results independent of their number.

Kernels release the global interpreter lock, so threads of Python run them in parallel.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TypeVar

import numpy as np

from kohonen_adapt.arrays import Int32s, Mask
from kohonen_adapt.kernels.numba.compilation import number_of_threads

__all__ = ["LIGHT", "Nodes", "by_turns", "even_cuts", "number_of_threads", "shared", "shared_in_parts"]

Nodes = Int32s
Result = TypeVar("Result")

LIGHT = 15_000  # nodes or elements per thread of a light loop, at least, because starting a thread takes time
LEAST = 1_000  # minimum number of nodes per part, to justify a thread
NODES = 50_000  # per compiled call, so that Ctrl-C takes effect within half a second

_pools: dict[int, ThreadPoolExecutor] = {}  # idle threads by number; no result depends on them
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pools.clear)  # a fork has no threads


def even_cuts(count: int, least: int, multiple: int = 1) -> list[int]:
    """Return the bounds of equal stretches of `count` items for the threads.

    Bounds are multiples of `multiple`, and stretches have at least `least` items.
    """
    pieces = max(1, min(number_of_threads(), count // least))
    return [0, *(i * count // pieces // multiple * multiple for i in range(1, pieces)), count]


def parts_for(nodes: int, rings: int, dim: int, strips: float) -> int:
    """Return the number of parts for a mesh of `nodes` nodes, a power of two.

    A square or cube of n nodes has n^(1/dim) nodes in a row, and p parts need dim (p^(1/dim) - 1) cuts from side to
    side. The number p is the largest for which strips of `rings` on both sides of the cuts have at most `strips` n
    nodes, and for which parts have at least `LEAST` nodes.
    """
    parts = 1
    row = nodes ** (1.0 / dim)
    while 2 * parts * LEAST <= nodes and 2 * dim * rings * ((2 * parts) ** (1.0 / dim) - 1.0) <= strips * row:
        parts *= 2
    return parts


def shared(task: Callable[[int, int, int], Result], cuts: Sequence[int]) -> list[Result]:
    """Call ``task(thread, cuts[i], cuts[i + 1])`` for every i in parallel.

    Return the results in order. The results must not depend on the cuts. Ctrl-C and exceptions are raised after all
    threads have finished.
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
    """Call ``task(thread, i)`` for every i below `count` in the next free thread.

    Return the results in order, which must depend on i alone. Ctrl-C and exceptions prevent further calls, and are
    raised after all threads have finished.
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


def shared_in_parts(task: Callable[[int, Nodes], float], order: Nodes, *ways: tuple[Nodes, Mask]) -> float:
    """Call ``task(thread, nodes)`` for nodes in order by parts, and add the results.

    Each of `ways` is a partition: the part of every node, shape (n,), and the mask of interior nodes, whose neighbours
    are in the same part. For each partition in turn, threads process the interior nodes of the parts in parallel; nodes
    interior to no partition follow at the end. The work on a node must depend on its neighbours alone, so that the
    result does not depend on the number of threads.
    """
    gains = list[float]()
    for part, interior in ways:
        alone = interior[order]
        inside, order = order[alone], order[~alone]
        inside = inside[np.argsort(part[inside], kind="stable")]
        cuts = np.searchsorted(part[inside], np.arange(part.max() + 2)).tolist()
        gains += by_turns(partial(_one_part, task, inside, cuts), len(cuts) - 1)
    gains += [task(0, order[first : first + NODES]) for first in range(0, len(order), NODES)]
    return float(np.sum(gains))


def _one_part(task: Callable[[int, Nodes], float], nodes: Nodes, cuts: Sequence[int], thread: int, i: int) -> float:
    return task(thread, nodes[cuts[i] : cuts[i + 1]])
