"""Large systems: conjugate gradients, preconditioned by algebraic multigrid, where pyamg is installed."""

from importlib.util import find_spec

import numpy as np
from scipy.sparse import csc_array, csr_matrix

from kohonen_adapt.arrays import Floats

__all__ = ["LARGE", "by_multigrid"]

# Unknowns beyond which it is used. Measured on square grids (`benchmarks large`), direct solver against multigrid: at
# 101 761 unknowns 0.4 - 0.9 s against 1.1 - 3.1 s, at 408 321 unknowns 3.9 - 10.1 s against 3.7 - 5.1 s,
# at 808 201 unknowns 28 s against 7 s.
LARGE = 300_000
TOLERANCE = 1e-10  # of the residual, relative to the right-hand side
MOST_ITERATIONS = 200  # 20 to 30 are what it takes


def by_multigrid(matrix: csc_array, right: Floats) -> Floats | None:
    """Solution of a symmetric and positive definite system; None if it is not large or pyamg missing, or fails."""
    if right.size <= LARGE or find_spec("pyamg") is None or not np.isfinite(matrix.data).all():
        return None
    import pyamg

    # Rows of a symmetric matrix are its columns; pyamg wants indices of 32 bits.
    indices, starts = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
    whole = csr_matrix((matrix.data, indices, starts), shape=matrix.shape)
    # Interpolation of least energy has no random numbers, and takes a fifth of the time of the default. Without a bound
    # for what counts as coupled, elements of order 2, 20 times longer than high, take ten times as many
    # iterations.
    coupled = ("symmetric", {"theta": 0.1})
    levels = pyamg.smoothed_aggregation_solver(whole, symmetry="symmetric", strength=coupled, smooth=("energy", {}))
    solution = levels.solve(right, tol=TOLERANCE, maxiter=MOST_ITERATIONS, accel="cg")
    left = np.linalg.norm(right - whole @ solution)
    return solution if left <= 10.0 * TOLERANCE * np.linalg.norm(right) else None
