"""Solve Poisson's equation on the graph of clusters: directly, and where they are many by conjugate gradients.

Conjugate gradients take a third of the time at 60 000 clusters. scipy's have dot products whose last bits depend on the
number of threads, and so would meshes.
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from kohonen_adapt.arrays import Floats

__all__ = ["potential"]

LEAKAGE = 1e-9  # of the conductance around a cluster
DIRECT = 12_000  # clusters: of more the equation is solved by conjugate gradients
ERROR = 1e-5  # of what flows in, which is known by far fewer training points
MOST = 300  # iterations, where 40 are enough
GROUP = 16  # clusters, one after the other along the curve, that are one unknown of the coarse equation
DAMPING = 2 / 3  # of Jacobi's method


def potential(links: csr_array, inflow: Floats) -> Floats:
    """What drives the flow: the solution of Poisson's equation on the clusters, (c,)."""
    total = links.sum(axis=0)
    total[total == 0.0] = 1.0
    # where nodes can flow the potential is fixed but for a constant; a little leakage fixes that, too
    matrix = csr_array(diags_array(total * (1.0 + LEAKAGE)) - links)
    height = by_conjugate_gradients(matrix, inflow) if len(inflow) > DIRECT else None
    return directly(matrix)(inflow) if height is None else height


def directly(matrix: csr_array) -> Callable[[Floats], Floats]:
    """Solves equations with a symmetric positive definite matrix, which is factorised here."""
    columns, options = csc_array(matrix), {"SymmetricMode": True}
    return splu(columns, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve


def by_conjugate_gradients(matrix: csr_array, inflow: Floats) -> Floats | None:
    """The same solution to within ERROR, with two levels as preconditioner; None where MOST iterations are too few."""
    height, residual = np.zeros_like(inflow), inflow.copy()
    improve, enough = two_levels(matrix), ERROR**2 * np.sum(inflow**2)
    way, before = np.zeros_like(inflow), np.inf
    for _ in range(MOST):
        if np.sum(residual**2) <= enough:
            return height
        better = improve(residual)
        slope = np.sum(residual * better)
        way = better + (slope / before) * way
        before = slope
        along = matrix @ way
        step = slope / np.sum(way * along)
        height += step * way
        residual -= step * along
    return None


def two_levels(matrix: csr_array) -> Callable[[Floats], Floats]:
    """Nearly inverts a matrix: by a step of Jacobi's method, the equation of groups of clusters, and another step."""
    count = matrix.shape[0]
    spread = csr_array((np.ones(count), (np.arange(count), np.arange(count) // GROUP)))
    gather = csr_array(spread.T)
    coarse, jacobi = directly(csr_array(gather @ matrix @ spread)), DAMPING / matrix.diagonal()

    def improve(residual: Floats) -> Floats:
        better = jacobi * residual
        better += spread @ coarse(gather @ (residual - matrix @ better))
        return better + jacobi * (residual - matrix @ better)

    return improve
