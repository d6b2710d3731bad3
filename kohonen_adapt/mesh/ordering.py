"""Order points along a space-filling curve: neighbours in an array are then neighbours in the plane."""

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats
from kohonen_adapt.kernels.ordering import hilbert_keys

__all__ = ["along_curve"]


MARGIN = 0.0173  # of the extent of a mesh


def along_curve(points: Floats) -> NDArray[np.int64]:
    """The order of the rows of (k, 2) along a space-filling curve, (k,).

    The square that the curve fills is a little larger than need be, so that the lines that halve it again and again
    miss the nodes of regular meshes: rounding must not decide on which side of them a node lies.
    """
    keys = np.empty(len(points), dtype=np.int64)
    # column by column, which is many times faster
    low, high = (np.array([bound(points[:, k]) for k in range(2)]) for bound in (np.min, np.max))
    size = max(np.max(high - low), np.finfo(float).tiny)
    hilbert_keys(points, low - MARGIN * size, (1.0 + 3.0 * MARGIN) * size, keys)
    return np.argsort(keys, kind="stable")
