"""Training points drawn from a density."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["Draw"]


class Draw(NamedTuple):
    """Training points with their elements, regions and weights.

    `points` has shape (k, d), the other arrays (k,). Elements are numbered in the mesh of the density. The order is
    along a space-filling curve, so that neighbours in the arrays are near in the mesh.
    """

    points: Floats
    element: NDArray[np.int32]
    region: NDArray[np.int32]
    weights: Floats

    def reordered(self, order: Ints) -> "Draw":
        return Draw(self.points[order], self.element[order], self.region[order], self.weights[order])
