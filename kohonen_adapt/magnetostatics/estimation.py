"""Error estimates of the vector potential in the plane."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.estimators import duality_gap, equilibrated, equilibrated_flux, goal_oriented, recovery, residual
from kohonen_adapt.estimators.residual_estimator import HIGHER_SCALES, Facets
from kohonen_adapt.magnetostatics.arguments import Arguments
from kohonen_adapt.magnetostatics.equations.conditions import Conditions, fixed_values, ties_of
from kohonen_adapt.magnetostatics.equations.energy import Scalar, scalar_problem
from kohonen_adapt.magnetostatics.error_by_orders import goal_indicators_by_orders, indicators_by_orders
from kohonen_adapt.magnetostatics.materials.coefficients import coercivity_at
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.field import Dual, Field
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

__all__ = ["RESIDUAL_SCALE", "energy_indicators", "equal_materials", "goal_indicators"]

# Ratio of the unscaled residual estimate to the error, measured by test_magnetostatics.py and benchmark M:
#     cylinder in a disk, rings, 817 to 12 481 nodes                  3.61 - 3.78
#     rectangle in free space, squares / Gmsh, 400 to 9 500 nodes     3.57 - 3.77 / 3.24 - 3.64
#     benchmark M, permeability 1 / 1000, squares, 441 to 25 921      3.58 - 3.78 / 3.56 - 3.59
#     the same after one to three relocations                         3.51 - 3.66
#     balls in space (benchmarks magnets)                             3.5 - 3.8
RESIDUAL_SCALE = 1.0 / 3.6
# The same around an axis, for a coil with and without an iron core, on squares and on adapted meshes (`benchmarks
# axis`): order 1 3.4 - 4.8, order 2 4.3 - 8.9, order 3 6.6 - 13.9, the largest where the polish stretches elements.
AXIS_SCALES = HIGHER_SCALES | {1: 1.0 / 4.2}


def energy_indicators(problem: Arguments, field: Field) -> Floats:
    if field.elements.arcs:
        smooth = not (field.coefficients.nonlinear_materials or field.elements.shape.curved.any())
        energies = partial(energy_of, problem, field)
        return indicators_by_orders(field.unknown, field.order, energies, problem.method, smooth)
    estimator, coefficients = problem.estimator, field.coefficients
    joined = _tied_facets(problem, field)
    if estimator == "residual" and (field.order > 1 or field.axisymmetric):
        return _residual_scale(field) * residual_by_points(field, joined)
    if estimator == "equilibrated":
        return equilibrated_bound(problem, field)
    is_linear = not coefficients.nonlinear_materials and not field.axisymmetric
    scalar = scalar_problem(field.elements, field.symmetry, coefficients) if is_linear else linearised(field, estimator)
    flux = scalar.flux
    if coefficients.varying_magnets and not field.axisymmetric:  # around an axis `linearised` has H at the corners
        flux = flux.reshape(2, -1, field.mesh.t.shape[1]) + flux_variation(field, problem.materials)
    given = field.mesh, field.unknown, scalar.reluctivity
    if estimator == "residual":
        return RESIDUAL_SCALE * residual(*given, source=scalar.source, flux=flux, joined=joined)
    varies = not is_linear or any(material.turns for material in problem.materials.values())
    region = equal_materials(field, problem.materials) if varies else None
    return recovery(*given, source=scalar.source, flux=flux, region=region)


def _tied_facets(problem: Arguments, field: Field) -> Facets | None:
    return ties_of(field.elements, problem.periodic, problem.antiperiodic).facets if problem.pairs else None


def _residual_scale(field: Field) -> float:
    return (AXIS_SCALES if field.axisymmetric else HIGHER_SCALES)[field.order]


def flux_variation(field: Field, materials: Mapping[str, Material]) -> Floats:
    # Element means alone jump between elements where the magnet does not. For a Halbach cylinder the residual was 0.6
    # and the recovery 1.6 times the error; with the variation inside elements both are within 11 %.
    index, x = field.coefficients.material_index, inner_points(field.mesh.p[:, field.mesh.t])
    coercivity = np.stack([coercivity_at(materials, x[:, k], index) for k in range(3)], axis=1)
    return field.symmetry.flux(2.0 * (coercivity - coercivity.mean(axis=1, keepdims=True)))


def equal_materials(field: MagneticField, materials: Mapping[str, Material]) -> Ints:
    values = list(materials.values())
    return np.array([values.index(material) for material in values])[field.coefficients.material_index]


def equilibrated_bound(problem: Arguments, field: Field) -> Floats:
    coefficients, fixed = field.coefficients, fixed_values(field.elements, problem.boundaries)[0]
    given = {"source": coefficients.current_density, "flux": coefficients.flux, "fixed": fixed}
    if not coefficients.nonlinear_materials:
        return equilibrated(field.mesh, field.potential, coefficients.reluctivity, **given)
    balanced = equilibrated_flux(field.mesh, field.potential, field.reluctivity, **given)
    laws = coefficients.law_energy, coefficients.law_coenergy
    return duality_gap(field.mesh, field.potential, balanced, *laws, flux=coefficients.flux)


def linearised(field: Field, estimator: str) -> Scalar:
    """Return a scalar problem with the solution and the field strength of `field`.

    A scalar weight stands for the reluctivity tensor of nonlinear material, differential along B and secant across.
    Recovery uses the differential reluctivity, because H is in error along B where B changes along itself. The residual
    uses the root of the determinant, because jumps have any direction. With either weight nu the flux makes
    ``nu grad u - flux`` the field strength.
    """
    # Estimate over error on the tube of test_nonlinear.py, iron at 1.9 to 2.0 T: recovery 0.85 - 0.88, residual
    # 0.96 - 1.25 (0.55 - 0.69 with the differential reluctivity).
    weight = field.differential_reluctivity
    if estimator == "residual":
        weight = np.sqrt(field.reluctivity * weight)
    reluctivity = field.symmetry.reluctivity(field.elements.centroids, weight)
    slope, strength = gradient(field.mesh, field.unknown), field.field_strength
    if field.axisymmetric:
        slope, strength = slope[:, None], field.at_corners.field_strength.reshape(2, 3, -1)
    flux = reluctivity * slope - field.symmetry.flux(strength.reshape(2, -1)).reshape(strength.shape)
    return Scalar(reluctivity, flux, field.symmetry.source(field.current_density))


def goal_indicators(problem: Arguments, field: Field, goal: Goal) -> Floats:
    if field.elements.arcs:
        higher, energies = richer_solution(problem, field), partial(energy_of, problem, field)
        return goal_indicators_by_orders(
            field, higher, lambda each: dual_of(problem, each, goal.derivative(each)).values, energies
        )
    dual = dual_of(problem, field, goal.derivative(field))
    if field.order > 1:
        # Errors from a solve of one order more in every pass gave no better force between two magnets.
        joined = _tied_facets(problem, field)
        return _residual_scale(field) * np.sqrt(
            residual_by_points(field, joined) * dual_residual_by_points(field, dual, joined)
        )
    pair = _primal_and_dual(problem, field, dual)
    if field.elements.axis:  # there B decreases like 1 / r within elements
        at = field.at_corners
        change = field.change_at_each(np.eye(3), dual.values, at)
        for name, strength in ("flux", at.field_strength), ("dual_flux", change):
            flux = field.symmetry.flux(strength).reshape(2, 3, -1)
            pair[name] = pair[name][:, None] - flux + flux.mean(axis=1, keepdims=True)
    return goal_oriented(field.mesh, **pair)


def _primal_and_dual(problem: Arguments, field: Field, of_goal: Dual) -> dict[str, Any]:
    """Return the arguments of `goal_oriented` for a field and its dual.

    Both solve ``-div(nu grad u - flux) = source``. For nonlinear material nu is the root of the determinant of the
    tensor of the linearised problem, and the fluxes make ``nu grad u - flux`` the field strength and, of the dual, its
    change.
    """
    dual, source, load = of_goal
    elements, symmetry, u, at = field.elements, field.symmetry, field.unknown, field.at_quadrature
    weight = np.sqrt(field.reluctivity * field.differential_reluctivity)
    current = symmetry.source(field.current_density)
    nu = symmetry.reluctivity(elements.centroids, weight)
    change = symmetry.flux(at.change_of_strength(symmetry.flux_density(at.x, elements.gradient(dual))))
    strength, change = balanced(elements, symmetry.flux(at.field_strength), current), balanced(elements, change, source)
    return {
        "potential": u,
        "dual": dual,
        "reluctivity": nu,
        "source": current,
        "flux": nu * gradient(field.mesh, u) - strength,
        "dual_source": source,
        "dual_flux": nu * gradient(field.mesh, dual) - change + balanced(elements, load, np.zeros_like(source)),
        "fixed": _fixed_nodes(energy_of(problem, field).conditions),
    }


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


def _fixed_nodes(conditions: Conditions) -> Mask:
    # On paired sides and on the open boundary the imbalance of the field is no part of the estimate.
    fixed = conditions.fixed_or_tied
    open_boundary = conditions.open_boundary
    return fixed if open_boundary is None else fixed | (open_boundary.matrix.diagonal() > 0.0)
