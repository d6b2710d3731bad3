"""Orientation and neighbours of elements.

scikit-fem sorts the nodes of elements by index and stores no neighbours. Its facets show neither on which side an
element lies, nor that more than two elements share a facet. Tangled meshes are therefore detected here.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import point_text
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.host import ascending, keys_of

__all__ = ["neighbours_of", "parts_of_regions", "positive", "write_on_both_sides"]


def positive(position: Floats, t: ArrayLike) -> NDArray[np.int32]:
    """Return elements as rows of nodes, (m, d + 1), with positive area or volume."""
    node = np.array(np.asarray(t).T, dtype=np.int32, order="C")
    negative = CELLS[position.shape[1]].determinant(position.T[:, node.T]) < 0.0
    node[negative, -2:] = node[negative, :-3:-1]
    return node


def neighbours_of(node: NDArray[np.int32], position: Floats) -> NDArray[np.int32]:
    """Return the element across the facet opposite to every corner, -1 outside.

    Raises ValueError if two elements lie on the same side of a facet, because one is inverted or both overlap.
    """
    (m, corners), cell = node.shape, CELLS[node.shape[1] - 1]
    facet = node.T[np.array(cell.outward).T]  # (d, d + 1, m)
    key = keys_of(ascending(*facet), int(node.max()) + 1).T.ravel()
    even = _is_even(facet).T.ravel()
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    one, other = order[:-1][same], order[1:][same]
    # Two elements have the nodes of a facet in opposite orientation, and no third element has the same nodes.
    bad = (even[one] == even[other]) | np.append(same[1:] & same[:-1], False)[same]
    if bad.any():
        side = min(one[bad].min(), other[bad].min())
        ends = facet.reshape(cell.dim, -1, order="F")[:, side]
        shown = " and ".join(f"node {end} at {point_text(position[end])}" for end in ends)
        raise ValueError(
            f"the mesh is tangled: element {side // corners} shares {cell.facet} with an element on the same side of "
            f"it (inverted or doubled), of {shown}; repair the mesh before adapting it."
        )
    neighbour = np.full(corners * m, -1, dtype=np.int32)
    neighbour[one], neighbour[other] = other // corners, one // corners
    return neighbour.reshape(m, corners)


def _is_even(rows: NDArray[np.int32]) -> Mask:
    odd = np.zeros(rows.shape[1:], dtype=np.bool_)
    for k in range(1, len(rows)):
        odd ^= np.logical_xor.reduce(rows[:k] > rows[k], axis=0)
    return ~odd


def parts_of_regions(neighbour: Ints, region: Ints) -> Ints:
    e, k = np.nonzero((neighbour >= 0) & (region[neighbour] != region[:, None]))
    adjacent, count = (region[e], region[neighbour[e, k]]), int(region.max()) + 1
    return connected_components(coo_array((np.ones(len(e)), adjacent), shape=(count, count)), directed=False)[1]


def write_on_both_sides(of_facet: Ints, neighbour: Ints, element: Ints, corner: Ints, value: Ints) -> None:
    of_facet[element, corner] = value
    across = neighbour[element, corner]
    inside = across >= 0
    e, own = across[inside], element[inside]
    of_facet[e, np.argmax(neighbour[e] == own[:, None], axis=1)] = value[inside]
