"""Solution of Poisson's equation on the graph of clusters.

The equation is solved directly or, if clusters are many, by conjugate gradients, which take a third of the time at
60 000 clusters. The method is written out here, because the last bits of dot products in scipy's conjugate gradients
depend on the number of threads, and so would meshes.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from kohonen_adapt.arrays import Floats, Function

__all__ = ["potential"]

LEAKAGE = 1e-9  # leakage, relative to the conductance around a cluster
DIRECT = 12_000  # number of clusters above which the equation is solved by conjugate gradients
ERROR = 1e-5  # tolerance relative to the inflow, which far fewer training points determine
MOST = 300  # maximum number of iterations; 40 are usually enough
GROUP = 16  # number of clusters in a row along the curve that are one unknown of the coarse equation
DAMPING = 2 / 3  # damping of Jacobi's method


def potential(links: csr_array, inflow: Floats) -> Floats:
    """Return the potential of the flow between clusters, shape (c,).

    The potential solves Poisson's equation with conductances `links` and the inflow of every cluster.
    """
    total = links.sum(axis=0)
    total[total == 0.0] = 1.0
    # the potential is determined except for a constant, which a small leakage fixes
    matrix = csr_array(diags_array(total * (1.0 + LEAKAGE)) - links)
    height = by_conjugate_gradients(matrix, inflow) if len(inflow) > DIRECT else None
    return directly(matrix)(inflow) if height is None else height


def directly(matrix: csr_array) -> Function:
    columns, options = csc_array(matrix), {"SymmetricMode": True}
    return splu(columns, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve


def by_conjugate_gradients(matrix: csr_array, inflow: Floats) -> Floats | None:
    height, residual = np.zeros_like(inflow), inflow.copy()
    improve, enough = two_levels(matrix), ERROR**2 * np.sum(inflow**2)
    direction, before = np.zeros_like(inflow), np.inf
    for _ in range(MOST):
        if np.sum(residual**2) <= enough:
            return height
        better = improve(residual)
        slope = np.sum(residual * better)
        direction = better + (slope / before) * direction
        before = slope
        along = matrix @ direction
        step = slope / np.sum(direction * along)
        height += step * direction
        residual -= step * along
    return None


def two_levels(matrix: csr_array) -> Function:
    """Return a function that approximates the inverse of a matrix.

    The function makes a step of Jacobi's method, solves the equation of groups of clusters, and makes a second step.
    """
    count = matrix.shape[0]
    spread = csr_array((np.ones(count), (np.arange(count), np.arange(count) // GROUP)))
    gather = csr_array(spread.T)
    coarse, jacobi = directly(csr_array(gather @ matrix @ spread)), DAMPING / matrix.diagonal()

    def improve(residual: Floats) -> Floats:
        better = jacobi * residual
        better += spread @ coarse(gather @ (residual - matrix @ better))
        return better + jacobi * (residual - matrix @ better)

    return improve
