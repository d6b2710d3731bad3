"""Make room in the arrays of a movable mesh for splits and collapses, and say which nodes are old in the end."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints, free_rows, padded, ranks
from kohonen_adapt.kernels.arrays import SLIDING, Elements, OpenMesh, Origins, Pool, SurgeryScratch
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import BY_ELEMENT, MovableMesh, with_state
from kohonen_adapt.outline.numbering import along, with_rows

__all__ = ["Recycled", "Surgery", "unchanged"]

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
    """What recycling, of one kind after another, did to a triangulation.

    Attributes
    ----------
    old
        (n,): number before of every node, -1 for a new one.
    hint
        (n,): an element of the triangulation before that is near every node.
    splits, collapses
        How often an edge was split and collapsed.
    """

    old: Ints
    hint: Ints
    splits: int
    collapses: int


def unchanged(mesh: Triangulation | Tetrahedralization) -> Recycled:
    """Describe a mesh that is not recycled, before its nodes move."""
    star = mesh.star
    return Recycled(np.arange(mesh.nnodes, dtype=np.int32), star.element[star.start[:-1]], 0, 0)


@dataclass(frozen=True)
class Surgery:
    """The arrays of a movable mesh with room for more nodes and elements, by name and as kernels take them."""

    state: dict[str, NDArray[Any]]
    mesh: OpenMesh

    @classmethod
    def on(cls, movable: MovableMesh, density: Floats, target: int, done: Recycled) -> "Surgery":
        """Copies with one node more than wanted, so that a split can come before its collapse, and elements enough.

        By Euler's formula there is one element more for every node that leaves the outer boundary for the interior.
        Old nodes and hints go on being those of the mesh before what was `done` already.
        """
        n, m = movable.nnodes, len(movable.triangulation.elements.node)
        on_boundary = np.bincount(outer_edges(movable.triangulation.elements).ravel(), minlength=n)
        rows, spare = target + 1, m + int(np.count_nonzero(on_boundary)) + 2 * (target - n) + 4
        state = {
            name: padded(array, spare if name in BY_ELEMENT else rows, UNUSED.get(name, -1))
            for name, array in movable.state().items()
        }
        anchor = padded(unchanged(movable.triangulation).hint, rows, -1)
        pool = Pool(anchor, free_rows(n, rows), free_rows(m, spare), np.array([rows - n, spare - m], dtype=np.int64))
        origins = Origins(
            padded(density, rows, 1.0),
            padded(done.old, rows, -1),
            padded(done.hint, rows, -1),
            state["pinned"],
            np.zeros(rows, dtype=np.bool_),
            padded(on_boundary > 2, rows, False),
            padded(longest_joined(movable), rows, np.inf),
        )
        records = with_state(movable.triangulation.elements, movable.constraints, state)
        return cls(state, OpenMesh(state["position"], *records, pool, origins, SurgeryScratch.of(rows, spare)))

    def hand_back(self, movable: MovableMesh, renumbered: bool = False) -> tuple[Ints, Ints]:
        """Give the rows in use back, `renumbered` along a space-filling curve: what is near then is so in memory.

        Returns the row of every node, and of every element.
        """
        anchor, node = self.mesh.pool.anchor, self.mesh.elements.node
        kept = np.flatnonzero(anchor >= 0)
        if renumbered:
            kept = kept[along_curve(self.state["position"][kept])]
        used = np.flatnonzero(node[:, 0] >= 0)
        used = used[along(node[used], ranks(kept, len(anchor)))]
        movable.become(with_rows(self.state, kept, used))
        return kept, used


def longest_joined(movable: MovableMesh) -> Floats:
    """The longest facet that may be made of two at every node, (n,), so that no more is cut off a curve than was."""
    even = np.append(movable.constraints.chains.even, np.inf)
    return even[np.where(movable.constraints.kind == SLIDING, movable.constraints.own_chain, -1)]


def outer_edges(elements: Elements) -> Ints:
    """The nodes of the edges on the outer boundary, (k, 2)."""
    e, k = np.nonzero(elements.neighbour < 0)
    return np.stack([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]], axis=1)
