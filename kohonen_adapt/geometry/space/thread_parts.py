"""Partition of a tetrahedral mesh into parts that threads change in parallel.

Results do not depend on the number of threads. There are two partitions. Most nodes at the cuts of the first are inside
a part of the second, and few are left for a single thread.

An element belongs to a part if all of its four nodes do. If all elements that surgery removes belong to one part, so do
all elements that surgery creates. Surgery also changes neighbour indices of elements across their faces. The three
nodes of these faces belong to the part, so no other part changes the same index.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kohonen_adapt.arrays import Ints, Mask, padded
from kohonen_adapt.kernels.arrays import Pool
from kohonen_adapt.kernels.ordering import MARGIN, along_curve, mark_interior, parts_along
from kohonen_adapt.kernels.tetrahedron.arrays import ELSEWHERE, FREE, WAITS, WANTED, Cavity, OpenTetrahedra, Queue, Star
from kohonen_adapt.kernels.tetrahedron.geometry import ACROSS, find_parts
from kohonen_adapt.kernels.threads import Nodes, by_turns, number_of_threads, parts_for, shared_in_parts

__all__ = ["Parts", "wait_in"]

MARGINS = MARGIN, 0.4  # margins of two space-filling curves, which halve the mesh at different places
STRIPS = 0.25  # maximum fraction of nodes at the cuts of a partition, which have to wait
FEW = 2_000  # number of queued elements below which threads are not used


@dataclass(frozen=True)
class Parts:
    """Partitions of the nodes of a mesh, computed on first use.

    Partitions are valid until nodes are created or removed.

    Attributes
    ----------
    mesh
        Mesh with spare rows.
    """

    mesh: OpenTetrahedra

    @cached_property
    def order(self) -> Nodes:
        return self._along(MARGINS[0])

    @cached_property
    def partitions(self) -> tuple[Nodes, ...]:
        """Part of every row of nodes, shape (n,), in each of two partitions.

        Rows not in use have part 0. There are no partitions if nodes are too few.
        """
        count = parts_for(len(self.order), 1, 3, STRIPS)
        orders = [self.order, self._along(MARGINS[1])] if count > 1 else []
        return tuple(parts_along(order, len(self.mesh.position), count) for order in orders)

    def _along(self, margin: float) -> Nodes:
        nodes = np.flatnonzero(self.mesh.pool.anchor >= 0).astype(np.int32)
        return nodes[along_curve(self.mesh.position[nodes], margin)]

    def sweep(self, star: Star, task: Callable[[int, Nodes], float]) -> float:
        """Call ``task(thread, nodes)`` for all nodes and return the sum of the results.

        The result for a node may depend on its neighbours only.
        """
        partitions = list[tuple[Nodes, Mask]]()
        for part in self.partitions:
            interior = np.empty(len(part), bool)
            mark_interior(star.start, star.link, part, 1, interior, np.empty_like(part))
            partitions.append((part, interior))
        return shared_in_parts(task, self.order, *partitions)

    def work_off(self, queue: Queue, task: Callable[[OpenTetrahedra, Queue], float]) -> float:
        """Call ``task(mesh, queue)`` until no element waits, and return the sum.

        A task may swap any number of elements per call, but may not create or remove nodes.
        """
        gain = 0.0
        for part in self.partitions if queue.state[1] >= FEW else ():
            gain += run_parts(self.mesh, queue, part, task)
        return gain + until_none_waits(self.mesh, queue, task)


def until_none_waits(mesh: OpenTetrahedra, queue: Queue, task: Callable[[OpenTetrahedra, Queue], float]) -> float:
    gain = 0.0
    while queue.state[1]:
        gain += task(mesh, queue)
    return gain


def run_parts(mesh: OpenTetrahedra, queue: Queue, part: Nodes, task: Callable[[OpenTetrahedra, Queue], float]) -> float:
    waiting, of_element = waiting_rows(mesh, queue), np.empty(len(mesh.elements.node), np.int32)
    find_parts(mesh.elements.node, part, of_element)
    parts = int(part.max()) + 1
    part_of = of_element[waiting]
    count = np.bincount(of_element[of_element >= 0], minlength=parts)
    pools = split_pool(mesh.pool, count)
    inside = [waiting[part_of == i] for i in range(parts)]
    rows = (len(mesh.position), len(of_element))
    scratch = [mesh.cavity]
    scratch += [Cavity.of(*rows) for _ in range(1, min(number_of_threads(), parts))]
    queue.waiting[(of_element == ACROSS) & (queue.waiting == FREE)] = ELSEWHERE

    def work(thread: int, i: int) -> float:
        capacity = len(pools[i].free_elements)
        own = Queue(queue.waiting, padded(inside[i], capacity, -1), np.array([0, len(inside[i])]))
        return until_none_waits(mesh._replace(pool=pools[i], cavity=scratch[thread]), own, task)

    gains = by_turns(work, parts)
    free = np.concatenate([pool.free_elements[: pool.height[1]] for pool in pools])
    mesh.pool.free_elements[: len(free)], mesh.pool.height[1] = free, len(free)
    wait_in(queue, np.append(waiting[part_of < 0], np.flatnonzero(queue.waiting == WANTED)))
    return float(np.sum(gains))


def waiting_rows(mesh: OpenTetrahedra, queue: Queue) -> Nodes:
    first, count = queue.state
    rows = queue.element[(first + np.arange(count)) % len(queue.element)]
    there = mesh.elements.node[rows, 0] >= 0
    queue.waiting[rows[~there]] = FREE
    return rows[there]


def wait_in(queue: Queue, rows: Ints) -> None:
    queue.waiting[:] = FREE
    queue.waiting[rows] = WAITS
    queue.element[: len(rows)], queue.state[:] = rows, (0, len(rows))


def split_pool(pool: Pool, count: Ints) -> list[Pool]:
    free = pool.free_elements[: pool.height[1]]
    cuts = np.cumsum(count)[:-1] * len(free) // max(1, int(count.sum()))
    return [
        pool._replace(free_elements=padded(own, len(own) + int(used), -1), height=np.array([pool.height[0], len(own)]))
        for own, used in zip(np.split(free, cuts), count, strict=True)
    ]
