"""Values recovered from constants per element: averages at the nodes, taken within each region, and linear between."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.measures import area, hat_gradients
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["at_corners", "linear_between"]


def at_corners(mesh: MeshTri, values: Floats) -> Floats:
    """Area-weighted averages of values per element (k, nelements) at the corners of the elements, (k, 3, nelements).

    A corner takes the elements around its node that are of its own region (connected, with the same subdomain names),
    so that jumps between materials stay jumps.
    """
    region = Triangulation.of(mesh).region_of_input.astype(np.int64)
    pair = region * mesh.p.shape[1] + mesh.t
    corner = np.unique(pair, return_inverse=True)[1].reshape(pair.shape)
    size = area(mesh)
    weight = np.bincount(corner.ravel(), np.tile(size, 3))
    totals = [np.bincount(corner.ravel(), np.tile(size * component, 3)) for component in values]
    return np.stack([(total / weight)[corner] for total in totals])


def linear_between(mesh: MeshTri, corners: Floats, x: Floats, element: Ints) -> Floats:
    """Values at points x (2, n) of these elements, linear between corner values (k, 3, nelements)."""
    offset = x - mesh.p[:, mesh.t[:, element]].mean(axis=1)
    share = 1.0 / 3.0 + np.einsum("cin,cn->in", hat_gradients(mesh)[:, :, element], offset)
    return np.einsum("kin,in->kn", corners[:, :, element], share)
