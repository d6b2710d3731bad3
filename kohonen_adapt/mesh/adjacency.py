"""Orientation and neighbours of elements, and refusal of tangled meshes.

scikit-fem sorts the nodes of elements by index and stores no neighbours. Its facets show neither on which side an
element lies, nor that more than two elements share a facet. The number of elements over a point changes across facets
of the rim only. Elements that lie on others are therefore found by the centroids of elements with a facet on the rim.
"""

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree
from skfem import Mesh

from kohonen_adapt.arrays import Array, Floats, Ints, IntsPair
from kohonen_adapt.checks import listed, point_text
from kohonen_adapt.mesh.cells import CELLS, cell_of, centroids_of, width_of
from kohonen_adapt.mesh.curved import corners_of, midside_offsets
from kohonen_adapt.mesh.host import ascending, elements_of, keys_of, numbered
from kohonen_adapt.mesh.names import connected_components_of, named_sets

__all__ = [
    "BoxTree",
    "across",
    "connected_arrays",
    "neighbours_of",
    "parts_at",
    "parts_of_regions",
    "positive",
    "write_on_both_sides",
]

BRANCHES = 4  # boxes in each box of the tree
FIRST, GROWTH, MOST = 16, 16, 2**16  # number of points at a time, few at first: stacked elements give many pairs
ROUNDING = 16.0 * np.finfo(np.float64).eps  # rounding error of coordinates of the order of 1
WHAT = {2: ("areas", "surfaces"), 3: ("volumes", "volumes")}  # words for elements and for the drawing


def positive(position: Floats, t: ArrayLike) -> Ints:
    """Return elements as rows of nodes, (m, d + 1), with positive area or volume."""
    node = np.array(np.asarray(t).T, dtype=np.int32, order="C")
    negative = CELLS[position.shape[1]].determinant(position.T[:, node.T]) < 0.0
    node[negative, -2:] = node[negative, :-3:-1]
    return node


def neighbours_of(node: Ints, position: Floats) -> Ints:
    """Return the element across the facet opposite to every corner, -1 outside."""
    cell = CELLS[node.shape[1] - 1]
    facet = node.T[np.array(cell.outward).T]  # (d, d + 1, m)
    key = keys_of(ascending(*facet), int(node.max()) + 1)
    index = numbered(key.ravel()).reshape(key.shape)
    odd = np.logical_xor.reduce([one > other for one, other in combinations(facet, 2)])
    count, of_odd = (np.bincount(index.ravel(), weights) for weights in (None, odd.ravel()))
    # Two elements have the nodes of a facet in opposite orientation, and no third element has the same nodes.
    bad = ((count > 2) | ((count == 2) & (of_odd != 1)))[index]
    if bad.any():
        element, corner = np.argwhere(bad.T)[0]
        shown = " and ".join(f"node {end} at {point_text(position[end])}" for end in facet[:, corner, element])
        raise ValueError(
            f"the mesh is tangled: element {element} shares {cell.facet} with an element on the same side of "
            f"it (inverted or doubled), of {shown}; repair the mesh before adapting it."
        )
    neighbour = elements_of(index, len(count)).sum(axis=0)[index] - np.arange(len(node))
    return np.ascontiguousarray(neighbour.T, np.int32)


def parts_of_regions(neighbour: Ints, region: Ints) -> Ints:
    e, k = np.nonzero((neighbour >= 0) & (region[neighbour] != region[:, None]))
    return connected_components_of(int(region.max()) + 1, np.stack([region[e], region[neighbour[e, k]]], axis=1))


def write_on_both_sides(of_facet: Array, neighbour: Ints, element: Ints, corner: Ints, value: Array) -> None:
    of_facet[element, corner] = value
    inside = neighbour[element, corner] >= 0
    of_facet[across(neighbour, element[inside], corner[inside])] = value[inside]


def across(neighbour: Ints, element: Ints, corner: Ints) -> IntsPair:
    """Return the elements across facets inside the mesh, and the corners there."""
    there = neighbour[element, corner]
    return there, np.argmax(neighbour[there] == element[:, None], axis=1)


def connected_arrays(mesh: Mesh) -> tuple[Floats, Ints, Ints]:
    """Return nodes (n, d), positive elements (m, d + 1) and their neighbours.

    Raises
    ------
    ValueError
        If the mesh is tangled, or if elements lie on others.
    """
    corners = corners_of(mesh)
    position = np.ascontiguousarray(corners.p.T, np.float64)
    node = positive(position, corners.t)
    neighbour = neighbours_of(node, position)
    refuse_overlap(mesh, position, node, neighbour)
    return position, node, neighbour


def refuse_overlap(mesh: Mesh, position: Floats, node: Ints, neighbour: Ints) -> None:
    rim = np.flatnonzero((neighbour < 0).any(axis=1))
    size, (words, drawn) = width_of(mesh), WHAT[cell_of(mesh).dim]
    corners = ((position - position.min(axis=0)) / size).T[:, node.T]
    extent = np.ptp(corners, axis=1).max(axis=0)
    margin = 1.5 * np.linalg.norm(midside_offsets(mesh), axis=0).max(axis=0) / size
    tree = BoxTree(corners.min(axis=1), corners.max(axis=1))
    start, count = 0, FIRST
    while start < len(rim):
        own = rim[start : start + count]
        centroids = corners[:, :, own].mean(axis=1)
        holder, point = tree.boxes_around(centroids)
        others = holder != own[point]
        holder, point = holder[others], point[others]
        # a side in the plane is at most sqrt(2) extents long
        least = (ROUNDING + margin[holder] + margin[own[point]]) * extent[holder] ** (len(corners) - 1)
        inside = np.all(parts_at(corners[:, :, holder], centroids[:, point]) > least, axis=0)
        if inside.any():
            first = np.flatnonzero(inside)[np.argmin(point[inside])]
            element, other = own[point[first]], holder[first]
            raise ValueError(
                f"the mesh lies on itself: at {point_text(centroids_of(mesh, element))} element {element}"
                f"{_subdomain(mesh, element)} is on element {other}{_subdomain(mesh, other)}, so {words} count twice. "
                f"Cut the {drawn} of the drawing at one another before meshing (Gmsh: BooleanFragments, where both are "
                "the same Coherence), so that each lies in one subdomain only."
            )
        start, count = start + count, min(count * GROWTH, MOST)


class BoxTree:
    """Hierarchy of boxes (d, m), for meshes of elements of very different sizes."""

    def __init__(self, low: Floats, high: Floats) -> None:
        self.order = KDTree(0.5 * (low + high).T).indices  # keeps neighbours together
        self.levels = [(low[:, self.order], high[:, self.order])]
        while self.levels[-1][0].shape[1] > BRANCHES:
            low, high = self.levels[-1]
            first = np.arange(0, low.shape[1], BRANCHES)
            self.levels.append((np.minimum.reduceat(low, first, axis=1), np.maximum.reduceat(high, first, axis=1)))

    def boxes_around(self, x: Floats) -> IntsPair:
        box, point = (pair.ravel() for pair in np.indices((self.levels[-1][0].shape[1], x.shape[1])))
        for depth, (low, high) in enumerate(reversed(self.levels)):
            if depth:
                box = (BRANCHES * box[:, None] + np.arange(BRANCHES)).ravel()
                point = np.repeat(point, BRANCHES)
                there = box < low.shape[1]
                box, point = box[there], point[there]
            for axis in range(len(x)):
                at = x[axis, point]
                inside = (low[axis, box] <= at) & (at <= high[axis, box])
                box, point = box[inside], point[inside]
        return self.order[box], point


def parts_at(corners: Floats, x: Floats) -> Floats:
    # determinants of the elements with one corner at the point, (d + 1, q): barycentric coordinates times determinants
    found = []
    for corner in range(corners.shape[1]):
        replaced = corners.copy()
        replaced[:, corner] = x
        found.append(CELLS[len(x)].determinant(replaced))
    return np.stack(found)


def _subdomain(mesh: Mesh, element: int) -> str:
    names = [name for name, rows in named_sets(mesh.subdomains).items() if element in rows]
    return f" (subdomain {listed(names)})" if names else ""
