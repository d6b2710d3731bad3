"""Records and constants that kernels on triangles and on tetrahedra share.

Shapes are given by n nodes, m elements, t training points and d dimensions. Arrays without a type are float64. Records
of several arrays replace single arrays because every array argument costs numba as much time as some lines of code.
"""

from typing import Any, NamedTuple

import numpy as np

from kohonen_adapt.arrays import Array
from kohonen_adapt.kernels.numba.compilation import record

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

    node_stamp: Array  # (n,) int64
    element_stamp: Array  # (m,) int64
    counter: Array  # (1,) int64
    queue: Array  # (n + m + 1,) int32
    frontier: Array  # (m,) int32: elements that the flood may enter
    reach: Array  # (m,): squared distance from the point to the entry edge
    crossed: Array  # (CROSSINGS + 3, 2) int32: edges to be crossed, as element and opposite corner

    @classmethod
    def of(cls, nodes: int, elements: int) -> "SearchScratch":
        return cls(
            np.zeros(nodes, np.int64),
            np.zeros(elements, np.int64),
            np.zeros(1, np.int64),
            np.empty(nodes + elements + 1, np.int32),
            np.empty(elements, np.int32),
            np.empty(elements),
            np.empty((CROSSINGS + 3, 2), np.int32),
        )


@record
class Metric(NamedTuple):
    """Directions and ratios of edges at the nodes.

    The quality of an element in the metric is that of the element after the linear map to the metric's round shape. A
    `relief` of 1 stands for Euclidean quality alone.
    """

    shape: Array  # (n, 3) or (n, 6): tensors of determinant 1 as xx, xy, yy, or xx, xy, xz, yy, yz, zz; in space
    # (0, 6) if all are round
    relief: float  # Euclidean quality may be below the floor by this factor, if quality in the metric is above


@record
class KernelMesh(NamedTuple):
    """Mesh of triangles or tetrahedra, with the constraints on its nodes."""

    position: Array  # (n, d)
    elements: Any  # Elements, or Tetrahedra
    star: Any
    constraints: Any


@record
class Lesson(NamedTuple):
    points: Array  # (t, d)
    region: Array  # (t,) int32
    weights: Array  # (t,)
    winners: Array  # (t,) int32
    strength: Array  # (radius + 1,): neighbourhood function, from ring 0 to the radius


@record
class Pool(NamedTuple):
    """Used and free rows of the arrays of nodes and elements.

    Rows of free elements have node -1.
    """

    anchor: Array  # (n,) int32: an element at each node, -1 for a free row
    free_nodes: Array  # (n,) int32: a stack
    free_elements: Array  # (m,) int32: a stack
    height: Array  # (2,) int64: of both stacks


@record
class Modes(NamedTuple):
    """Coefficients of functions of order 2 or 3, except the values at the nodes.

    Every side of a triangle has coefficients in both its elements, for the functions of `Reference`. The odd function
    of a side runs counter-clockwise around the element, so the coefficients in both elements have opposite signs.
    Every edge of a tetrahedron has its coefficient in all of its elements, in the order of `EDGES`.
    """

    side: Array  # (m, 3, order - 1): coefficients of the side opposite to corner k: even, at order 3 also odd, or
    # (m, 6, 1): coefficients of the edges of tetrahedra
    bubble: Array  # (m,): coefficients of the bubbles at order 3
    dirichlet: Array  # (m, 3) bool: Dirichlet values on the side, or (m, 6) on the edge

    def rows(self, rows: Array) -> "Modes":
        return Modes(self.side[rows], self.bubble[rows], self.dirichlet[rows])
