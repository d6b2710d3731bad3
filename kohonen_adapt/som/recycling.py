"""Recycling: nodes that carry too little of the density are taken away and put where one carries too much."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import Constraints, Elements, Origins, Pool, SurgeryScratch
from kohonen_adapt.kernels.heap import Heap
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.kernels.triangle.connectivity import spread_starts
from kohonen_adapt.kernels.triangle.recycle import fill_heaps, recycle
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import BY_ELEMENT, MovableMesh, with_state

__all__ = ["Recycled", "recycle_nodes", "unchanged"]

RATIO = 2.2  # of the longest edge to the shortest in the metric: below 2 splits and collapses would chase each other
ROUNDS = 2  # what could not be collapsed at first may be when its surroundings have changed
SETTLED = 0.01  # share of the nodes: a round with fewer splits is the last
SPLITS = 100_000  # per compiled call: Python hears Ctrl-C at least every half second

# What stands in rows that are not in use, where it is not -1.
UNUSED = {
    "position": 0.0,
    "pinned": False,
    "elements.level": 0,
    "constraints.kind": 0,
    "constraints.parameter": 0.0,
    "constraints.inner": False,
}


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

    Nodes on outlines keep to their chains, corners and pinned nodes stay, every element keeps its region. `density`
    (nnodes,) is wanted nodes per area up to a factor, `target` the number of nodes in the end, at least that of now:
    more are made by splits alone. With `pairs` splits and collapses go on when there are as many.
    """
    movable.settle()
    before, missing = movable.triangulation.elements, target - movable.nnodes
    spacious = Surgery.on(movable, density, target)
    splits, collapses = spacious.run(movable.floor, missing, RATIO if pairs else np.inf)
    if not splits:
        return unchanged(movable.triangulation)
    old, hint = spacious.hand_back(movable, renumbered=pairs)
    return Recycled(old, hint, starts_of(before, old), splits, collapses)


@dataclass(frozen=True)
class Surgery:
    """The arrays of a movable mesh with room for more nodes and elements, by name and as kernels take them."""

    state: dict[str, NDArray[Any]]
    elements: Elements
    constraints: Constraints
    pool: Pool
    origins: Origins

    @classmethod
    def on(cls, movable: MovableMesh, density: Floats, target: int) -> "Surgery":
        """Copies with one node more than wanted, so that a split can come before its collapse, and elements enough.

        By Euler's formula there is one element more for every node that leaves the outer boundary for the interior.
        """
        n, m = movable.nnodes, len(movable.triangulation.elements.node)
        on_boundary = np.bincount(outer_edges(movable.triangulation.elements).ravel(), minlength=n)
        rows, spare = target + 1, m + int(np.count_nonzero(on_boundary)) + 2 * (target - n) + 4
        state = {
            name: padded(array, spare if name in BY_ELEMENT else rows, UNUSED.get(name, -1))
            for name, array in movable.state().items()
        }
        hint = padded(unchanged(movable.triangulation).hint, rows, -1)
        pool = Pool(hint.copy(), free_rows(n, rows), free_rows(m, spare), np.array([rows - n, spare - m]))
        origins = Origins(
            padded(density, rows, 1.0),
            padded(np.arange(n, dtype=np.int32), rows, -1),
            hint,
            state["pinned"],
            np.zeros(rows, dtype=np.bool_),
            padded(on_boundary > 2, rows, False),
        )
        return cls(state, *with_state(movable.triangulation.elements, movable.constraints, state), pool, origins)

    def run(self, floor: float, missing: int, ratio: float) -> tuple[int, int]:
        """Rounds of splits and collapses; returns how many of each."""
        position, rows = self.state["position"], len(self.elements.node)
        # all edges more than twice: a mesh has three edges for two elements, and outlines
        heaps = Heap.of(4 * rows + 8), Heap.of(4 * rows + 8)
        scratch = SurgeryScratch.of(len(position), rows)
        arrays = position, self.elements, self.constraints, self.pool, self.origins, *heaps
        splits = collapses = 0
        for _ in range(ROUNDS):
            fill_heaps(position, self.elements, self.origins, *heaps)
            at_first, finished = splits, False
            self.origins.young[:] = False
            while not finished:
                more, fewer, finished = recycle(*arrays, max(0, missing - splits), ratio, floor, SPLITS, scratch)
                splits, collapses = splits + more, collapses + fewer
            if splits - at_first <= SETTLED * len(position):
                break
        return splits, collapses

    def hand_back(self, movable: MovableMesh, renumbered: bool) -> tuple[Ints, Ints]:
        """Give the rows in use back, `renumbered` along a space-filling curve: what is near then is so in memory.

        Returns the number before of every node and an element before that is near it, (n,) each.
        """
        node, kept = self.elements.node, np.flatnonzero(self.pool.anchor >= 0)
        if renumbered:
            kept = kept[along_curve(self.state["position"][kept])]
        number = ranks(kept, len(self.pool.anchor))
        used = np.flatnonzero(node[:, 0] >= 0)
        used = used[np.argsort(number[node[used]].min(axis=1), kind="stable")]
        place = np.append(ranks(used, len(node)), np.int32(-1))
        state = {name: array[used if name in BY_ELEMENT else kept] for name, array in self.state.items()}
        state["elements.node"] = number[state["elements.node"]]
        state["elements.neighbour"] = place[state["elements.neighbour"]]
        partner = state["twins.partner"]
        state["twins.partner"] = np.where(partner >= 0, number[partner], -1).astype(np.int32)
        movable.become(state)
        return self.origins.old[kept], self.origins.hint[kept]


def ranks(order: Ints, rows: int) -> Ints:
    """The place of every row in an order of some of them, -1 for the others, (rows,) int32."""
    places = np.full(rows, -1, dtype=np.int32)
    places[order] = np.arange(len(order))
    return places


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
