"""Recycling: nodes that carry too little of the density are taken away and put where one carries too much."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import Constraints, Elements, Origins, Pool, SurgeryScratch
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.triangle.connectivity import spread_starts
from kohonen_adapt.kernels.triangle.recycle import fill_heaps, recycle
from kohonen_adapt.mesh.triangulation import Triangulation, star_of
from kohonen_adapt.outline.movable import MovableMesh
from kohonen_adapt.outline.outline import Outline

__all__ = ["Recycled", "recycle_nodes", "unchanged"]

RATIO = 2.2  # of the longest edge to the shortest in the metric: below 2 splits and collapses would chase each other
ROUNDS = 2  # what could not be collapsed at first may be when its surroundings have changed
SETTLED = 0.01  # share of the nodes: a round with fewer splits is the last
SPLITS = 100_000  # per compiled call: Python hears Ctrl-C at least every half second


@dataclass(frozen=True)
class Recycled:
    """What recycling did to a triangulation.

    Attributes
    ----------
    old
        (n,): number before of every node, -1 for a new one.
    hint
        (n,): an element of the triangulation before that is near every node.
    starts
        (m before,): for every element before a node of its region that is near it now.
    splits, collapses
        How often an edge was split and collapsed.
    """

    old: Ints
    hint: Ints
    starts: Ints
    splits: int
    collapses: int


def unchanged(triangulation: Triangulation) -> Recycled:
    """Describe a triangulation that is not recycled, before its nodes move."""
    nodes, star = np.arange(triangulation.nnodes, dtype=np.int32), triangulation.star
    return Recycled(nodes, star.element[star.start[:-1]], triangulation.elements.node[:, 0], 0, 0)


def recycle_nodes(movable: MovableMesh, density: Floats, target: int, pairs: bool) -> Recycled:
    """Split the longest edges of the metric ``density |dx|^2`` and collapse the shortest, until they are alike.

    Nodes on outlines keep to their chains, corners and pinned nodes stay, every element keeps its region.

    Parameters
    ----------
    movable
        Is changed.
    density
        (nnodes,): wanted nodes per area up to a factor.
    target
        Number of nodes in the end, at least that of now: more are made by splits alone.
    pairs
        Whether to go on with splits and collapses when there are as many.
    """
    movable.settle()
    triangulation, outline = movable.triangulation, movable.outline
    before = triangulation.elements
    spacious = Surgery.on(triangulation, outline, density, unchanged(triangulation).hint, target)
    splits, collapses = spacious.run(movable.floor, target - triangulation.nnodes, RATIO if pairs else np.inf)
    spacious.hand_back(triangulation, outline)
    old = spacious.origins.old
    return Recycled(old, spacious.origins.hint, starts_of(before, old), splits, collapses)


@dataclass
class Surgery:
    """The arrays of a triangulation with room for more nodes and elements."""

    position: Floats
    elements: Elements
    constraints: Constraints
    pool: Pool
    origins: Origins

    @classmethod
    def on(cls, triangulation: Triangulation, outline: Outline, density: Floats, hint: Ints, target: int) -> "Surgery":
        """Copies with one node more than wanted, so that a split can come before its collapse, and elements enough.

        By Euler's formula there is one element more for every node that leaves the outer boundary for the interior.
        """
        n, m = triangulation.nnodes, len(triangulation.elements.node)
        on_boundary = np.bincount(outer_edges(triangulation.elements).ravel(), minlength=n)
        rows, spare = target + 1, m + int(np.count_nonzero(on_boundary)) + 2 * (target - n) + 4
        before = triangulation.elements
        elements = Elements(
            padded(before.node, spare, -1),
            padded(before.neighbour, spare, -1),
            padded(before.region, spare, -1),
            padded(before.chain, spare, -1),
            padded(before.level, rows, 0),
            before.layered,
        )
        constraints = outline.constraints._replace(
            kind=padded(outline.constraints.kind, rows, 0),
            chain=padded(outline.constraints.chain, rows, -1),
            parameter=padded(outline.constraints.parameter, rows, 0.0),
            inner=padded(outline.constraints.inner, rows, False),
            twins=outline.constraints.twins._replace(
                partner=padded(outline.constraints.twins.partner, rows, -1),
                motion=padded(outline.constraints.twins.motion, rows, -1),
            ),
        )
        anchor = padded(hint, rows, -1)
        pool = Pool(anchor, free_rows(n, rows), free_rows(m, spare), np.array([rows - n, spare - m]))
        origins = Origins(
            padded(density, rows, 1.0),
            padded(np.arange(n, dtype=np.int32), rows, -1),
            padded(hint, rows, -1),
            padded(outline.pinned, rows, False),
            np.zeros(rows, dtype=np.bool_),
            padded(on_boundary > 2, rows, False),
        )
        return cls(padded(triangulation.position, rows, 0.0), elements, constraints, pool, origins)

    def run(self, floor: float, missing: int, ratio: float) -> tuple[int, int]:
        """Rounds of splits and collapses; returns how many of each."""
        longest, shortest, room = (*heaps_for(self.elements), room_for(self.position, self.elements))
        arrays = self.position, self.elements, self.constraints, self.pool, self.origins, longest, shortest
        splits = collapses = 0
        for _ in range(ROUNDS):
            fill_heaps(self.position, self.elements, self.origins, longest, shortest)
            at_first, finished = splits, False
            self.origins.young[:] = False
            while not finished:
                more, fewer, finished = recycle(*arrays, max(0, missing - splits), ratio, floor, SPLITS, room)
                splits, collapses = splits + more, collapses + fewer
            if splits - at_first <= SETTLED * len(self.position):
                break
        return splits, collapses

    def hand_back(self, triangulation: Triangulation, outline: Outline) -> None:
        """Fill the rows that are free with the last ones, and give the arrays to the triangulation and its outline."""
        in_use = np.flatnonzero(self.pool.anchor >= 0)
        rows = len(in_use)
        kept = np.arange(rows, dtype=np.int32)
        kept[self.pool.anchor[:rows] < 0] = in_use[in_use >= rows]
        number = np.zeros(len(self.position), dtype=np.int32)
        number[kept] = np.arange(rows)
        used = self.elements.node[:, 0] >= 0
        renumbered = np.append(np.cumsum(used, dtype=np.int32) - 1, -1)
        triangulation.elements = Elements(
            number[self.elements.node[used]],
            renumbered[self.elements.neighbour[used]].astype(np.int32),
            self.elements.region[used],
            self.elements.chain[used],
            self.elements.level[kept],
            self.elements.layered,
        )
        triangulation.position = self.position[kept]
        triangulation.star = star_of(triangulation.elements.node, rows)
        constraints, names = self.constraints, ("kind", "chain", "parameter", "inner")
        partner, motion = constraints.twins.partner[kept], constraints.twins.motion[kept]
        twins = constraints.twins._replace(partner=np.where(partner >= 0, number[partner], -1), motion=motion)
        arrays = {name: getattr(constraints, name)[kept] for name in names}
        outline.constraints = constraints._replace(twins=twins, **arrays)
        outline.pinned = self.origins.pinned[kept]
        self.origins = Origins(*(array[kept] for array in self.origins))


def starts_of(before: Elements, old: Ints) -> Ints:
    """For every element before a node that it had and has not lost, or one that its region has near it."""
    now = np.full(before.node.max() + 1, -1, dtype=np.int32)
    survivors = np.flatnonzero(old >= 0)
    now[old[survivors]] = survivors
    starts = now[before.node].max(axis=1)
    spread_starts(before, starts, np.empty(len(starts), dtype=np.int32))
    return starts


def outer_edges(elements: Elements) -> Ints:
    """The nodes of the edges on the outer boundary, (k, 2)."""
    e, k = np.nonzero(elements.neighbour < 0)
    return np.stack([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]], axis=1)


def heaps_for(elements: Elements) -> tuple[Heap, Heap]:
    """Two heaps with room for all edges more than twice: a mesh has three edges for two elements, and outlines."""
    size = 4 * len(elements.node) + 8
    return Heap.of(size), Heap.of(size)


def room_for(position: Floats, elements: Elements) -> SurgeryScratch:
    """Scratch of the kernel."""
    return SurgeryScratch.of(len(position), len(elements.node))


def padded(array: NDArray[Any], rows: int, value: float) -> NDArray[Any]:
    """A copy with rows of a value added."""
    longer = np.full((rows, *array.shape[1:]), value, dtype=array.dtype)
    longer[: len(array)] = array
    return longer


def free_rows(used: int, rows: int) -> Ints:
    """A stack of the rows that are free, with room for all, the first of them on top."""
    stack = np.empty(rows, dtype=np.int32)
    stack[: rows - used] = np.arange(rows - 1, used - 1, -1)
    return stack
