"""Cut a mesh of tetrahedra into parts that threads change side by side: no result depends on their number.

Nodes are cut in two ways: what lies at the cuts of the one lies mostly deep in a part of the other, and little is left
for one thread alone. An element belongs to a part if all four of its nodes do. Where all elements that surgery takes
out are of one part, so are those that it puts in, and all that it changes beside them is what an element across a face
of theirs knows of this face: as three nodes of it are of the part, no other part changes it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Ints, padded
from kohonen_adapt.kernels.arrays import Pool
from kohonen_adapt.kernels.ordering import MARGIN, along_curve, parts_along
from kohonen_adapt.kernels.tetrahedron.arrays import ELSEWHERE, FREE, WAITS, WANTED, Cavity, OpenTetrahedra, Queue, Star
from kohonen_adapt.kernels.tetrahedron.stars import ACROSS, find_parts, mark_deep
from kohonen_adapt.kernels.threads import Nodes, by_turns, number_of_threads, shared_in_parts

__all__ = ["Parts", "wait_in"]

MARGINS = MARGIN, 0.4  # of the curves that are cut: they halve the mesh at different places
STRIPS = 0.25  # share of the nodes that may be so near the cuts of one way that they have to wait
LEAST = 1_000  # nodes in a part: fewer are not worth a thread
FEW = 2_000  # elements that wait: fewer are not worth to be shared out


@dataclass(frozen=True)
class Parts:
    """A mesh, whose nodes are cut into parts when that is first asked for; until nodes are made or taken away.

    Attributes
    ----------
    mesh
        The mesh.
    """

    mesh: OpenTetrahedra

    @cached_property
    def order(self) -> Nodes:
        """Rows of nodes in use along a space-filling curve."""
        return self._along(MARGINS[0])

    @cached_property
    def ways(self) -> tuple[Nodes, ...]:
        """The part that each row of nodes belongs to, (n,), 0 for those not in use; in two ways, or none for few."""
        count = parts_for(len(self.order))
        orders = [self.order, self._along(MARGINS[1])] if count > 1 else []
        return tuple(parts_along(order, len(self.mesh.position), count) for order in orders)

    def _along(self, margin: float) -> Nodes:
        nodes = np.flatnonzero(self.mesh.pool.anchor >= 0).astype(np.int32)
        return nodes[along_curve(self.mesh.position[nodes], margin)]

    def sweep(self, star: Star, task: Callable[[int, Nodes], float]) -> float:
        """Call ``task(thread, nodes)`` for all nodes; adds up what it returns, and may depend on neighbours alone."""
        ways = list[tuple[Nodes, NDArray[np.bool_]]]()
        for part in self.ways:
            deep = np.empty(len(part), dtype=np.bool_)
            mark_deep(star, part, 1, deep, np.empty_like(part))
            ways.append((part, deep))
        return shared_in_parts(task, self.order, *ways)

    def work_off(self, queue: Queue, task: Callable[[OpenTetrahedra, Queue], float]) -> float:
        """Call ``task(mesh, queue)`` with a part and its own queue, again and again until no element waits, and then
        with what is left of them; returns the sum of what it returns.

        It swaps elements, as many as it likes in a call, and makes and takes away no node.
        """
        gain = 0.0
        for part in self.ways if queue.state[1] >= FEW else ():
            gain += share_out(self.mesh, queue, part, task)
        return gain + until_none_waits(self.mesh, queue, task)


def until_none_waits(mesh: OpenTetrahedra, queue: Queue, task: Callable[[OpenTetrahedra, Queue], float]) -> float:
    """Call the task until the queue is empty; returns the sum of what it returns."""
    gain = 0.0
    while queue.state[1]:
        gain += task(mesh, queue)
    return gain


def share_out(mesh: OpenTetrahedra, queue: Queue, part: Nodes, task: Callable[[OpenTetrahedra, Queue], float]) -> float:
    """Work off what waits inside of parts, which threads take side by side; what is at their cuts, and waits or has
    been in the way, then waits in the queue.
    """
    waiting, of_element = waiting_rows(mesh, queue), np.empty(len(mesh.elements.node), dtype=np.int32)
    find_parts(mesh.elements.node, part, of_element)
    parts, place = int(part.max()) + 1, of_element[waiting]
    count = np.bincount(of_element[of_element >= 0], minlength=parts)
    pools, inside = shares_of(mesh.pool, count), [waiting[place == i] for i in range(parts)]
    rows, scratch = (len(mesh.position), len(of_element)), [mesh.cavity]
    scratch += [Cavity.of(*rows) for _ in range(1, min(number_of_threads(), parts))]
    queue.waiting[(of_element == ACROSS) & (queue.waiting == FREE)] = ELSEWHERE

    def work(thread: int, i: int) -> float:
        room = len(pools[i].free_elements)
        own = Queue(queue.waiting, padded(inside[i], room, -1), np.array([0, len(inside[i])]))
        return until_none_waits(mesh._replace(pool=pools[i], cavity=scratch[thread]), own, task)

    gains = by_turns(work, parts)
    free = np.concatenate([pool.free_elements[: pool.height[1]] for pool in pools])
    mesh.pool.free_elements[: len(free)], mesh.pool.height[1] = free, len(free)
    wait_in(queue, np.append(waiting[place < 0], np.flatnonzero(queue.waiting == WANTED)))
    return float(np.sum(gains))


def waiting_rows(mesh: OpenTetrahedra, queue: Queue) -> Nodes:
    """The elements in a queue that are still there, the first come the first; the others wait no more."""
    first, count = queue.state
    rows = queue.element[(first + np.arange(count)) % len(queue.element)]
    there = mesh.elements.node[rows, 0] >= 0
    queue.waiting[rows[~there]] = FREE
    return rows[there]


def wait_in(queue: Queue, rows: Ints) -> None:
    """Have these elements wait, in this order, and no others."""
    queue.waiting[:] = FREE
    queue.waiting[rows] = WAITS
    queue.element[: len(rows)], queue.state[:] = rows, (0, len(rows))


def shares_of(pool: Pool, count: Ints) -> list[Pool]:
    """Free rows of elements for every part, in proportion to the `count` that it has, and room for all of these."""
    free = pool.free_elements[: pool.height[1]]
    cuts = np.cumsum(count)[:-1] * len(free) // max(1, int(count.sum()))
    return [
        pool._replace(free_elements=padded(own, len(own) + int(used), -1), height=np.array([pool.height[0], len(own)]))
        for own, used in zip(np.split(free, cuts), count, strict=True)
    ]


def parts_for(nodes: int) -> int:
    """The largest power of two of parts, p, beside whose cuts, 6 (p^(1/3) - 1) n^(2/3) nodes, no more are than allowed.

    So many lie beside the planes that cut a cube of n nodes into p cubes.
    """
    parts = 1
    while 2 * parts * LEAST <= nodes and 6.0 * ((2 * parts) ** (1 / 3) - 1.0) <= STRIPS * nodes ** (1 / 3):
        parts *= 2
    return parts
