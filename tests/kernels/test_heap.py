"""The heap of edges: the smallest key first, like a slow twin."""

import heapq

import numpy as np

from kohonen_adapt.kernels.heap import Heap, insert, remove_first
from kohonen_adapt.kernels.numba.compilation import interpreted

insert, remove_first = (interpreted(loop) for loop in (insert, remove_first))


def test_the_heap_gives_keys_in_order_like_a_slow_twin():
    rng = np.random.default_rng(0)
    heap, slow = Heap.of(500), []
    for _ in range(2000):
        if slow and (rng.random() < 0.45 or len(slow) == 500):
            key, a, b = remove_first(heap)
            assert (key, a, b) == heapq.heappop(slow)
        else:
            key, a, b = rng.random(), int(rng.integers(100)), int(rng.integers(100))
            insert(heap, key, a, b)
            heapq.heappush(slow, (key, a, b))
    assert heap.size[0] == len(slow)


def test_a_full_heap_takes_no_more():
    heap = Heap.of(2)
    for key in (3.0, 2.0, 1.0):
        insert(heap, key, 0, 1)
    assert heap.size[0] == 2 and remove_first(heap)[0] == 2.0
