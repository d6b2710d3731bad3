"""Hold the training points of one draw from a density."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["Draw"]


class Draw(NamedTuple):
    """Training points (k, d), the elements of the density's mesh they lie in, their regions and weights (k,).

    They come along a space-filling curve: neighbours in the array are neighbours in the mesh.
    """

    points: Floats
    element: NDArray[np.int32]
    region: NDArray[np.int32]
    weights: Floats

    def reordered(self, order: Ints) -> "Draw":
        """These points in that order."""
        return Draw(self.points[order], self.element[order], self.region[order], self.weights[order])
