"""Preconditioner of elements of high order in space.

Corrections in the stars of all nodes and by functions of order 1 are added. The number of iterations depends neither on
the order nor on the size of the mesh (J. Schoeberl, J. Melenk, C. Pechstein and S. Zaglmayr, IMA J. Numer. Anal. 28,
2008).
"""

from collections.abc import Callable, Sequence
from itertools import groupby

import numpy as np
from scipy.sparse import csr_matrix

from kohonen_adapt.arrays import Floats, Ints

__all__ = ["added_corrections"]

PADDED = 16  # stars are padded to a multiple of this number of unknowns, to be multiplied together


def added_corrections(
    matrix: csr_matrix, stars: Sequence[Ints], coarse: Callable[[Floats], Floats]
) -> Callable[[Floats], Floats]:
    """Return the preconditioner of a matrix from the rows of stars.

    `coarse` returns the correction of a residual by functions of order 1.
    """
    found = [inverses(matrix, list(group)) for _, group in groupby(sorted(stars, key=len), key=padded_size)]
    every = np.concatenate([rows.ravel() for rows, _ in found])

    def corrected(residual: Floats) -> Floats:
        padded = np.append(residual, 0.0)
        parts = [np.matmul(inverse, padded[rows][..., None]).ravel() for rows, inverse in found]
        return coarse(residual) + np.bincount(every, np.concatenate(parts), padded.size)[:-1]

    return corrected


def padded_size(star: Ints) -> int:
    return -(-star.size // PADDED) * PADDED


def inverses(matrix: csr_matrix, stars: Sequence[Ints]) -> tuple[Ints, Floats]:
    # Return rows (n, size) and inverses (n, size, size) of stars. Pads have the row after the last.
    count, size = matrix.shape[0], padded_size(stars[-1])
    rows, blocks = np.full((len(stars), size), count), np.zeros((len(stars), size, size))
    place = np.full(count, -1)
    for star, padded, block in zip(stars, rows, blocks, strict=True):
        padded[: star.size], place[star] = star, np.arange(star.size)
        own = matrix[star]
        row, column = np.repeat(np.arange(star.size), np.diff(own.indptr)), place[own.indices]
        block[row[column >= 0], column[column >= 0]] = own.data[column >= 0]
        place[star] = -1
        pads = np.arange(star.size, size)
        block[pads, pads] = 1.0
    inverse = np.asarray(np.linalg.inv(blocks), dtype=np.float64)
    return rows, 0.5 * (inverse + inverse.swapaxes(1, 2))
