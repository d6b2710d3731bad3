"""Number nodes and elements of a movable mesh along a space-filling curve for a while, to have near what is near."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Ints, ranks
from kohonen_adapt.kernels.ordering import along_curve
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.outline.movable import BY_ELEMENT, MovableMesh

__all__ = ["along", "numbered_along_curve", "with_rows"]

FEW = 10_000  # nodes that a processor's cache holds, wherever they are
FAR = 4.0  # times the root of the number of nodes: what is numbered row by row has half of its edges within one row


@contextmanager
def numbered_along_curve(movable: MovableMesh) -> Iterator[Ints | None]:
    """Number nodes and elements along a curve, and in the end as before, where neighbours have numbers far apart.

    That is so in meshes from generators, which number nodes as they make them. Gives the number before of every
    element, (m,), or None where all keep theirs. There must be as many nodes and elements in the end.
    """
    tri = movable.triangulation
    if not is_scattered(tri):
        yield None
        return
    nodes, count = along_curve(tri.position), len(tri.elements.node)
    elements = along(tri.elements.node, ranks(nodes, tri.nnodes))
    movable.become(with_rows(movable.state(), nodes, elements))
    try:
        yield elements
    finally:
        movable.become(with_rows(movable.state(), ranks(nodes, tri.nnodes), ranks(elements, count)))


def is_scattered(triangulation: Triangulation) -> bool:
    """Whether there are many nodes, and half of the neighbours have numbers that are far apart."""
    node = triangulation.elements.node
    if triangulation.nnodes < FEW:
        return False
    return bool(np.median(np.abs(node[:, 0] - node[:, 1])) > FAR * np.sqrt(triangulation.nnodes))


def with_rows(state: Mapping[str, NDArray[Any]], nodes: Ints, elements: Ints) -> dict[str, NDArray[Any]]:
    """The state of a movable mesh with these of its nodes and elements, in this order."""
    number = ranks(nodes, len(state["position"]))
    place = np.append(ranks(elements, len(state["elements.node"])), np.int32(-1))
    kept = {name: np.take(a, elements if name in BY_ELEMENT else nodes, axis=0) for name, a in state.items()}
    kept["elements.node"] = number[kept["elements.node"]]
    kept["elements.neighbour"] = place[kept["elements.neighbour"]]
    partner = kept["twins.partner"]
    kept["twins.partner"] = np.where(partner >= 0, number[partner], -1).astype(np.int32)
    return kept


def along(node: Ints, number: Ints) -> Ints:
    """The order of elements (m, 3) by the lowest number of their nodes."""
    return np.argsort(number[node].min(axis=1), kind="stable")
