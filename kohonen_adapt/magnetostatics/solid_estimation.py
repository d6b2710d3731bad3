"""Error estimates of fields in space, in the energy norm and for goals."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.estimators import goal_oriented
from kohonen_adapt.estimators.hierarchical import Surplus, cubic_functions
from kohonen_adapt.magnetostatics.arguments import ArgumentsInSpace
from kohonen_adapt.magnetostatics.equations.energy import coenergy
from kohonen_adapt.magnetostatics.estimation import (
    RESIDUAL_SCALE,
    equal_materials,
    indicators_of_order_1,
    scalar_problem,
)
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.quantities.point_values import Points
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.residuals import STEP, divergence_by_differences
from kohonen_adapt.mesh.cells import facet_normals, normals
from kohonen_adapt.mesh.elements.rules import tetrahedron_rule
from kohonen_adapt.mesh.host import summed
from kohonen_adapt.mesh.measures import inner_points, magnitude, unit_vectors
from kohonen_adapt.problem.evaluation import Output
from kohonen_adapt.problem.uncertain import Uncertain

__all__ = [
    "HIGHEST_WITH_SURPLUS",
    "are_parallel",
    "at_edges",
    "better_values",
    "dual_in_space",
    "energy_indicators_in_space",
    "goal_indicators_in_space",
    "tangential_jumps",
    "with_surplus",
]

HIGHEST_WITH_SURPLUS = 2  # order up to which cubic functions estimate errors
# At edges of materials cubic functions are two thirds of the error (benchmarks forces-in-space).
AT_EDGES = 1.5
TURNED = 1.0  # least measure of a turn at an edge: twice the square of the sine, of 45 degrees
PARALLEL = 0.99  # least cosine of the angle between potential and dual for a polish by the energy
FINE = 5  # degree of a quadrature in elements near coils
SLIGHT = 1e-4  # relative change of a potential


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EnrichedField(SolidField):
    """Field of order 2 in space with an estimate of its error added."""

    cubic: Floats  # (10, nelements): coefficients of `cubic_functions`
    error_of_energy: float  # relative

    def points_in(self, inside: Mask) -> tuple[Floats, Ints, Floats]:
        # The quadrature of the elements is a part of the error near coils.
        return self.elements.shape.quadrature(np.flatnonzero(inside), tetrahedron_rule(FINE))

    def _reaction(self, x: Floats, element: Ints) -> Floats:
        return super()._reaction(x, element) - VACUUM_PERMEABILITY * self.cubic_slope(x, element)

    def _vectors(self, at: Points, unknown: Floats) -> Floats:
        return super()._vectors(at, unknown) - self.cubic_slope(at.x, at.element)

    def cubic_slope(self, x: Floats, element: Ints) -> Floats:
        _, slopes = cubic_functions(self.elements.barycentric(x, element).T)
        along = np.einsum("in,ian->an", self.cubic[:, element], slopes)
        return np.einsum("an,can->cn", along, self.elements.hats[:, 1:, element])


def energy_indicators_in_space(problem: ArgumentsInSpace, field: SolidField, estimator: str) -> Floats:
    if field.order > 1:
        return scale_at_edges(problem, field) * cubic_error(problem, field)[1]
    weight, flux = scalar_problem(field, estimator, at_corners=varies(field))
    region = equal_materials(field, problem.materials)
    return indicators_of_order_1(estimator, (field.mesh, field.unknown, weight), None, flux, None, region)


def varies(field: SolidField) -> bool:
    return field.drive.function is not None or bool(field.coefficients.varying_magnets)


def flux_and_divergence(field: SolidField) -> FloatsPair:
    # B, (3, 4, nelements), and its divergence, (4, nelements), at the corners. The applied field has no divergence,
    # so that its interpolation error does not count as a source.
    elements, coefficients = field.elements, field.coefficients
    potential, unknown = (elements.gradient_in_each(u, np.eye(4)) for u in (field.drive.potential, field.unknown))
    slope = (np.where(np.tile(field.drive.iron, 4), 0.0, potential) - unknown).reshape(3, 4, -1)
    flux = field.at_corners.flux_density.reshape(slope.shape)
    own = np.where(coefficients.nonlinear, flux, slope / coefficients.reluctivity)
    divergence = np.tile(np.einsum("cik,cik->k", own, elements.hats), (4, 1))
    for magnet in coefficients.varying_magnets:
        x = inner_points(field.mesh.p[:, field.mesh.t[:, magnet.elements]]).reshape(3, -1)
        element = np.tile(magnet.elements, 4)

        def remanence(axis: int, step: Floats, x: Floats = x, element: Ints = element) -> Floats:
            at = coefficients.at_points(element, x + np.eye(3)[:, axis, None] * step)
            return at.coercivity[axis] / at.reluctivity

        found = divergence_by_differences(remanence, STEP * np.cbrt(field.volume[element]), 3).reshape(4, -1)
        mean = found.mean(axis=0)
        divergence[:, magnet.elements] += mean + np.sqrt(5.0) * (found - mean)  # at the corners, linear in elements
    return flux, divergence


def are_parallel(field: SolidField, dual: Floats) -> bool:
    # The linkage of a single coil in linear material has an error proportional to the error of the energy, which the
    # polish decreases.
    elements = field.elements
    reluctivity = field.reluctivity if elements.order == 1 else field.reluctivity[elements.element]
    weight = np.sqrt(elements.gradient_weights / reluctivity)
    one, other = (weight * elements.gradient(each) for each in (field.potential, dual))
    return float(np.sum(one * other)) ** 2 > PARALLEL**2 * float(np.sum(one**2) * np.sum(other**2))


def surplus_of(problem: ArgumentsInSpace, field: SolidField) -> Surplus:
    elements = field.elements
    return Surplus(elements, np.asarray(problem.conditions_of(field).fixed[elements.on_facets()].all(axis=0)))


def cubic_error(problem: ArgumentsInSpace, field: SolidField) -> FloatsPair:
    # The error of a field of order 2 as coefficients of cubic functions, (10, nelements), and its norms, (nelements,).
    # Indicators, outputs and goals have the same.
    if "cubic" not in field.kept:
        surplus, hats = surplus_of(problem, field), field.elements.hats[:, 1:]
        secant, differential = field.permeabilities
        slope = np.einsum("ck,cak->ak", unit_vectors(field.field_strength + field.coefficients.coercivity), hats)
        metric = secant * np.einsum("cak,cbk->abk", hats, hats)
        metric += (differential - secant) * slope[:, None] * slope
        cubic, squares = surplus.solve(metric, surplus.residual(*flux_and_divergence(field)))
        field.kept["cubic"] = cubic, np.sqrt(np.maximum(squares, 0.0))
    return field.kept["cubic"]


def scale_at_edges(problem: ArgumentsInSpace, field: SolidField) -> Floats:
    return np.where(at_edges(field.elements.corners, equal_materials(field, problem.materials)), AT_EDGES, 1.0)


def dual_in_space(problem: ArgumentsInSpace, field: SolidField, goal: Goal) -> FloatsPair:
    """Return the dual of a goal and the load at the columns of gradients.

    Both are kept for the functional.
    """
    if field.kept.get("goal") is not goal:
        elements, (_, load) = field.elements, goal.derivative(field)
        if field.order == 1:
            load = elements.mean(load) if load.shape == elements.points.shape else load
        elif load.shape != elements.points.shape:
            load = load[:, elements.element]
        field.kept.update(goal=goal, dual=(_dual(problem, field, load), load))
    return field.kept["dual"]


def goal_indicators_in_space(problem: ArgumentsInSpace, field: SolidField, goal: Goal) -> Floats:
    elements, (dual, load) = field.elements, dual_in_space(problem, field, goal)
    if field.order == 1:
        weight, flux = scalar_problem(field, "residual", at_corners=varies(field))
        change = elements.mean(field.change_of_flux_density(elements.slope_of_corners(dual)))
        dual_flux, region = weight * elements.gradient(dual) - change + load, equal_materials(field, problem.materials)
        return goal_oriented(field.mesh, field.unknown, dual, weight, flux=flux, dual_flux=dual_flux, region=region)
    # The squares are the magnitudes of the residual of the dual, weighted by the error of the field.
    flux = load - field.change_of_flux_density(elements.gradient(dual))
    moments = np.stack([elements.mean(flux * part) for part in elements.barycentric_of_points], axis=1)
    of_dual = 20.0 * moments - 4.0 * moments.sum(axis=1, keepdims=True)  # at corners, of the best linear functions
    surplus, error = surplus_of(problem, field), cubic_error(problem, field)[0]
    divergence = np.tile(np.einsum("cik,cik->k", of_dual, elements.hats), (4, 1))
    right = surplus.residual(of_dual, divergence) * surplus.signs
    return np.sqrt(np.abs(np.sum(right * error, axis=0)))


def with_surplus(problem: ArgumentsInSpace, field: SolidField) -> EnrichedField:
    # The cubic functions alone are not in balance with the quadratic functions. For a linear goal the change by the sum
    # is the residual of the dual, weighted by the cubic functions.
    parts = field.mesh, field.unknown, field.coefficients, field.drive, field.planes
    scale = scale_at_edges(problem, field)
    cubic, norms = (scale * part for part in cubic_error(problem, field))
    relative = float(np.sum(norms**2)) / field.squared_norm if norms.any() else 0.0
    enriched = EnrichedField(*parts, far=field.far, cubic=cubic, error_of_energy=relative)
    slope = enriched.cubic_slope(field.elements.points, field.elements.element)
    change = _dual(problem, field, -field.change_of_flux_density(slope))
    return replace(enriched, unknown=field.unknown + change)


def better_values(
    field: SolidField,
    outputs: Mapping[str, Output],
    better_solution: Callable[[SolidField], SolidField],
    rest_of: Callable[[SolidField], float],
) -> dict[str, Uncertain]:
    # `rest_of` gives the change by further orders, relative to the change by the better solution.
    # Values are kept, because an output may be the goal. Solutions would take too much memory.
    known: dict[int, tuple[Output, Uncertain]] = field.kept.setdefault("better", {})  # with the output of a number
    missing = [output for output in outputs.values() if id(output) not in known]
    if missing:
        better, rest = better_solution(field), rest_of(field)
        relative = better.error_of_energy if isinstance(better, EnrichedField) else 0.0
        reduced = replace(field, unknown=(1.0 - SLIGHT) * field.unknown)
        for output in missing:
            # The parts of a change cancel by chance on graded meshes.
            # The fields of coils in free space and remanences have no error, and may be most of a value.
            value, doubt = float(output(better)), 0.0
            here = float(output(field)) if rest or relative else value
            if relative:
                doubt = relative * min(abs(here), abs(here - float(output(reduced))) / SLIGHT)
            further = rest * (value - here)
            known[id(output)] = output, Uncertain(value + further, max(doubt, abs(further)))
    return {name: known[id(output)][1] for name, output in outputs.items()}


def at_edges(mesh: MeshTet, material: Ints) -> Mask:
    # elements at edges where the surface between two materials turns by more than 45 degrees, or meets a third
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    facets = mesh.facets[:, inner[np.not_equal(*material[mesh.f2t[:, inner]])]]
    normal = np.tile(unit_vectors(normals(mesh.p.T, facets.T).T), 3)
    edges, edge = np.unique(facets[[[0, 0, 1], [1, 2, 2]]].reshape(2, -1), axis=1, return_inverse=True)
    products = np.stack([summed(edge, one * other) for one, other in product(normal, normal)])
    turned = np.bincount(edge.ravel()) ** 2 - np.sum(products**2, axis=0) > TURNED
    return np.asarray(np.isin(mesh.t, edges[:, turned]).any(axis=0))


def _dual(problem: ArgumentsInSpace, field: SolidField, load: Floats) -> Floats:
    energy, elements = coenergy(field.drive, field.coefficients, problem.conditions_of(field)), field.elements
    terms = elements.assemble_vector(elements.against_gradients(load))
    # Above order 2 only differences of duals are taken.
    method = problem.method if field.order <= HIGHEST_WITH_SURPLUS else problem.method.roughly
    return method.full_step(energy, field.unknown, -terms[energy.conditions.free])


def tangential_jumps(field: SolidField) -> Floats:
    """Return residual indicators of a vector potential, (nelements,) in sqrt(J).

    The square is ``h^2 mu |J|^2 |K|`` and, for every inner facet, half of ``h mu |n x [H]|^2 |F|`` (Beck, Hiptmair,
    Hoppe and Wohlmuth, M2AN 34, 2000), scaled like the residual estimate of a scalar potential.
    """
    mesh, strength, reluctivity = field.mesh, field.field_strength, field.reluctivity
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    sides = mesh.f2t[:, inner]
    normal = 0.5 * facet_normals(mesh, inner)
    jump = magnitude(np.cross(normal, strength[:, sides[0]] - strength[:, sides[1]], axis=0))  # times the area
    terms = jump**2 / (np.sqrt(magnitude(normal)) * reluctivity[sides].sum(axis=0))
    total = field.volume ** (5.0 / 3.0) * field.current_density**2 / reluctivity
    return RESIDUAL_SCALE * np.sqrt(total + summed(sides, np.tile(terms, 2), total.size))
