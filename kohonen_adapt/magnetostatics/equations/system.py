"""Solve the linear systems: by factors, and large ones by algebraic multigrid where pyamg is installed."""

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from scipy.sparse import csc_array, csr_matrix
from scipy.sparse.linalg import SuperLU, splu

from kohonen_adapt.arrays import Floats

__all__ = ["IN_SPACE", "Solver", "factorised"]

TOLERANCE = 1e-10  # of the residual by multigrid, relative to the right-hand side


@dataclass(frozen=True)
class Solver:
    """Solver of symmetric and positive definite systems.

    Parameters
    ----------
    large
        Unknowns beyond which multigrid is used. Measured on square grids (`benchmarks large`), direct solver against
        multigrid: at 101 761 unknowns 0.4 - 0.9 s against 1.1 - 3.1 s, at 408 321 unknowns 3.9 - 10.1 s against
        3.7 - 5.1 s, at 808 201 unknowns 28 s against 7 s.
    most_iterations
        Of conjugate gradients; 20 to 30 are what it takes.
    """

    large: int = 300_000
    most_iterations: int = 200

    def solve(self, matrix: csc_array, right: Floats) -> Floats:
        """The solution: of a large system by multigrid, of others, and where that fails, by factors (see there)."""
        solution = self.by_multigrid(matrix, right) if right.size > self.large else None
        return factorised(matrix).solve(right) if solution is None else solution

    def by_multigrid(self, matrix: csc_array, right: Floats) -> Floats | None:
        """The solution by conjugate gradients, preconditioned; None if pyamg is missing, or fails."""
        if find_spec("pyamg") is None or not np.isfinite(matrix.data).all():
            return None
        import pyamg

        # Rows of a symmetric matrix are its columns; pyamg wants indices of 32 bits.
        indices, starts = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
        whole = csr_matrix((matrix.data, indices, starts), shape=matrix.shape)
        # Interpolation of least energy has no random numbers, and takes a fifth of the time of the default. Without a
        # bound for what counts as coupled, elements of order 2, 20 times longer than high, take ten times as many
        # iterations.
        coupled = ("symmetric", {"theta": 0.1})
        levels = pyamg.smoothed_aggregation_solver(whole, symmetry="symmetric", strength=coupled, smooth=("energy", {}))
        solution = levels.solve(right, tol=TOLERANCE, maxiter=self.most_iterations, accel="cg")
        left = np.linalg.norm(right - whole @ solution)
        return solution if left <= 10.0 * TOLERANCE * np.linalg.norm(right) else None


# Factors of tetrahedra fill: on boxes of magnets direct solver against multigrid 0.25 s against 0.18 s at 8379 nodes,
# 17 s against 3.9 s at 43 956 (`benchmarks magnets`).
IN_SPACE = Solver(large=8_000)


def factorised(matrix: csc_array) -> SuperLU:
    """The factors of a symmetric and positive definite matrix; LinAlgError if it is singular."""
    # The pivots may stay on the diagonal: half the time of the defaults. Relaxed supernodes and panels of several
    # columns, other defaults, never pay here, and on some meshes the first multiply the time (`benchmarks round`).
    try:
        return splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            relax=1,
            panel_size=1,
            options={"SymmetricMode": True, "Equil": False},
        )
    except RuntimeError as error:
        raise np.linalg.LinAlgError(
            f"the equations of the potential are singular ({error}); look for extreme permeabilities or elements "
            "that are almost flat."
        ) from error
