"""Assembly of element matrices, with eliminated interiors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import SuperLU, splu
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.host import summed

__all__ = [
    "Interiors",
    "Reduced",
    "Subspaces",
    "assembled",
    "elimination",
    "symmetric_factors",
    "without_interiors",
]


@dataclass(frozen=True)
class Interiors:
    """Unknowns inside elements, eliminated from the equations of all others."""

    inner: Ints  # (nelements, i): indices among the free unknowns
    outer: Ints  # (nelements, o): rows of the matrix of the unknowns on the sides, -1 for prescribed ones
    inverse: Floats  # (nelements, i, i): inverse of the matrix of the inner unknowns
    coupling: Floats  # (nelements, i, o): the inverse times the coupling of inner and outer unknowns


class Subspaces(NamedTuple):
    """Subspaces of a space of high order, for a preconditioner."""

    prolongation: csr_array  # (nrows, ncoarse): functions of order 1
    stars: Sequence[Ints]  # rows of the unknowns around each node, above order 2


@dataclass(frozen=True)
class Reduced:
    matrix: csc_array
    interiors: Interiors | None = None
    rows: Ints | None = None  # of the matrix among the free unknowns, None for all
    subspaces: Subspaces | None = None

    @property
    def in_order(self) -> bool:
        """True if the rows are in an order of elimination."""
        return self.rows is not None and self.subspaces is None

    def eliminated(self, right: Floats) -> Floats:
        if self.interiors is None or self.rows is None:
            return right
        inner, outer = self.interiors.inner, self.interiors.outer
        moved = np.einsum("mio,mi->mo", self.interiors.coupling, right[inner])
        count = self.rows.size
        return right[self.rows] - summed(np.where(outer < 0, count, outer), moved, count + 1)[:-1]

    def completed(self, solution: Floats, right: Floats) -> Floats:
        if self.interiors is None or self.rows is None:
            return solution
        inner, outer = self.interiors.inner, self.interiors.outer
        values, outer_values = np.empty_like(right), np.append(solution, 0.0)[outer]
        values[self.rows] = solution
        values[inner] = np.einsum("mij,mj->mi", self.interiors.inverse, right[inner])
        values[inner] -= np.einsum("mio,mo->mi", self.interiors.coupling, outer_values)
        return values


def symmetric_factors(matrix: csc_array, order: str = "MMD_AT_PLUS_A") -> SuperLU:
    # Pivots on the diagonal halve the time of the defaults. Relaxed supernodes and panels of several columns never save
    # time, and relaxed supernodes multiply the time on some meshes.
    return splu(
        matrix,
        permc_spec=order,
        diag_pivot_thresh=0.0,
        relax=1,
        panel_size=1,
        options={"SymmetricMode": True, "Equil": False},
    )


def assembled(unknowns: Ints, products: Floats, index: Ints, nfree: int) -> csc_array:
    """Return a symmetric matrix of the free unknowns.

    `products` has the entries of the upper triangles of the element matrices, by rows, (k (k + 1) / 2, nelements), and
    `index` (nunknowns,) the rows of the matrix, -1 for prescribed unknowns.
    """
    i, j = np.triu_indices(len(unknowns))
    # Diagonal terms are summed before the assembly.
    on_diagonal, upper = np.flatnonzero(i == j), np.flatnonzero(i != j)
    free = np.flatnonzero(index >= 0)
    diagonal = summed(unknowns, products[on_diagonal], index.size)[free]
    rows = index[unknowns]
    start, end = rows[i[upper]], rows[j[upper]]
    inner = (start >= 0) & (end >= 0)
    values, start, end = products[upper][inner], start[inner], end[inner]
    entries = np.concatenate((values, values, diagonal))
    places = np.concatenate((start, end, index[free])), np.concatenate((end, start, index[free]))
    return coo_array((entries, places), shape=(nfree, nfree)).tocsc()


def without_interiors(matrices: Floats, outside: int) -> tuple[Floats, Floats, Floats]:
    """Return element matrices (m, k, k) without all but the first `outside` unknowns.

    With them are returned the inverse of the eliminated block and its product with the coupling.
    """
    inverse = np.asarray(np.linalg.inv(matrices[:, outside:, outside:]), np.float64)
    coupling = inverse @ matrices[:, outside:, :outside]
    return matrices[:, :outside, :outside] - matrices[:, :outside, outside:] @ coupling, inverse, coupling


def elimination(mesh: Mesh) -> Ints:
    """Return the position of every node and side in an order of elimination.

    The order is that of one unknown per node and side of a plane mesh. It serves all orders of the elements, and fills
    factors less than an order of all unknowns.
    """
    parts = np.vstack((mesh.t, mesh.nvertices + mesh.t2f)).T
    row, column = np.broadcast_arrays(parts[:, :, None], parts[:, None])
    values = np.broadcast_to(6.0 * np.eye(6) - 0.9, row.shape)  # positive definite
    graph = coo_array((values.ravel(), (row.ravel(), column.ravel())))
    return np.asarray(symmetric_factors(graph.tocsc()).perm_c, np.int64)
