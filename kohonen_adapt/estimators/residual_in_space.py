"""Residual estimate on tetrahedra, from a flux that is linear in every element.

With ``q = mu grad u - flux`` the indicators are ::

    eta_K^2 = h_K^2 ||div q||_K^2 / mu + 1/2 sum_F h_F ||[q . n]||_F^2 / max(mu).
"""

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, hat_gradients

__all__ = ["outflows", "residual_of_linear_flux"]


def residual_of_linear_flux(mesh: MeshTet, flux: Floats, divergence: Floats, weight: Floats) -> Floats:
    # flux (3, 4, nelements) at the corners; divergence (n, nelements) at n points whose mean square is that over the
    # element
    volume = area(mesh)
    inside = volume ** (5.0 / 3.0) * np.mean(divergence**2, axis=0) / weight
    jump, size = outflows(mesh, flux, volume)
    largest = np.zeros(size.size)
    np.maximum.at(largest, mesh.t2f.ravel(), np.tile(weight, 4))
    jump[:, mesh.f2t[1] < 0] = 0.0
    squared = size**1.5 / 12.0 * (np.sum(jump**2, axis=0) + np.sum(jump, axis=0) ** 2)
    return np.sqrt(inside + 0.5 * np.sum((squared / largest)[mesh.t2f], axis=0))


def outflows(mesh: MeshTet, flux: Floats, volume: Floats) -> tuple[Floats, Floats]:
    # the flux out of both elements at the corners of facets, (3, nfacets) in the order of `mesh.facets`, and the areas
    number_facets(mesh)
    hats, nfacets = hat_gradients(mesh), mesh.facets.shape[1]
    total, size = np.zeros(3 * nfacets), np.empty(nfacets)
    for side, (corners, opposite) in enumerate(zip(TETRAHEDRON.facets, TETRAHEDRON.opposite, strict=True)):
        facet, length = mesh.t2f[side], np.linalg.norm(hats[:, opposite], axis=0)
        size[facet] = 3.0 * volume * length
        for corner in corners:
            out = -np.sum(flux[:, corner] * hats[:, opposite], axis=0) / length
            row = np.argmax(mesh.facets[:, facet] == mesh.t[corner], axis=0)
            total += np.bincount(row * nfacets + facet, out, total.size)
    return total.reshape(3, nfacets), size
