"""Heap of edges ordered by a key."""

from typing import NamedTuple

from kohonen_adapt.kernels.numba.array_types import I2, L1, R1
from kohonen_adapt.kernels.numba.compilation import inner_kernel, record, zeros


@record
class Heap(NamedTuple):
    """Edges ordered by key, the smallest first.

    Edges that are changed or removed from the mesh stay in the heap, and are skipped on removal.
    """

    key: R1  # (k,)
    ends: I2  # (k, 2)
    size: L1  # (1,)

    @classmethod
    def of(cls, rows: int) -> "Heap":
        return zeros(cls, rows, (rows, 2), 1)


@inner_kernel
def at(heap, i):
    return heap.key[i], heap.ends[i, 0], heap.ends[i, 1]


@inner_kernel
def put(heap, i, key, a, b):
    heap.key[i], heap.ends[i, 0], heap.ends[i, 1] = key, a, b


@inner_kernel
def insert(heap, key, a, b):
    # A full heap has to be filled again from the mesh.
    i = heap.size[0]
    if i == heap.key.shape[0]:
        return
    heap.size[0] = i + 1
    while i > 0:
        parent = (i - 1) >> 1
        if heap.key[parent] <= key:
            break
        put(heap, i, *at(heap, parent))
        i = parent
    put(heap, i, key, a, b)


@inner_kernel
def remove_first(heap):
    first = at(heap, 0)
    last = heap.size[0] - 1
    heap.size[0] = last
    key, a, b = at(heap, last)
    i = 0
    while True:
        child = 2 * i + 1
        if child >= last:
            break
        if child + 1 < last and heap.key[child + 1] < heap.key[child]:
            child += 1
        if heap.key[child] >= key:
            break
        put(heap, i, *at(heap, child))
        i = child
    put(heap, i, key, a, b)
    return first
