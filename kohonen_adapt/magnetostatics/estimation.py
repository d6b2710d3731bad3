"""Error estimates of the vector potential in the plane."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, FloatsPair, Ints
from kohonen_adapt.estimators import duality_gap, equilibrated, equilibrated_flux, goal_oriented, recovery, residual
from kohonen_adapt.estimators.residual_estimator import HIGHER_SCALES, Facets
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.equations.conditions import ties_of
from kohonen_adapt.magnetostatics.error_by_orders import FROM_BELOW, goal_indicators_by_orders, indicators_by_orders
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.quantities.magnetic_field import MagneticField
from kohonen_adapt.magnetostatics.residuals import dual_residual_by_points, residual_by_points
from kohonen_adapt.magnetostatics.solution import (
    dual_of,
    energy_of,
    richer_solution,
)
from kohonen_adapt.mesh.elements.functions import ON_AXIS
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.measures import gradient, inner_points

__all__ = [
    "RESIDUAL_SCALE",
    "energy_indicators",
    "equal_materials",
    "goal_indicators",
    "indicators_of_order_1",
    "scalar_problem",
]

# Ratio of the unscaled residual estimate to the error, measured by test_magnetostatics.py and benchmark M:
#     cylinder in a disk, rings, 817 to 12 481 nodes                  3.61 - 3.78
#     rectangle in free space, squares / Gmsh, 400 to 9 500 nodes     3.57 - 3.77 / 3.24 - 3.64
#     benchmark M, permeability 1 / 1000, squares, 441 to 25 921      3.58 - 3.78 / 3.56 - 3.59
#     the same after one to three relocations                         3.51 - 3.66
#     balls in space                                                  3.5 - 3.8
RESIDUAL_SCALE = 1.0 / 3.6
# The same around an axis, for a coil with and without an iron core, on squares and on adapted meshes (`benchmarks
# axis`): order 1 3.4 - 4.8, order 2 4.3 - 8.9, order 3 6.6 - 13.9, the largest where the polish stretches elements.
AXIS_SCALES = HIGHER_SCALES | {1: 1.0 / 4.2}


def energy_indicators(problem: Arguments, field: Field) -> Floats:
    if field.elements.arcs:
        smooth = not (field.coefficients.nonlinear_materials or field.elements.shape.curved.any())
        energies, below = partial(energy_of, problem, field), smooth and field.order >= FROM_BELOW[2]
        return indicators_by_orders(field.unknown, field.order, energies, problem.method, below)
    joined = _tied_facets(problem, field)
    if problem.estimator == "residual" and (field.order > 1 or field.axisymmetric):
        return _residual_scale(field) * residual_by_points(field, joined)
    if problem.estimator == "equilibrated":
        return equilibrated_bound(problem, field)
    coefficients, is_linear = field.coefficients, not field.coefficients.nonlinear_materials and not field.axisymmetric
    weight, flux = (
        (coefficients.reluctivity, coefficients.flux)
        if is_linear
        else scalar_problem(field, problem.estimator, at_corners=field.axisymmetric)
    )
    if coefficients.varying_magnets and not field.axisymmetric:  # around an axis the flux has H at the corners
        flux = flux.reshape(2, -1, field.mesh.nelements) + flux_variation(field)
    source, joins = field.symmetry.source(field.current_density), any(m.turns for m in problem.materials.values())
    region = equal_materials(field, problem.materials) if joins or not is_linear else None
    return indicators_of_order_1(problem.estimator, (field.mesh, field.unknown, weight), source, flux, joined, region)


def indicators_of_order_1(
    estimator: str,
    given: tuple[Mesh, Floats, Floats],
    source: Floats | None,
    flux: Floats,
    joined: Facets | None,
    region: Ints | None,
) -> Floats:
    # Add further estimators of order 1 here, in the plane and in space.
    if estimator == "residual":
        return RESIDUAL_SCALE * residual(*given, source=source, flux=flux, joined=joined)
    return recovery(*given, source=source, flux=flux, region=region)


def _tied_facets(problem: Arguments, field: Field) -> Facets | None:
    return ties_of(field.elements, problem.periodic, problem.antiperiodic).facets if problem.pairs else None


def _residual_scale(field: Field) -> float:
    return (AXIS_SCALES if field.axisymmetric else HIGHER_SCALES)[field.order]


def flux_variation(field: Field) -> Floats:
    # Element means alone jump between elements where the magnet does not. For a Halbach cylinder the residual was 0.6
    # and the recovery 1.6 times the error; with the variation inside elements both are within 11 %.
    x, count = inner_points(field.mesh.p[:, field.mesh.t]).reshape(2, -1), field.mesh.nelements
    coercivity = field.coefficients.coercivity_at(np.tile(np.arange(count), 3), x).reshape(2, 3, count)
    return field.symmetry.flux(2.0 * (coercivity - coercivity.mean(axis=1, keepdims=True)))


def equal_materials(field: MagneticField, materials: Mapping[str, Material]) -> Ints:
    values = list(materials.values())
    return np.array([values.index(material) for material in values])[field.coefficients.material_index]


def equilibrated_bound(problem: Arguments, field: Field) -> Floats:
    coefficients, fixed = field.coefficients, problem.conditions_of(field).fixed
    given = {"source": coefficients.current_density, "flux": coefficients.flux, "fixed": fixed}
    if not coefficients.nonlinear_materials:
        return equilibrated(field.mesh, field.potential, coefficients.reluctivity, **given)
    balanced = equilibrated_flux(field.mesh, field.potential, field.reluctivity, **given)
    energies = [densities.density for densities in (coefficients.densities(), coefficients.coenergy_densities())]
    return duality_gap(field.mesh, field.potential, balanced, *energies, flux=coefficients.flux)


def scalar_problem(field: Any, estimator: str, at_corners: bool) -> FloatsPair:
    """Return the weight and the flux of a scalar problem that a field solves.

    The flux ``weight grad u - flux`` is the turned H in the plane and -B in space. A scalar weight stands for the
    tensor of nonlinear material, differential along the field and secant across. Recovery uses the differential
    coefficient, because the flux is in error along the field where the field changes along itself. The residual uses
    the root of the determinant, because jumps have any direction.
    """
    # Estimate over error on the tube of test_nonlinear.py, iron at 1.9 to 2.0 T: recovery 0.85 - 0.88, residual
    # 0.96 - 1.25 (0.55 - 0.69 with the differential reluctivity).
    dim, at = field.elements.dim, field.at_corners if at_corners else field
    secant, weight = field.permeabilities if dim == 3 else (field.reluctivity, field.differential_reluctivity)
    if estimator == "residual":
        weight = np.sqrt(secant * weight)
    if dim == 2:
        weight = field.symmetry.reluctivity(field.elements.centroids, weight)
    found = -at.flux_density if dim == 3 else field.symmetry.flux(at.field_strength)
    slope = weight * gradient(field.mesh, field.unknown)
    return weight, slope[:, None] - found.reshape(dim, dim + 1, -1) if at_corners else slope - found


def goal_indicators(problem: Arguments, field: Field, goal: Goal) -> Floats:
    if field.elements.arcs:
        higher, energies = richer_solution(problem, field), partial(energy_of, problem, field)
        return goal_indicators_by_orders(
            field, higher, lambda each: dual_of(problem, each, goal.derivative(each)).values, energies
        )
    dual, elements = dual_of(problem, field, goal.derivative(field)), field.elements
    if field.order > 1:
        # Errors from a solve of one order more in every pass gave no better force between two magnets.
        joined = _tied_facets(problem, field)
        product = residual_by_points(field, joined) * dual_residual_by_points(field, dual, joined)
        return _residual_scale(field) * np.sqrt(product)
    at, symmetry = field.at_quadrature, field.symmetry
    current, weight = symmetry.source(field.current_density), scalar_problem(field, "residual", at_corners=False)[0]
    change = symmetry.flux(at.change_of_strength(symmetry.flux_density(at.x, elements.gradient(dual.values))))
    of_field = field.unknown, symmetry.flux(at.field_strength), current
    of_dual = dual.values, change - dual.load, dual.source
    fluxes = [
        weight * gradient(field.mesh, u) - balanced(elements, flux, source) for u, flux, source in (of_field, of_dual)
    ]
    if elements.axis:  # there B decreases like 1 / r within elements
        of_corners = field.at_corners
        strengths = of_corners.field_strength, field.change_at_each(np.eye(3), dual.values, of_corners)
        turned = (symmetry.flux(each).reshape(2, 3, -1) for each in strengths)
        fluxes = [
            mean[:, None] - corners + corners.mean(axis=1, keepdims=True)
            for mean, corners in zip(fluxes, turned, strict=True)
        ]
    # On paired sides and on the open boundary the imbalance of the field is no part of the estimate.
    conditions = problem.conditions_of(field)
    fixed = conditions.fixed_or_tied
    if conditions.open_boundary is not None:
        fixed = fixed | (conditions.open_boundary.matrix.diagonal() > 0.0)
    data = {"source": current, "flux": fluxes[0], "dual_source": dual.source, "dual_flux": fluxes[1], "fixed": fixed}
    return goal_oriented(field.mesh, field.unknown, dual.values, weight, **data)


def balanced(elements: Space, flux: Floats, source: Floats) -> Floats:
    """Return element means of a flux with equal loads, around an axis.

    `flux` is at the quadrature points of elements of order 1, `source` has shape (nelements,). The loads of the means,
    shape (2, nelements), by hat functions equal the loads of the flux by the functions of these elements, so that the
    estimators of order 1 see a balanced problem. Edges from the axis are dual to the gradients of the hat functions at
    their outer ends. In the plane the flux is returned.
    """
    if not elements.axis:
        return flux
    mean, off_axis = elements.plain_mean(flux), np.where(ON_AXIS[elements.kind].T, 0.0, 1.0)
    load = elements.against_gradients(flux) - elements.against_functions(source)
    target = load / elements.volumes + source / 3.0
    missing = off_axis * (target - np.einsum("ck,cik->ik", mean, elements.hats))
    touching = np.flatnonzero(elements.kind)
    corner, off_axis = elements.corners.p[:, elements.corners.t[:, touching]], off_axis[:, touching]
    projection = np.sum((1.0 - off_axis) * corner, axis=1) / np.sum(1.0 - off_axis, axis=0)
    mean[:, touching] += np.einsum("ik,cik->ck", missing[:, touching], corner - projection[:, None])
    return mean
