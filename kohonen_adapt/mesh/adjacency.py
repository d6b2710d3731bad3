"""Turn elements the right way round, and find the neighbours of each.

scikit-fem sorts the nodes of elements by number and has no neighbours, and its facets tell neither which side of them
an element is on, nor that more than two elements share one: what is tangled shows here.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.host import ascending, keys_of

__all__ = ["neighbours_of", "parts_of_regions", "positive", "write_on_both_sides"]


def positive(position: Floats, t: ArrayLike) -> NDArray[np.int32]:
    """Elements as rows of nodes (m, d + 1) of positive area or volume; scikit-fem sorts them by number instead.

    `position` is (n, d), `t` (d + 1, m).
    """
    node = np.array(np.asarray(t).T, dtype=np.int32, order="C")
    negative = CELLS[position.shape[1]].determinant(position.T[:, node.T]) < 0.0
    node[negative, -2:] = node[negative, :-3:-1]
    return node


def neighbours_of(node: NDArray[np.int32]) -> NDArray[np.int32]:
    """The element across the facet opposite to every corner, (m, d + 1), -1 outside, of elements from `positive`.

    Raises
    ------
    ValueError
        If two elements lie on the same side of a facet, overturned or one on the other.
    """
    (m, corners), cell = node.shape, CELLS[node.shape[1] - 1]
    facet = node.T[np.array(cell.outward).T]  # (d, d + 1, m)
    key = keys_of(ascending(*facet), int(node.max()) + 1).T.ravel()
    even = _is_even(facet).T.ravel()
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    one, other = order[:-1][same], order[1:][same]
    # two elements see the nodes of their facet in opposite senses, and no third one does
    bad = (even[one] == even[other]) | np.append(same[1:] & same[:-1], False)[same]
    if bad.any():
        fold = min(one[bad].min(), other[bad].min()) // corners
        raise ValueError(
            f"the mesh is tangled: element {fold} shares {cell.facet} with an element on the same side of it "
            "(overturned or doubled); repair the mesh before adapting it."
        )
    neighbour = np.full(corners * m, -1, dtype=np.int32)
    neighbour[one], neighbour[other] = other // corners, one // corners
    return neighbour.reshape(m, corners)


def _is_even(rows: NDArray[np.int32]) -> Mask:
    """Whether the entries of every column (k, ...) come into ascending order by an even number of exchanges."""
    odd = np.zeros(rows.shape[1:], dtype=np.bool_)
    for k in range(1, len(rows)):
        odd ^= np.logical_xor.reduce(rows[:k] > rows[k], axis=0)
    return ~odd


def parts_of_regions(neighbour: Ints, region: Ints) -> Ints:
    """The connected part of the mesh that every region of elements (m,) is of, (nregions,); neighbours (m, d + 1)."""
    e, k = np.nonzero((neighbour >= 0) & (region[neighbour] != region[:, None]))
    beside, count = (region[e], region[neighbour[e, k]]), int(region.max()) + 1
    return connected_components(coo_array((np.ones(len(e)), beside), shape=(count, count)), directed=False)[1]


def write_on_both_sides(of_facet: Ints, neighbour: Ints, element: Ints, corner: Ints, value: Ints) -> None:
    """Write values of facets, opposite to these corners of elements, into the rows (m, d) of both elements of each."""
    of_facet[element, corner] = value
    across = neighbour[element, corner]
    inside = across >= 0
    e, own = across[inside], element[inside]
    of_facet[e, np.argmax(neighbour[e] == own[:, None], axis=1)] = value[inside]
