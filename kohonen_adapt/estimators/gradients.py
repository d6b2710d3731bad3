"""Gradients of P1 functions, element by element."""

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats

__all__ = ["gradient", "hat_gradients"]


def hat_gradients(mesh: MeshTri) -> Floats:
    """Gradients of the three hat functions of every element, constant on it.

    ``grad phi_i = (y_j - y_k, x_k - x_j) / (2 |K|)`` with i, j, k in the order of ``mesh.t`` and the area signed, so
    the orientation of an element does not matter.

    Parameters
    ----------
    mesh
        A triangular mesh without elements of zero area.

    Returns
    -------
    ndarray (2, 3, nelements)
        Per mesh unit. Component, local node, element.
    """
    x, y = mesh.p[:, mesh.t]
    along_x = x[[2, 0, 1]] - x[[1, 2, 0]]
    along_y = y[[1, 2, 0]] - y[[2, 0, 1]]
    twice_area = along_y[0] * along_x[1] - along_y[1] * along_x[0]
    return np.stack((along_y, along_x)) / twice_area


def gradient(mesh: MeshTri, values: ArrayLike, hats: Floats | None = None) -> Floats:
    """Gradient of the P1 function with the given nodal values.

    Parameters
    ----------
    mesh
        A triangular mesh without elements of zero area.
    values : (nnodes,)
        Nodal values.
    hats : (2, 3, nelements), optional
        What :func:`hat_gradients` returns for this mesh, where it is at hand.

    Returns
    -------
    ndarray (2, nelements)
        In units of `values` per mesh unit.
    """
    hats = hat_gradients(mesh) if hats is None else hats
    return np.einsum("ik,cik->ck", np.asarray(values, dtype=float)[mesh.t], hats)
