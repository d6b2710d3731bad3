"""Residual indicators of plane fields and of their duals, from values at points."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from kohonen_adapt.arrays import Floats
from kohonen_adapt.estimators.residual_estimator import LATTICE, Facets, residual_on_lattice
from kohonen_adapt.magnetostatics.quantities.field import Dual, Field
from kohonen_adapt.magnetostatics.quantities.point_values import PointField
from kohonen_adapt.mesh.curved import all_points
from kohonen_adapt.mesh.elements.functions import hierarchical
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.measures import area

__all__ = ["STEP", "divergence_by_differences", "dual_residual_by_points", "residual_by_points"]

STEP = 1e-4  # of central differences, relative to the size of an element


def residual_by_points(field: Field, joined: Facets | None) -> Floats:
    """Return residual indicators of ``curl H = J``, unsquared, shape (nelements,).

    H turned by a right angle is a polynomial in every element, one degree below the potential. For nonlinear material
    it is interpolated at the corners, at order 3 and beside curves also at the midsides. `joined` is as in
    `estimators.residual`.
    """
    elements, symmetry = field.elements, field.symmetry
    points = LATTICE if elements.order == 3 or elements.shape.curved.any() else LATTICE[:3]
    at, divergence = field.at_each(points.T), None
    if field.coefficients.varying_magnets:
        # From the point values alone, without the curvature of the magnetisation, the estimate of order 3 was 0.55 to
        # 0.65 of the error.
        count = field.mesh.nelements
        element, barycentric = all_points(np.arange(count), LATTICE[3:])
        directions = elements.shape.hat_gradients(element, barycentric)

        def component(axis: int, step: Floats) -> Floats:
            there = field.at_shares(element, barycentric + step * directions[axis])
            return symmetry.flux(there.field_strength)[axis] / symmetry.extent

        step = STEP * np.sqrt(area(field.mesh))[element]
        divergence = divergence_by_differences(component, step, 2).reshape(3, count)
    return _residual(
        field, at, symmetry.flux(at.field_strength), symmetry.source(field.current_density), joined, divergence
    )


def dual_residual_by_points(field: Field, dual: Dual, joined: Facets | None) -> Floats:
    at = field.at_each(LATTICE.T)
    change = field.symmetry.flux(field.change_at_each(LATTICE.T, dual.values, at))
    return _residual(field, at, change - on_lattice(field.elements, dual.load).reshape(2, -1), dual.source, joined)


def _residual(
    field: Field,
    at: PointField,
    flux: Floats,
    source: Floats,
    joined: Facets | None,
    divergence: Floats | None = None,
) -> Floats:
    mesh, volume, extent, count = field.elements.corners, field.symmetry.volume, field.symmetry.extent, source.size
    midpoints = mesh.p[:, mesh.facets].mean(axis=1)
    around = volume(field.elements.centroids, np.ones(count)), volume(midpoints, np.ones(midpoints.shape[1]))
    weight = np.sqrt(np.multiply(*at.reluctivities)).reshape(-1, count).mean(axis=0)
    on_points = flux.reshape(2, -1, count) / extent
    return residual_on_lattice(field.elements, on_points, source / extent, weight, joined, around, divergence)


def on_lattice(elements: Space, values: Floats) -> Floats:
    """Return fits to quadrature values on the `LATTICE`, (2, 6, nelements).

    `values` has shape (2, npoints). The fit is of degree 2. Around an axis, where no arm is a factor, it has the degree
    of B, because there the points of order 2 lie on two lines about a corner and do not determine a quadratic
    polynomial.
    """
    degree = elements.order - 1 if elements.axis else 2
    element = elements.element
    functions = hierarchical(elements.barycentric_of_points.T, degree)[0].T
    integral = csr_array((elements.weights, (element, np.arange(element.size))))
    products, moments = (
        (integral @ (functions[:, :, None] * factors[:, None]).reshape(element.size, -1)).reshape(
            -1, functions.shape[1], factors.shape[1]
        )
        for factors in (functions, values.T)
    )
    fits = np.linalg.solve(products, moments)
    return np.einsum("pi,kic->cpk", hierarchical(LATTICE, degree)[0].T, fits)


def divergence_by_differences(component: Callable[[int, Floats], Floats], step: Floats, dim: int) -> Floats:
    """Return the divergence of a vector field by central differences.

    `component` returns one component of the field at points that are moved by a step along its axis.
    """
    changes = [component(axis, step) - component(axis, -step) for axis in range(dim)]
    return np.sum(changes, axis=0) / (2.0 * step)
