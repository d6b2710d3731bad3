"""Evaluate the residuals of a magnetic field and of a dual solution, at points of their elements."""

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.estimators.residual_at_points import LATTICE, Facets, divergences, residual_at_points
from kohonen_adapt.magnetostatics.equations.around_axis import AroundAxis
from kohonen_adapt.magnetostatics.equations.higher import Elements
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.local_field import PointField
from kohonen_adapt.magnetostatics.solution import Dual
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.polynomials import functions_at

__all__ = ["dual_residual_by_points", "residual_by_points"]

DIFFERENCE = 1e-4  # of the size of an element: steps of central differences


def residual_by_points(field: Field, joined: Facets | None) -> Floats:
    """The indicators of `residual_at_points` of the field strength turned by a right angle, unsquared, (nelements,).

    That is a polynomial in every element, of a degree less than the potential, for nonlinear material by its values at
    the corners, and of order 3 and beside curves in the middles of the sides. `joined` as of `estimators.residual`.
    """
    elements, given, symmetry = field.elements, field.coefficients, field.symmetry
    points = LATTICE if elements.order == 3 or elements.shape.curved.any() else LATTICE[:3]
    at = field.at_each(points.T)
    flux = symmetry.flux(at.field_strength).reshape(2, len(points), -1) / symmetry.turn
    inside = divergences_by_differences(field) if given.turning else divergences(flux, elements.shape)
    return _residual(field, at, flux, given.current_density + inside, joined)


def dual_residual_by_points(field: Field, dual: Dual, joined: Facets | None) -> Floats:
    """The same of the dual solution of a goal.

    Its field strength is the change of the field's with it, less the load, which is taken for a polynomial in
    every element: of degree 2 is what the arm of a torque times B is of order 2.
    """
    elements, symmetry = field.elements, field.symmetry
    at = field.at_each(LATTICE.T)
    strength = symmetry.flux(field.change_at_each(LATTICE.T, dual.values, at)).reshape(2, len(LATTICE), -1)
    flux = (strength - on_lattice(elements, dual.load)) / symmetry.turn
    return _residual(field, at, flux, dual.source / symmetry.turn + divergences(flux, elements.shape), joined)


def _residual(field: Field, at: PointField, flux: Floats, load: Floats, joined: Facets | None) -> Floats:
    """The indicators of a flux at the points at which the field is, of every element."""
    elements, volume = field.elements, field.symmetry.volume
    shape, size = elements.shape, area(field.mesh)
    secant, differential = at.reluctivities
    weight = np.sqrt(secant * differential).reshape(flux.shape[1], -1).mean(axis=0)
    middle = shape.corners.p[:, shape.corners.facets].mean(axis=1)
    around = volume(elements.middles, np.ones(size.size)), volume(middle, np.ones(middle.shape[1]))
    return residual_at_points(shape, size, flux, load, weight, around, joined)


def on_lattice(elements: Elements, values: Floats) -> Floats:
    """Values on the `LATTICE`, (2, 6, nelements), of the polynomials that are nearest to what is at the quadrature
    points of every element, (2, npoints).

    They are of degree 2. Around an axis, where no arm is a factor, they are of that of B: of order 2 points lie on two
    lines about a corner there, which do not tell a polynomial of degree 2.
    """
    degree = elements.order - 1 if isinstance(elements, AroundAxis) else 2
    element, share, weight = elements.fine_rule
    own, count = functions_at(share.T, degree), elements.corners.t.shape[1]

    def sums(terms: Floats) -> Floats:
        return np.stack([np.bincount(element, term, count) for term in terms.reshape(-1, element.size)], axis=-1)

    products = sums(np.einsum("ni,nj,n->ijn", own, own, weight)).reshape(count, *own.shape[1:], own.shape[1])
    moments = sums(np.einsum("ni,cn,n->icn", own, values, weight)).reshape(count, -1, 2)
    found = np.linalg.solve(products, moments)
    return np.einsum("pi,kic->cpk", functions_at(LATTICE, degree), found)


def divergences_by_differences(field: Field) -> Floats:
    """Divergences in the middles of the sides, (3, nelements), where magnets turn and the flux is no polynomial.

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
