"""Error estimates of fields in space, in the energy norm and for goals."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.estimators import goal_oriented, recovery, residual
from kohonen_adapt.estimators.hierarchical import Surplus, cubic_slopes
from kohonen_adapt.magnetostatics.arguments import ArgumentsInSpace
from kohonen_adapt.magnetostatics.equations.energy import coenergy
from kohonen_adapt.magnetostatics.equations.newton import Newton
from kohonen_adapt.magnetostatics.estimation import RESIDUAL_SCALE, equal_materials
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.quantities.point_values import Points
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.curved import Isoparametric
from kohonen_adapt.mesh.elements.rules import tetrahedron_rule
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.measures import inner_points, magnitude, unit_vectors
from kohonen_adapt.problem.energy import Energy
from kohonen_adapt.problem.evaluation import Output
from kohonen_adapt.problem.uncertain import Uncertain

__all__ = [
    "are_parallel",
    "arguments_of_goal",
    "at_edges",
    "better_values",
    "dual_of_goal",
    "energy_indicators_in_space",
    "goal_indicators_in_space",
    "linearised_at",
    "primal_and_dual",
    "tangential_jumps",
    "with_surplus",
]

# At edges of materials cubic functions are two thirds of the error (benchmarks forces-in-space).
AT_EDGES = 1.5
TURNED = 1.0  # least measure of a turn at an edge: twice the square of the sine, of 45 degrees
PARALLEL = 0.99  # least cosine of the angle between potential and dual for a polish by the energy
ROUGH = 1e-6  # residual of conjugate gradients in a better solution, which serves differences of values only
STEP = 1e-4  # of central differences, relative to the size of an element
FINE = 5  # degree of a quadrature in elements near coils
SLIGHT = 1e-4  # relative change of a potential


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EnrichedField(SolidField):
    """Field of order 2 in space with an estimate of its error added."""

    cubic: Floats  # (10, nelements): coefficients of `cubic_slopes`
    error_of_energy: float  # relative

    def points_in(self, inside: Mask) -> tuple[Floats, Ints, Floats]:
        # The quadrature of the elements is a part of the error near coils.
        return Isoparametric(self.mesh).quadrature(np.flatnonzero(inside), tetrahedron_rule(FINE))

    def _reaction(self, x: Floats, element: Ints) -> Floats:
        return super()._reaction(x, element) - VACUUM_PERMEABILITY * self.cubic_slope(x, element)

    def _vectors(self, at: Points, unknown: Floats) -> Floats:
        return super()._vectors(at, unknown) - self.cubic_slope(at.x, at.element)

    def cubic_slope(self, x: Floats, element: Ints) -> Floats:
        slopes = cubic_slopes(self.elements.barycentric(x, element))
        along = np.einsum("in,ian->an", self.cubic[:, element], slopes)
        return np.asarray(np.einsum("an,can->cn", along, self.elements.hats[:, :, element]))


def energy_indicators_in_space(problem: ArgumentsInSpace, field: SolidField, estimator: str) -> Floats:
    if field.order > 1:
        return scale_at_edges(problem, field) * cubic_error(problem, field)[1]
    secant, differential = field.permeabilities
    weight = np.sqrt(secant * differential) if estimator == "residual" else differential
    given, flux = (field.mesh, field.unknown, weight), _flux_for(field, weight)
    if estimator == "residual":
        return RESIDUAL_SCALE * residual(*given, flux=flux)
    return recovery(*given, flux=flux, region=equal_materials(field, problem.materials))


def flux_and_divergence(field: SolidField) -> tuple[Floats, Floats]:
    # B, (3, 4, nelements), and its divergence, (4, nelements), at the corners. The applied field has no divergence,
    # so that its interpolation error does not count as a source.
    elements, corners, coefficients = field.elements, field.mesh.t.shape, field.coefficients
    at_corners = elements.gradient_in_each(field.drive.potential, np.eye(4))
    offset = np.where(np.tile(field.drive.iron, 4), 0.0, at_corners)
    slope = offset - elements.gradient_in_each(field.unknown, np.eye(4))
    flux = field.at_corners.flux_density.reshape(3, *corners)
    own = np.where(coefficients.nonlinear, flux, slope.reshape(3, *corners) / coefficients.reluctivity)
    divergence = np.tile(np.einsum("cik,cik->k", own, elements.hats), (4, 1))
    for magnet in coefficients.varying_magnets:
        divergence[:, magnet.elements] += _divergence_of_remanence(field, magnet.elements)
    return flux, divergence


def _divergence_of_remanence(field: SolidField, elements: Ints) -> Floats:
    # at the corners, (4, n), linear in elements
    x = inner_points(field.mesh.p[:, field.mesh.t[:, elements]])
    element, step = np.tile(elements, 4), STEP * np.cbrt(field.volume[elements])
    total = np.zeros(x.shape[1:])
    for axis, direction in enumerate(np.eye(3)[:, :, None, None]):
        for sign in (1.0, -1.0):
            at = field.coefficients.at_points(element, (x + sign * step * direction).reshape(3, -1))
            total += sign * (at.coercivity[axis] / at.reluctivity).reshape(total.shape) / (2.0 * step)
    mean = total.mean(axis=0)
    return np.asarray(mean + np.sqrt(5.0) * (total - mean))


def primal_and_dual(problem: ArgumentsInSpace, field: SolidField, goal: Goal) -> dict[str, Any]:
    """Return the arguments of `goal_oriented` for a field and its dual.

    Both solve ``-div(mu grad u - flux) = 0``. For nonlinear material mu is the root of the determinant of the tensor of
    the linearised problem, and the fluxes make ``mu grad u - flux`` equal to -B and, of the dual, to its change and the
    load.
    """
    elements, (_, load) = field.elements, goal.derivative(field)
    load = elements.mean(load) if load.shape == elements.points.shape else load
    dual = _dual(problem, field, load)
    weight = np.sqrt(np.multiply(*field.permeabilities))
    change = elements.mean(field.change_of_flux_density(elements.slope_of_corners(dual)))
    return {
        "potential": field.unknown,
        "dual": dual,
        "reluctivity": weight,
        "flux": _flux_for(field, weight),
        "dual_flux": weight * elements.gradient(dual) - change + load,
        "region": equal_materials(field, problem.materials),
    }


def are_parallel(field: SolidField, dual: Floats) -> bool:
    # The linkage of a single coil in linear material has an error proportional to the error of the energy, which the
    # polish decreases.
    elements = field.elements
    reluctivity = field.reluctivity if elements.order == 1 else field.reluctivity[elements.element]
    weight = np.sqrt(elements.gradient_weights / reluctivity)
    one, other = (weight * elements.gradient(each) for each in (field.potential, dual))
    return float(np.sum(one * other)) ** 2 > PARALLEL**2 * float(np.sum(one**2) * np.sum(other**2))


def cubic_functions(problem: ArgumentsInSpace, field: SolidField) -> Surplus:
    mesh, elements = field.elements.corners, field.elements
    fixed = np.all(problem.conditions_of(field).fixed[elements.on_facets(np.arange(mesh.facets.shape[1]))], axis=0)
    return Surplus(mesh, elements.volumes, np.asarray(fixed), elements.hats_of_corners)


def cubic_error(problem: ArgumentsInSpace, field: SolidField) -> tuple[Floats, Floats]:
    # The error of a field of order 2 as coefficients of cubic functions, (10, nelements), and its norms, (nelements,).
    # Indicators, outputs and goals have the same.
    if "cubic" not in field.kept:
        surplus, hats = cubic_functions(problem, field), field.elements.hats
        secant, differential = field.permeabilities
        slope = np.einsum("ck,cak->ak", unit_vectors(field.field_strength + field.coefficients.coercivity), hats)
        metric = secant * np.einsum("cak,cbk->abk", hats, hats)
        metric += (differential - secant) * slope[:, None] * slope
        cubic, squares = surplus.solve(metric, surplus.residual(*flux_and_divergence(field)))
        field.kept["cubic"] = cubic, np.sqrt(np.maximum(squares, 0.0))
    return field.kept["cubic"]


def scale_at_edges(problem: ArgumentsInSpace, field: SolidField) -> Floats:
    return np.where(at_edges(field.elements.corners, equal_materials(field, problem.materials)), AT_EDGES, 1.0)


def arguments_of_goal(problem: ArgumentsInSpace, field: SolidField, goal: Goal) -> dict[str, Any]:
    """Return the arguments of goal indicators, kept for the functional."""
    if field.kept.get("goal") is not goal:
        arguments = primal_and_dual if field.order == 1 else dual_of_goal
        field.kept.update(goal=goal, pair=arguments(problem, field, goal))
    return field.kept["pair"]


def dual_of_goal(problem: ArgumentsInSpace, field: SolidField, goal: Goal) -> dict[str, Any]:
    elements, (_, load) = field.elements, goal.derivative(field)
    load = load if load.shape == elements.points.shape else load[:, elements.element]
    return {"dual": _dual(problem, field, load), "load": load}


def goal_indicators_in_space(problem: ArgumentsInSpace, field: SolidField, goal: Goal) -> Floats:
    arguments = arguments_of_goal(problem, field, goal)
    if field.order == 1:
        return goal_oriented(field.mesh, **arguments)
    return goal_indicators_by_surplus(problem, field, **arguments)


def goal_indicators_by_surplus(problem: ArgumentsInSpace, field: SolidField, dual: Floats, load: Floats) -> Floats:
    # The squares are the magnitudes of the residual of the dual, weighted by the error of the field.
    elements = field.elements
    of_dual = linear_fit(elements, load - field.change_of_flux_density(elements.gradient(dual)))
    surplus, error = cubic_functions(problem, field), cubic_error(problem, field)[0]
    divergence = np.tile(np.einsum("cik,cik->k", of_dual, elements.hats), (4, 1))
    right = surplus.residual(of_dual, divergence) * surplus.signs
    return np.asarray(np.sqrt(np.abs(np.sum(right * error, axis=0))))


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
    field: SolidField, outputs: Mapping[str, Output], better_solution: Callable[[SolidField], SolidField]
) -> dict[str, Uncertain]:
    # Values are kept, because an output may be the goal. Solutions would take too much memory.
    known: list[tuple[Output, Uncertain]] = field.kept.setdefault("better", [])
    missing = [output for output in outputs.values() if not any(output is each for each, _ in known)]
    if missing:
        better = better_solution(field)
        known += [(output, better_value(field, better, output)) for output in missing]
    return {name: next(value for each, value in known if each is output) for name, output in outputs.items()}


def better_value(field: SolidField, better: SolidField, output: Output) -> Uncertain:
    # The parts of a change cancel by chance on graded meshes.
    least = better.error_of_energy * part_by_potential(field, output) if isinstance(better, EnrichedField) else 0.0
    return Uncertain(float(output(better)), least)


def part_by_potential(field: SolidField, output: Output) -> float:
    # The fields of coils in free space and remanences have no error, and may be most of a value.
    value = float(output(field))
    less = float(output(replace(field, unknown=(1.0 - SLIGHT) * field.unknown)))
    return min(abs(value), abs(value - less) / SLIGHT)


def at_edges(mesh: MeshTet, material: Ints) -> Mask:
    # elements at edges where the surface between two materials turns by more than 45 degrees, or meets a third
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    facets = mesh.facets[:, inner[np.not_equal(*material[mesh.f2t[:, inner]])]]
    normal = np.tile(unit_vectors(normals(mesh.p.T, facets.T).T), 3)
    edges, edge = np.unique(facets[[[0, 0, 1], [1, 2, 2]]].reshape(2, -1), axis=1, return_inverse=True)
    products = np.stack([np.bincount(edge.ravel(), one * other) for one, other in product(normal, normal)])
    turned = np.bincount(edge.ravel()) ** 2 - np.sum(products**2, axis=0) > TURNED
    nodes = np.isin(np.arange(mesh.p.shape[1]), edges[:, turned])
    return np.asarray(nodes[mesh.t].any(axis=0))


def linearised_at(field: SolidField, energy: Energy, higher: SolidField, newton: Newton) -> SolidField:
    # The potential in nonlinear material is total, so that H on straight edges does not change.
    newton = replace(newton, solver=replace(newton.solver, rtol=ROUGH))
    start = energy.conditions.admissible(energy.space.interpolated(field.elements, field.unknown))
    return replace(higher, unknown=start + newton.full_step(energy, start, energy.gradient(start)))


def linear_fit(elements: Space, values: Floats) -> Floats:
    # the values at the corners, (3, 4, nelements), of the best linear functions
    barycentric = elements.barycentric(elements.points, elements.element)
    moments = np.stack([elements.mean(values * part) for part in barycentric], axis=1)
    return 20.0 * moments - 4.0 * moments.sum(axis=1, keepdims=True)


def _dual(problem: ArgumentsInSpace, field: SolidField, load: Floats) -> Floats:
    energy, elements = coenergy(field.drive, field.coefficients, problem.conditions_of(field)), field.elements
    terms = elements.assemble_vector(elements.against_gradients(load))
    return problem.method.full_step(energy, field.unknown, -terms[energy.conditions.free])


def _flux_for(field: SolidField, weight: Floats) -> Floats:
    """Return the flux for which ``weight grad u - flux`` equals -B."""
    slope = field.elements.gradient(field.unknown)
    if field.drive.function is None and not field.coefficients.varying_magnets:
        return weight * slope + field.flux_density
    return (weight * slope)[:, None] + field.at_corners.flux_density.reshape(3, 4, -1)


def tangential_jumps(field: SolidField) -> Floats:
    """Return residual indicators of a vector potential, (nelements,) in sqrt(J).

    The square is ``h^2 mu |J|^2 |K|`` and, for every inner facet, half of ``h mu |n x [H]|^2 |F|`` (Beck, Hiptmair,
    Hoppe and Wohlmuth, M2AN 34, 2000), scaled like the residual estimate of a scalar potential.
    """
    mesh, strength = field.mesh, field.field_strength
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    first, second = mesh.f2t[:, inner]
    normal = 0.5 * normals(mesh.p.T, mesh.facets[:, inner].T).T
    size = magnitude(normal)
    jump = magnitude(np.cross(normal, strength[:, first] - strength[:, second], axis=0))  # times the area
    permeability = 1.0 / field.reluctivity
    mean = 2.0 / (1.0 / permeability[first] + 1.0 / permeability[second])
    terms = 0.5 * mean * jump**2 / np.sqrt(size)
    total = field.volume ** (5.0 / 3.0) * permeability * field.current_density**2
    for side in (first, second):
        total += np.bincount(side, terms, total.size)
    return RESIDUAL_SCALE * np.sqrt(total)
