"""Share work among threads, so that no result depends on their number.

The kernels release Python's global lock, so plain threads run them side by side.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from kohonen_adapt.kernels.compilation import number_of_threads

__all__ = ["even_cuts", "number_of_threads", "shared"]

Result = TypeVar("Result")

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
