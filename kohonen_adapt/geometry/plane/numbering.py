"""Temporary numbering of nodes and elements along a space-filling curve.

Mesh generators number nodes in the order of their creation. Along the curve, neighbours are near in memory.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Ints, ranks
from kohonen_adapt.geometry.plane.movable import BY_ELEMENT, MovableMesh
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["element_order", "numbered_along_curve", "reordered_state"]

FEW = 10_000  # number of nodes of a mesh that fits in the cache of a processor in any order
FAR = 4.0  # median index distance of neighbours above which nodes are renumbered, relative to sqrt(nnodes)


@contextmanager
def numbered_along_curve(movable: MovableMesh) -> Iterator[Ints | None]:
    """Number nodes and elements along a space-filling curve within a context.

    Yields the previous index of every element, shape (m,), or None if neighbours have near indices already and nothing
    changes. The old numbering is restored on exit; the numbers of nodes and elements must be the same as on entry.
    """
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
