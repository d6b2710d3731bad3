"""Residual error indicators of quadratic elements."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.quadratic import Quadratic, repeated
from kohonen_adapt.magnetostatics.equations.symmetry import PLANAR
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, hat_gradients, signed_area

__all__ = ["quadratic_residual"]

# scikit-fem's sides of a triangle join these local nodes, and are opposite to these.
ENDS, OPPOSITE = [(0, 1), (1, 2), (0, 2)], [2, 0, 1]


def quadratic_residual(problem: Quadratic, values: Floats, joined: tuple[Ints, Ints, Floats] | None) -> Floats:
    """``eta_K^2 = h_K^2 ||J + div q||_K^2 / nu_K + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu)``, unsquared, (nelements,).

    q is ``nu grad u - flux``, the field strength turned by a right angle: linear in every element, for nonlinear
    material by its values at the corners. Symbols and `joined` as of `estimators.residual`.
    """
    mesh, given = problem.mesh, problem.given
    number_facets(mesh)
    size, hats = area(mesh), hat_gradients(mesh)
    density = corner_flux_density(mesh, values)
    everywhere = repeated(given, 3)
    flux = PLANAR.flux(everywhere.field_strength(density.reshape(2, -1))).reshape(2, -1, 3)
    pair = everywhere.reluctivities(density.reshape(2, -1))
    weight = np.sqrt(pair[0] * pair[1]).reshape(-1, 3).mean(axis=1)
    load = size**2 * (given.current_density + np.einsum("cki,cik->k", flux, hats)) ** 2 / weight
    return np.sqrt(load + _jumps(mesh, flux, weight, size * hats, joined))


def corner_flux_density(mesh: MeshTri, values: Floats) -> Floats:
    """B at the corners of every element, from inside it, (2, nelements, 3)."""
    hats, nodes = hat_gradients(mesh), mesh.p.shape[1]
    node, middle = values[mesh.t], values[nodes + mesh.t2f]
    at = []
    for corner in range(3):
        slope = np.einsum("ik,cik->ck", -node, hats) + 4.0 * node[corner] * hats[:, corner]
        for side, ends in enumerate(ENDS):
            if corner in ends:
                other = ends[0] if ends[1] == corner else ends[1]
                slope += 4.0 * middle[side] * hats[:, other]
        at.append(PLANAR.flux_density(mesh, slope))
    return np.stack(at, axis=-1)


def _jumps(
    mesh: MeshTri,
    flux: Floats,
    weight: Floats,
    scaled_hats: Floats,
    joined: tuple[Ints, Ints, Floats] | None,
) -> Floats:
    """The facet part: a jump that is linear on a facet, from its values at the two ends, times the facet's length."""
    nfacets = mesh.facets.shape[1]
    outflow, largest = np.zeros((2, nfacets)), np.zeros(nfacets)
    sides, along, clockwise = np.zeros(nfacets, dtype=int), np.zeros(nfacets, dtype=bool), signed_area(mesh) < 0.0
    for side, ends in enumerate(ENDS):
        facet = mesh.t2f[side]
        first = mesh.t[ends[0]] == mesh.facets[0, facet]
        normal = -2.0 * scaled_hats[:, OPPOSITE[side]]
        at = [np.einsum("ck,ck->k", flux[:, :, end], normal) for end in ends]
        np.add.at(outflow[0], facet, np.where(first, at[0], at[1]))
        np.add.at(outflow[1], facet, np.where(first, at[1], at[0]))
        np.maximum.at(largest, facet, weight)
        np.add.at(sides, facet, 1)
        along[facet] = first ^ (side == 2) ^ clockwise  # runs counter-clockwise in the only element of an outer facet
    jump = np.where(sides == 2, outflow, 0.0)
    if joined is not None:
        one, other, sign = joined
        same = along[one] != along[other]  # partners run against one another
        beyond = np.where(same, outflow[:, other], outflow[::-1, other])
        jump[:, one] = outflow[:, one] + sign * beyond
        jump[:, other] = sign * np.where(same, jump[:, one], jump[::-1, one])
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    squared = (jump[0] ** 2 + jump[0] * jump[1] + jump[1] ** 2) / 3.0
    return 0.5 * np.sum((squared / largest)[mesh.t2f], axis=0)
