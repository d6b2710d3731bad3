"""Residual estimates at order 2 and 3, from fluxes at points of the elements."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.basis import facet_products
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.curved import Isoparametric
from kohonen_adapt.mesh.measures import area, hat_gradients, signed_area

__all__ = ["HIGHER_SCALES", "LATTICE", "Facets", "divergences", "residual_at_points"]

# Factors of the indicators that bring the root of their sum of squares near the error.
# Order 2: the bare residual is 5.9 - 6.4 times the error for smooth fields on squares and random meshes, 6.0 - 6.1 for
# a rectangular magnet and 6.0 - 6.2 at corners of iron (test_quadratic.py). The factor 1 / 6.1 is right within 5 %.
# Order 3: 8.5 - 10.0 for smooth fields, 9.6 for a rectangular magnet, 10.1 for the same, adapted (test_cubic.py). The
# factor 1 / 9.7 is right within 12 %.
# A round magnet on curved elements: 5.9 - 6.0 at order 2, 10.2 - 10.6 at order 3 (`benchmarks curves`).
HIGHER_SCALES = {2: 1.0 / 6.1, 3: 1.0 / 9.7}

ENDS, OPPOSITE = TRIANGLE.facets, list(TRIANGLE.opposite)  # in the order of scikit-fem

# Barycentric coordinates of the corners and the midsides, one row each.
LATTICE = np.vstack((np.eye(3), [np.eye(3)[list(ends)].mean(axis=0) for ends in ENDS]))

Facets = tuple[Ints, Ints, Floats]  # periodic facets, the matching facets, and the factor between their values


def residual_at_points(
    shape: Isoparametric,
    size: Floats,
    flux: Floats,
    load: Floats,
    weight: Floats,
    around: tuple[Floats, Floats],
    joined: Facets | None = None,
) -> Floats:
    """Return unsquared residual indicators, shape (nelements,).

    With ``q = nu grad u - flux`` ::

        eta_K^2 = h_K^2 ||source + div q||_K^2 / nu + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu).

    Parameters
    ----------
    shape, size : (nelements,)
        The elements and their areas.
    flux : (2, 3, nelements) or (2, 6, nelements)
        The flux q, a polynomial in every element, by its values at the corners and, if of degree 2, at the midsides, in
        the order of `LATTICE`.
    load : (n, nelements)
        ``source + div q`` at n points whose mean square equals the mean square over the element.
    weight : (nelements,)
        The reluctivity nu.
    around : (nelements,), (nfacets,)
        Factors of the integrals over elements and facets: 1 in the plane, the circumference ``2 pi r`` around an axis.
    joined
        As in `residual`.
    """
    elements, facets = around
    squared = np.mean(load**2, axis=0)
    return np.sqrt(size**2 * elements * squared / weight + _jumps(shape, flux, weight, joined, facets))


def divergences(flux: Floats, shape: Isoparametric) -> Floats:
    """Return the divergence of a vector field, in each element or at its midsides.

    `flux` contains values on `LATTICE`, shape (2, points, nelements). A linear field, with 3 points, has one value per
    element, (1, nelements); a quadratic field has values at the midsides, (3, nelements), because the mean square there
    is the mean square of a linear function over the element.
    """
    hats = hat_gradients(shape.corners)
    if flux.shape[1] == 3:
        return np.einsum("cik,cik->k", flux, hats)[None]
    slopes, rows = np.stack([_slopes(barycentric) for barycentric in LATTICE[3:]]), np.flatnonzero(shape.curved)
    found = np.einsum("cpk,spi,cik->sk", flux, slopes, hats, optimize=True)
    for divergence, barycentric, slope in zip(found, LATTICE[3:], slopes, strict=True):
        curved_hats = shape.hat_gradients(rows, np.repeat(barycentric[:, None], rows.size, axis=1))
        divergence[rows] = np.einsum("cpk,pi,cik->k", flux[:, :, rows], slope, curved_hats, optimize=True)
    return found


def _slopes(barycentric: Floats) -> Floats:
    at_middles = [4.0 * (barycentric[a] * np.eye(3)[b] + barycentric[b] * np.eye(3)[a]) for a, b in ENDS]
    return np.vstack((np.diag(4.0 * barycentric - 1.0), at_middles))


def _jumps(shape: Isoparametric, flux: Floats, weight: Floats, joined: Facets | None, around: Floats) -> Floats:
    mesh, degree = shape.corners, flux.shape[1] // 3  # 1 or 2
    nfacets, normals = mesh.facets.shape[1], outward(shape)
    outflow, largest = np.zeros((degree + 1, nfacets)), np.zeros(nfacets)
    sides, along, clockwise = np.zeros(nfacets, dtype=int), np.zeros(nfacets, dtype=bool), signed_area(mesh) < 0.0
    for side, ends in enumerate(ENDS):
        facet = mesh.t2f[side]
        first = mesh.t[ends[0]] == mesh.facets[0, facet]
        points = zip((*ends, 3 + side), normals[side], strict=True)
        at = [np.einsum("ck,ck->k", flux[:, point], normal) for point, normal in list(points)[: degree + 1]]
        np.add.at(outflow[0], facet, np.where(first, at[0], at[1]))
        np.add.at(outflow[1], facet, np.where(first, at[1], at[0]))
        if degree == 2:
            np.add.at(outflow[2], facet, at[2])
        np.maximum.at(largest, facet, weight)
        np.add.at(sides, facet, 1)
        along[facet] = first ^ (side == 2) ^ clockwise  # of boundary facets: counter-clockwise
    jump, turned = np.where(sides == 2, outflow, 0.0), [1, 0, 2][: degree + 1]
    if joined is not None:
        one, other, sign = joined
        same = along[one] != along[other]  # True if the matching facets run in opposite directions
        opposite = np.where(same, outflow[:, other], outflow[turned][:, other])
        jump[:, one] = outflow[:, one] + sign * opposite
        jump[:, other] = sign * np.where(same, jump[:, one], jump[turned][:, one])
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    squared = np.einsum("if,ij,jf->f", jump, facet_products(degree), jump)
    return 0.5 * np.sum((around * squared / largest)[mesh.t2f], axis=0)


def outward(shape: Isoparametric) -> Floats:
    """Return outward normals of the sides, shape (3 sides, 3 points, 2, nelements).

    The points are both ends and the midside. Each normal has the length of the tangent for a parameter from 0 to 1, so
    that an integral over the side is the integral of the product with this normal from 0 to 1.
    """
    mesh = shape.corners
    straight = -2.0 * (area(mesh) * hat_gradients(mesh))[:, OPPOSITE].swapaxes(0, 1)
    (along, up), sense = shape.offset[:, OPPOSITE], np.sign(signed_area(mesh)) * [[1.0], [1.0], [-1.0]]
    bow = 4.0 * np.stack((sense * up, -sense * along), axis=1)
    return np.stack((straight + bow, straight - bow, straight), axis=1)
