"""Estimate the error of a magnetic field by the residual of its field strength, at points of its elements."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.higher import facet_products
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.mesh.cells import TRIANGLE
from kohonen_adapt.mesh.isoparametric import Isoparametric
from kohonen_adapt.mesh.measures import area, hat_gradients, signed_area

__all__ = ["residual_by_points"]

DIFFERENCE = 1e-4  # of the size of an element: steps of central differences

ENDS, OPPOSITE = TRIANGLE.facets, list(TRIANGLE.opposite)  # scikit-fem's sides of a triangle

# Corners and middles of sides by barycentric coordinates.
LATTICE = np.vstack((np.eye(3), [np.eye(3)[list(ends)].mean(axis=0) for ends in ENDS]))

Facets = tuple[Ints, Ints, Floats]  # facets that are one, and the sign between them


def residual_by_points(field: Field, joined: Facets | None) -> Floats:
    """``eta_K^2 = h_K^2 ||J + div q||_K^2 / nu_K + 1/2 sum_F h_F ||[q . n]||_F^2 / max(nu)``, unsquared, (nelements,).

    q is ``nu grad u - flux``, the field strength turned by a right angle: of a degree less than the potential in every
    element, for nonlinear material by its values at the corners, and of order 3 and beside curves in the middles of the
    sides. Symbols and `joined` as of `estimators.residual`.
    """
    elements, given = field.elements, field.coefficients
    shape, size = elements.shape, area(field.mesh)
    points = LATTICE if elements.order == 3 or shape.curved.any() else LATTICE[:3]
    at = field.at_each(points.T)
    symmetry, count = field.symmetry, size.size
    flux = symmetry.flux(at.field_strength).reshape(2, len(points), -1) / symmetry.turn
    secant, differential = at.reluctivities
    weight = np.sqrt(secant * differential).reshape(len(points), -1).mean(axis=0)
    inside = divergences_by_differences(field) if given.turning else divergences(flux, shape)
    squared = np.mean((given.current_density + inside) ** 2, axis=0)
    around = symmetry.volume(elements.middles, np.ones(count))
    middle = shape.corners.p[:, shape.corners.facets].mean(axis=1)
    jumps = _jumps(shape, flux, weight, joined, symmetry.volume(middle, np.ones(middle.shape[1])))
    return np.sqrt(size**2 * around * squared / weight + jumps)


def divergences_by_differences(field: Field) -> Floats:
    """The same in the middles of the sides, (3, nelements), where magnets turn and q is no polynomial.

    From its values at points alone, what the magnets are bent by was missing: 0.55 to 0.65 of the error at order 3.
    """
    shape, count = field.elements.shape, field.mesh.t.shape[1]
    element, share = np.tile(np.arange(count), 3), np.repeat(LATTICE[3:].T, count, axis=1)
    step, found = DIFFERENCE * np.sqrt(area(field.mesh))[element], np.zeros(3 * count)
    for axis, slope in enumerate(shape.hats(element, share)):
        ends = [field.at_shares(element, share + sign * step * slope).field_strength for sign in (1.0, -1.0)]
        ahead, behind = (field.symmetry.flux(end)[axis] / field.symmetry.turn for end in ends)
        found += (ahead - behind) / (2.0 * step)
    return found.reshape(3, count)


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
