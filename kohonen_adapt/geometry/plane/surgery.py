"""Arrays of a triangle mesh with spare rows for splits and collapses."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints, free_rows, padded, ranks
from kohonen_adapt.geometry.plane.movable import BY_ELEMENT, MovableMesh, with_state
from kohonen_adapt.geometry.plane.numbering import element_order, reordered_state
from kohonen_adapt.geometry.recycled import Recycled, unchanged
from kohonen_adapt.kernels.arrays import SLIDING, Elements, OpenMesh, Origins, Pool, SurgeryScratch
from kohonen_adapt.kernels.ordering import along_curve

__all__ = ["Surgery"]

# Values of unused rows; all other arrays have -1 there.
UNUSED = {
    "position": 0.0,
    "pinned": False,
    "elements.level": 0,
    "constraints.kind": 0,
    "constraints.parameter": 0.0,
    "constraints.inner": False,
}


@dataclass(frozen=True)
class Surgery:
    """Arrays of a movable mesh with spare rows, by name and as a kernel record."""

    state: dict[str, NDArray[Any]]
    mesh: OpenMesh

    @classmethod
    def on(cls, movable: MovableMesh, density: Floats, target: int, done: Recycled) -> "Surgery":
        """Copy the arrays of `movable`, with spare rows for nodes and elements.

        Rows are allocated for one node more than `target`, so that a split can precede the collapse. By Euler's
        formula, every node that moves from the outer boundary to the interior adds an element. Old indices refer to the
        mesh before the earlier steps `done`.
        """
        n, m = movable.nnodes, len(movable.triangulation.elements.node)
        on_boundary = np.bincount(outer_edges(movable.triangulation.elements).ravel(), minlength=n)
        rows, spare = target + 1, m + int(np.count_nonzero(on_boundary)) + 2 * (target - n) + 4
        state = {
            name: padded(array, spare if name in BY_ELEMENT else rows, UNUSED.get(name, -1))
            for name, array in movable.state().items()
        }
        anchor = padded(unchanged(movable.triangulation).start_element, rows, -1)
        pool = Pool(anchor, free_rows(n, rows), free_rows(m, spare), np.array([rows - n, spare - m], dtype=np.int64))
        origins = Origins(
            padded(density, rows, 1.0),
            padded(done.old, rows, -1),
            padded(done.start_element, rows, -1),
            state["pinned"],
            np.zeros(rows, dtype=np.bool_),
            padded(on_boundary > 2, rows, False),
            padded(longest_merged(movable), rows, np.inf),
        )
        records = with_state(movable.triangulation.elements, movable.constraints, state)
        return cls(state, OpenMesh(state["position"], *records, pool, origins, SurgeryScratch.of(rows, spare)))

    def write_back(self, movable: MovableMesh, renumbered: bool = False) -> tuple[Ints, Ints]:
        anchor, node = self.mesh.pool.anchor, self.mesh.elements.node
        nodes = np.flatnonzero(anchor >= 0)
        if renumbered:
            nodes = nodes[along_curve(self.state["position"][nodes])]
        elements = np.flatnonzero(node[:, 0] >= 0)
        elements = elements[element_order(node[elements], ranks(nodes, len(anchor)))]
        movable.set_arrays(reordered_state(self.state, nodes, elements))
        return nodes, elements


def longest_merged(movable: MovableMesh) -> Floats:
    even = np.append(movable.constraints.chains.even, np.inf)
    return even[np.where(movable.constraints.kind == SLIDING, movable.constraints.own_chain, -1)]


def outer_edges(elements: Elements) -> Ints:
    e, k = np.nonzero(elements.neighbour < 0)
    return np.stack([elements.node[e, (k + 1) % 3], elements.node[e, (k + 2) % 3]], axis=1)
