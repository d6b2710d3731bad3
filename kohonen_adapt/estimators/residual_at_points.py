"""Estimate errors of order 2 and 3 by the residual of a flux, which is known at points of the elements."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.isoparametric import Isoparametric
from kohonen_adapt.mesh.measures import area, hat_gradients, signed_area
from kohonen_adapt.mesh.polynomials import facet_products

__all__ = ["HIGHER_SCALES", "LATTICE", "Facets", "divergences", "residual_at_points"]

# What the indicators are multiplied by, so that the root of their sum of squares is near the error. Of order 2 smooth
# fields on squares and random meshes have 5.9 - 6.4 times the error by the bare residual, a rectangle magnet 6.0 - 6.1,
# corners of iron 6.0 - 6.2 (test_quadratic.py). With 1 / 6.1 all of them come within 5 %. Of order 3: smooth fields 8.5
# - 10.0, a rectangle magnet 9.6, adapted 10.1 (test_cubic.py); with 1 / 9.7 within 12 %. A round magnet on curved
# elements: of order 2 5.9 - 6.0, of order 3 10.2 - 10.6 (`benchmarks curves`).
HIGHER_SCALES = {2: 1.0 / 6.1, 3: 1.0 / 9.7}

ENDS, OPPOSITE = TRIANGLE.facets, list(TRIANGLE.opposite)  # scikit-fem's sides of a triangle

# Corners and middles of sides by barycentric coordinates.
LATTICE = np.vstack((np.eye(3), [np.eye(3)[list(ends)].mean(axis=0) for ends in ENDS]))

Facets = tuple[Ints, Ints, Floats]  # facets that are one, and the sign between them


def residual_at_points(
    shape: Isoparametric,
    size: Floats,
    flux: Floats,
    load: Floats,
    weight: Floats,
    around: tuple[Floats, Floats],
    joined: Facets | None = None,
) -> Floats:
    """``eta_K^2 = h_K^2 ||source + div q||_K^2 / nu_K + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu)``, unsquared,
    (nelements,).

    Parameters
    ----------
    shape, size : (nelements,)
        The elements and their areas.
    flux : (2, 3, nelements) or (2, 6, nelements)
        ``q = nu grad u - flux``, a polynomial in every element, by its values at the corners, and of degree 2 in the
        middles of the sides: the `LATTICE`.
    load : (n, nelements)
        ``source + div q``, of which the mean square over the n points is that over the element.
    weight : (nelements,)
        nu.
    around : (nelements,), (nfacets,)
        What elements and facets are integrated over beside their own area and length: 1, or the way around an axis.
    joined
        As of `residual`.
    """
    elements, facets = around
    squared = np.mean(load**2, axis=0)
    return np.sqrt(size**2 * elements * squared / weight + _jumps(shape, flux, weight, joined, facets))


def divergences(flux: Floats, shape: Isoparametric) -> Floats:
    """Divergence of a vector (2, points, nelements) known on the `LATTICE`: in each element, or in the middles of its
    sides, which tell the mean of a squared linear function.
    """
    hats = hat_gradients(shape.corners)
    if flux.shape[1] == 3:
        return np.einsum("cik,cik->k", flux, hats)[None]
    slopes, rows = np.stack([_slopes(share) for share in LATTICE[3:]]), np.flatnonzero(shape.curved)
    found = np.einsum("cpk,spi,cik->sk", flux, slopes, hats, optimize=True)
    for divergence, share, slope in zip(found, LATTICE[3:], slopes, strict=True):
        bent = shape.hats(rows, np.repeat(share[:, None], rows.size, axis=1))
        divergence[rows] = np.einsum("cpk,pi,cik->k", flux[:, :, rows], slope, bent, optimize=True)
    return found


def _slopes(share: Floats) -> Floats:
    """Derivatives of the functions of order 2 on the `LATTICE` by barycentric coordinates, (6, 3)."""
    at_middles = [4.0 * (share[a] * np.eye(3)[b] + share[b] * np.eye(3)[a]) for a, b in ENDS]
    return np.vstack((np.diag(4.0 * share - 1.0), at_middles))


def _jumps(shape: Isoparametric, flux: Floats, weight: Floats, joined: Facets | None, around: Floats) -> Floats:
    """The facet part: a jump that is a polynomial on a facet, from its values at both ends and in the middle.

    Around an axis that is integrated over the way around it of every facet, (nfacets,).
    """
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
        along[facet] = first ^ (side == 2) ^ clockwise  # runs counter-clockwise in the only element of an outer facet
    jump, turned = np.where(sides == 2, outflow, 0.0), [1, 0, 2][: degree + 1]
    if joined is not None:
        one, other, sign = joined
        same = along[one] != along[other]  # partners run against one another
        beyond = np.where(same, outflow[:, other], outflow[turned][:, other])
        jump[:, one] = outflow[:, one] + sign * beyond
        jump[:, other] = sign * np.where(same, jump[:, one], jump[turned][:, one])
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    squared = np.einsum("if,ij,jf->f", jump, facet_products(degree), jump)
    return 0.5 * np.sum((around * squared / largest)[mesh.t2f], axis=0)


def outward(shape: Isoparametric) -> Floats:
    """The tangents of sides turned outwards, at both ends and in the middle, (3 sides, 3 points, 2, nelements).

    An integral over a side is one from 0 to 1 over what has these as factors: they are as long as a straight side.
    """
    mesh = shape.corners
    straight = -2.0 * (area(mesh) * hat_gradients(mesh))[:, OPPOSITE].swapaxes(0, 1)
    (along, up), sense = shape.bent[:, OPPOSITE], np.sign(signed_area(mesh)) * [[1.0], [1.0], [-1.0]]
    bow = 4.0 * np.stack((sense * up, -sense * along), axis=1)
    return np.stack((straight + bow, straight - bow, straight), axis=1)
