"""Residual indicators of plane fields and of their duals, from values at points."""

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.estimators.residual_estimator import (
    LATTICE,
    Facets,
    divergences,
    outflow_at_points,
    residual_indicators,
)
from kohonen_adapt.magnetostatics.quantities.field import Dual, Field
from kohonen_adapt.magnetostatics.quantities.point_values import PointField
from kohonen_adapt.mesh.elements.functions import hierarchical
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.measures import area

__all__ = ["dual_residual_by_points", "residual_by_points"]

DIFFERENCE = 1e-4  # step of central differences, relative to the size of an element


def residual_by_points(field: Field, joined: Facets | None) -> Floats:
    """Return residual indicators of ``curl H = J``, unsquared, shape (nelements,).

    H turned by a right angle is a polynomial in every element, one degree below the potential. For nonlinear material
    it is interpolated at the corners, at order 3 and beside curves also at the midsides. `joined` is as in
    `estimators.residual`.
    """
    elements, coefficients, symmetry = field.elements, field.coefficients, field.symmetry
    points = LATTICE if elements.order == 3 or elements.shape.curved.any() else LATTICE[:3]
    at = field.at_each(points.T)
    flux = symmetry.flux(at.field_strength).reshape(2, len(points), -1) / symmetry.extent
    divergence = (
        divergences_by_differences(field) if coefficients.varying_magnets else divergences(flux, elements.shape)
    )
    return _residual(field, at, flux, coefficients.current_density + divergence, joined)


def dual_residual_by_points(field: Field, dual: Dual, joined: Facets | None) -> Floats:
    elements, symmetry = field.elements, field.symmetry
    at = field.at_each(LATTICE.T)
    strength = symmetry.flux(field.change_at_each(LATTICE.T, dual.values, at)).reshape(2, len(LATTICE), -1)
    flux = (strength - on_lattice(elements, dual.load)) / symmetry.extent
    return _residual(field, at, flux, dual.source / symmetry.extent + divergences(flux, elements.shape), joined)


def _residual(field: Field, at: PointField, flux: Floats, load: Floats, joined: Facets | None) -> Floats:
    elements, volume = field.elements, field.symmetry.volume
    shape, size = elements.shape, area(field.mesh)
    secant, differential = at.reluctivities
    weight = np.sqrt(secant * differential).reshape(flux.shape[1], -1).mean(axis=0)
    midpoints = shape.corners.p[:, shape.corners.facets].mean(axis=1)
    circumference = volume(elements.centroids, np.ones(size.size)), volume(midpoints, np.ones(midpoints.shape[1]))
    outflow = outflow_at_points(shape, flux)
    return residual_indicators(shape.corners, size, outflow, load, weight, joined, circumference)


def on_lattice(elements: Space, values: Floats) -> Floats:
    """Return fits to quadrature values on the `LATTICE`, (2, 6, nelements).

    `values` has shape (2, npoints). The fit is of degree 2. Around an axis, where no arm is a factor, it has the degree
    of B, because there the points of order 2 lie on two lines about a corner and do not determine a quadratic
    polynomial.
    """
    degree = elements.order - 1 if elements.axis else 2
    element, weight = elements.element, elements.weights
    functions = hierarchical(elements.barycentric_of_points.T, degree)[0].T
    count = elements.corners.t.shape[1]

    def sums(terms: Floats) -> Floats:
        return np.stack([np.bincount(element, term, count) for term in terms.reshape(-1, element.size)], axis=-1)

    products = sums(np.einsum("ni,nj,n->ijn", functions, functions, weight)).reshape(
        count, *functions.shape[1:], functions.shape[1]
    )
    moments = sums(np.einsum("ni,cn,n->icn", functions, values, weight)).reshape(count, -1, 2)
    fits = np.linalg.solve(products, moments)
    return np.einsum("pi,kic->cpk", hierarchical(LATTICE, degree)[0].T, fits)


def divergences_by_differences(field: Field) -> Floats:
    # From the point values alone, without the curvature of the magnetisation, the estimate of order 3 was 0.55 to 0.65
    # of the error.
    shape, count = field.elements.shape, field.mesh.t.shape[1]
    element, barycentric = np.tile(np.arange(count), 3), np.repeat(LATTICE[3:].T, count, axis=1)
    step, divergence = DIFFERENCE * np.sqrt(area(field.mesh))[element], np.zeros(3 * count)
    for axis, direction in enumerate(shape.hat_gradients(element, barycentric)):
        ends = [field.at_shares(element, barycentric + sign * step * direction).field_strength for sign in (1.0, -1.0)]
        forward, backward = (field.symmetry.flux(end)[axis] / field.symmetry.extent for end in ends)
        divergence += (forward - backward) / (2.0 * step)
    return divergence.reshape(3, count)
