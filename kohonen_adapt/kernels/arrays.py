"""Records and constants that kernels on triangles and on tetrahedra share.

Shapes are given by n nodes, m elements, t training points and d dimensions. Records of several arrays replace single
arrays because every array argument costs numba as much time as some lines of code.
"""

from typing import Any, NamedTuple

from kohonen_adapt.arrays import Array
from kohonen_adapt.kernels.numba.array_types import B2, I1, I2, L1, R1, R2, R3
from kohonen_adapt.kernels.numba.compilation import record, zeros

UNGUARDED = -2.0  # minimum quality that every triangle exceeds, even an inverted triangle
NEAR_AXIS = 1e-6  # of the largest x of an element: corners with a smaller x are on the axis
MOVED, BY_QUALITY, BY_REACH = 0, 1, 2  # results of a move, and the causes of a refusal
HALVINGS = 3  # maximum number of halvings of a rejected step
CROSSINGS = 32  # maximum number of edges crossed by the check of a circle, otherwise the ordered check is used


@record
class SearchScratch(NamedTuple):
    """Scratch of one thread for search and training.

    Stamps are compared with a counter that only increases.
    """

    node_stamp: L1  # (n,)
    element_stamp: L1  # (m,)
    counter: L1  # (1,)
    queue: I1  # (n + m + 1,)
    frontier: I1  # (m,): elements that the flood may enter
    reach: R1  # (m,): squared distance from the point to the entry edge
    crossed: I2  # (CROSSINGS + 3, 2): edges to be crossed, as element and opposite corner

    @classmethod
    def of(cls, nodes: int, elements: int) -> "SearchScratch":
        return zeros(cls, nodes, elements, 1, nodes + elements + 1, elements, elements, (CROSSINGS + 3, 2))


@record
class Metric(NamedTuple):
    """Directions and ratios of edges at the nodes.

    The quality of an element in the metric is that of the element after the linear map to the metric's round shape. A
    `relief` of 1 stands for Euclidean quality alone.
    """

    shape: R2  # (n, 3) or (n, 6): tensors of determinant 1 as xx, xy, yy, or xx, xy, xz, yy, yz, zz; in space
    # (0, 6) if all are round
    relief: float  # Euclidean quality may be below the floor by this factor, if quality in the metric is above


@record
class KernelMesh(NamedTuple):
    """Mesh of triangles or tetrahedra, with the constraints on its nodes."""

    position: R2  # (n, d)
    elements: Any  # Elements, or Tetrahedra
    star: Any
    constraints: Any


@record
class Lesson(NamedTuple):
    points: R2  # (t, d)
    region: I1  # (t,)
    weights: R1  # (t,)
    winners: I1  # (t,)
    strength: R1  # (radius + 1,): neighbourhood function, from ring 0 to the radius


@record
class Pool(NamedTuple):
    """Used and free rows of the arrays of nodes and elements.

    Rows of free elements have node -1.
    """

    anchor: I1  # (n,): an element at each node, -1 for a free row
    free_nodes: I1  # (n,): a stack
    free_elements: I1  # (m,): a stack
    height: L1  # (2,): of both stacks


@record
class Modes(NamedTuple):
    """Coefficients of functions of order 2 or 3, except the values at the nodes.

    Every side of a triangle has coefficients in both its elements, for the functions of `Reference`. The odd function
    of a side runs counter-clockwise around the element, so the coefficients in both elements have opposite signs.
    Every edge of a tetrahedron has its coefficient in all of its elements, in the order of `EDGES`.
    """

    side: R3  # (m, 3, order - 1): coefficients of the side opposite to corner k: even, at order 3 also odd, or
    # (m, 6, 1): coefficients of the edges of tetrahedra
    bubble: R1  # (m,): coefficients of the bubbles at order 3
    dirichlet: B2  # (m, 3): Dirichlet values on the side, or (m, 6) on the edge

    def rows(self, rows: Array) -> "Modes":
        return Modes(self.side[rows], self.bubble[rows], self.dirichlet[rows])
