"""Preconditioner of elements of high order in space.

Corrections in the stars of all nodes and by functions of order 1 are added. The number of iterations depends neither on
the order nor on the size of the mesh (J. Schoeberl, J. Melenk, C. Pechstein and S. Zaglmayr, IMA J. Numer. Anal. 28,
2008).
"""

from collections.abc import Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import spotrf, spotri
from scipy.sparse import csr_matrix

from kohonen_adapt.arrays import Floats, Function, Ints
from kohonen_adapt.mesh.host import summed

__all__ = ["added_corrections"]

Singles = NDArray[np.float32]

PADDED = 16  # stars are padded to a multiple of this number of unknowns, to be multiplied together


def added_corrections(matrix: csr_matrix, stars: Sequence[Ints]) -> Function:
    """Return the sum of the corrections of a residual in stars, from their rows."""
    scale = 1.0 / np.sqrt(matrix.diagonal())
    scaled = csr_matrix((matrix.data * np.repeat(scale, np.diff(matrix.indptr)), matrix.indices, matrix.indptr))
    scaled.data *= scale[matrix.indices]
    found = [inverses(scaled, list(group)) for _, group in groupby(sorted(stars, key=len), key=padded_size)]
    every = np.concatenate([rows.ravel() for rows, _ in found])

    def corrected(residual: Floats) -> Floats:
        padded = np.append(scale * residual, 0.0).astype(np.float32)
        parts = [np.matmul(inverse, padded[rows][..., None]).ravel() for rows, inverse in found]
        return scale * summed(every, np.concatenate(parts), padded.size)[:-1]

    return corrected


def padded_size(star: Ints) -> int:
    return -(-star.size // PADDED) * PADDED


def inverses(matrix: csr_matrix, stars: Sequence[Ints]) -> tuple[Ints, Singles]:
    # Return rows (n, size) and inverses (n, size, size) of stars. Pads have the row after the last, and no inverse.
    # Single precision halves time and memory; blocks of a matrix with a unit diagonal have conditions up to 3000.
    count, size = matrix.shape[0], padded_size(stars[-1])
    rows, found = np.full((len(stars), size), count), np.zeros((len(stars), size, size), np.float32)
    place, lengths = np.full(count, -1), np.diff(matrix.indptr)
    for star, padded, inverse in zip(stars, rows, found, strict=True):
        padded[: star.size], place[star] = star, np.arange(star.size)
        length = lengths[star]
        entries = np.repeat(matrix.indptr[star] - np.cumsum(length) + length, length) + np.arange(length.sum())
        row, column = np.repeat(np.arange(star.size), length), place[matrix.indices[entries]]
        inside = column >= 0
        block = np.zeros((star.size, star.size), np.float32)
        block[row[inside], column[inside]] = matrix.data[entries[inside]]
        place[star] = -1
        factor, failed = spotrf(block.T, overwrite_a=True)
        upper = np.eye(star.size, dtype=np.float32) if failed else spotri(factor, overwrite_c=True)[0]
        inverse[: star.size, : star.size] = upper + upper.T
    diagonal = np.arange(size)  # of both triangles
    found[:, diagonal, diagonal] *= 0.5
    return rows, found
