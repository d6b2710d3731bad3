"""Arrays of a triangle mesh in another order, and with spare rows.

Mesh generators number nodes in the order of their creation. Along a space-filling curve, neighbours are near in memory.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints, free_rows, padded, ranks
from kohonen_adapt.geometry.movable import Recycled, unchanged
from kohonen_adapt.geometry.plane.movable import BY_ELEMENT, MovableMesh, with_state
from kohonen_adapt.kernels.arrays import Pool
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.kernels.triangle.arrays import SLIDING, Elements, OpenMesh, Origins, SurgeryScratch
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Surgery", "element_order", "numbered_along_curve", "reordered_state"]

FEW = 10_000  # number of nodes of a mesh that fits in the cache of a processor in any order
FAR = 4.0  # median index distance of neighbours above which nodes are renumbered, relative to sqrt(nnodes)
# Values of unused rows; all other arrays have -1 there.
UNUSED = {
    "position": 0.0,
    "pinned": False,
    "elements.level": 0,
    "constraints.kind": 0,
    "constraints.parameter": 0.0,
    "constraints.inner": False,
}


@contextmanager
def numbered_along_curve(movable: MovableMesh) -> Iterator[Ints | None]:
    # Yields the previous index of every element, shape (m,), or None if neighbours have near indices already and
    # nothing changes. The old numbering is restored on exit; the numbers of nodes and elements must be the same as on
    # entry.
    tri = movable.triangulation
    if not is_scattered(tri):
        yield None
        return
    nodes, count = along_curve(tri.position), len(tri.elements.node)
    elements = element_order(tri.elements.node, ranks(nodes, tri.nnodes))
    movable.set_arrays(reordered_state(movable.state(), nodes, elements))
    try:
        yield elements
    finally:
        movable.set_arrays(reordered_state(movable.state(), ranks(nodes, tri.nnodes), ranks(elements, count)))


def is_scattered(triangulation: Triangulation) -> bool:
    node = triangulation.elements.node
    if triangulation.nnodes < FEW:
        return False
    return bool(np.median(np.abs(node[:, 0] - node[:, 1])) > FAR * np.sqrt(triangulation.nnodes))


def reordered_state(state: Mapping[str, NDArray[Any]], nodes: Ints, elements: Ints) -> dict[str, NDArray[Any]]:
    node_index = ranks(nodes, len(state["position"]))
    element_index = np.append(ranks(elements, len(state["elements.node"])), np.int32(-1))
    reordered = {name: np.take(a, elements if name in BY_ELEMENT else nodes, axis=0) for name, a in state.items()}
    reordered["elements.node"] = node_index[reordered["elements.node"]]
    reordered["elements.neighbour"] = element_index[reordered["elements.neighbour"]]
    partner = reordered["twins.partner"]
    reordered["twins.partner"] = np.where(partner >= 0, node_index[partner], -1).astype(np.int32)
    return reordered


def element_order(node: Ints, node_index: Ints) -> Ints:
    return np.argsort(node_index[node].min(axis=1), kind="stable")


@dataclass(frozen=True)
class Surgery:
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
        state = movable.padded_state(rows, spare, UNUSED)
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
