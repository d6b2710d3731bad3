"""Record of the nodes that recycling removed and inserted."""

from dataclasses import dataclass

import numpy as np

from kohonen_adapt.arrays import Ints
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Recycled", "unchanged"]


@dataclass(frozen=True)
class Recycled:
    """Changes of a triangulation by recycling, in one or more steps.

    Attributes
    ----------
    old
        Index of every node before recycling, -1 for a new node, shape (n,).
    start_element
        Element of the triangulation before recycling that is near each node, shape (n,).
    splits, collapses
        Number of edge splits and of edge collapses.
    """

    old: Ints
    start_element: Ints
    splits: int
    collapses: int


def unchanged(mesh: Triangulation | Tetrahedralization) -> Recycled:
    star = mesh.star
    return Recycled(np.arange(mesh.nnodes, dtype=np.int32), star.element[star.start[:-1]], 0, 0)
