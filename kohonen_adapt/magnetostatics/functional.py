"""Energy functionals of both potentials, in the plane with the dual of a goal."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.estimators import residual
from kohonen_adapt.magnetostatics.arguments import Arguments, ArgumentsInSpace
from kohonen_adapt.magnetostatics.equations.applied_field import aligned_potential
from kohonen_adapt.magnetostatics.equations.conditions import Conditions, Value, circle_of
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY, Inverse, Scaled
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.goals import Goal
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.residuals import dual_residual_by_points, residual_by_points
from kohonen_adapt.magnetostatics.solution import at_points, dual_of
from kohonen_adapt.mesh.host import numbered
from kohonen_adapt.problem.boundary_terms import SurfaceTerms
from kohonen_adapt.problem.energy import Energy
from kohonen_adapt.problem.protocol import HIGHEST_POLISHED, NotOffered
from kohonen_adapt.problem.ritz import Flux, Ritz
from kohonen_adapt.problem.tables import EnergyLaw

__all__ = ["functional_for", "functional_in_space"]

TOLERANCE = 1e-9  # tolerance of equality, relative to the largest derivative or to the sum of the terms of the goal


def functional_for(problem: Arguments, field: Field, goal: Goal | None) -> Ritz:
    """Return the functional of a field, with the dual functional of a goal.

    Raises
    ------
    NotOffered
        For elements of order 4 and above. With a goal, for nonlinear material, around an axis, or if its derivative
        varies within a region.
    """
    if field.order > HIGHEST_POLISHED:
        raise NotOffered(f"elements of order {field.order} are not polished, only elements of order 1 to 3")
    ritz = functional_of(problem, field)
    if goal is None:
        return ritz
    if field.axisymmetric:
        raise NotOffered("around an axis a goal has no functional to minimise")
    if field.coefficients.nonlinear_materials:
        raise NotOffered("with nonlinear material a goal has no functional to minimise")
    derivative = at_points(field, goal.derivative(field))
    functional = dual_functional(field, ritz, *derivative)
    dual = dual_of(problem, field, derivative)
    if field.order > 1:
        indicators = [residual_by_points(field, None), dual_residual_by_points(field, dual, None)]
    else:
        primal = field.unknown, field.coefficients.current_density, field.coefficients.flux
        indicators = [residual(field.mesh, u, field.reluctivity, source=f, flux=g) for u, f, g in (primal, dual)]
    primal_error, dual_error = (float(np.linalg.norm(each)) for each in indicators)
    ratio = dual_error / primal_error if primal_error * dual_error > 0.0 else 1.0
    terms = field.unknown * field.elements.loads(dual.source, dual.load)  # Euler's theorem on homogeneous functions
    is_linear = abs(terms.sum() - goal(field)) <= TOLERANCE * np.abs(terms).sum()
    # Parabolas omit parts of curves that change a value by as much as a goal improves in a pass.
    comparable = not field.elements.shape.curved.any() and bool(is_linear)
    return replace(ritz, dual=replace(functional, values=dual.values), share=ratio, comparable=comparable)


def dual_functional(field: Field, ritz: Ritz, source: Floats, load: Floats) -> Ritz:
    primal_region = np.asarray(ritz.region)
    region = numbered(np.stack([primal_region, source]))
    point_region = region[field.elements.element]
    first, point = (np.unique(numbers, return_index=True)[1] for numbers in (region, point_region))
    if np.any(np.abs(load - load[:, point][:, point_region]) > TOLERANCE * np.abs(load).max()):
        # For forces and energies, with a flux averaged at the nodes, the descent of both functionals gave error bounds
        # of 1.02 to 1.09 and of 0.8 to 1.4 times the bounds of the map alone (two magnets, actuator).
        raise NotOffered(
            "a goal whose derivative varies within regions (a force, a torque, B over a spot, the energy of a part) "
            "has no functional to minimise"
        )
    robin = {name: (kappa, 0.0) for name, (kappa, _) in ritz.robin.items()}
    return replace(
        ritz,
        coefficient=np.asarray(ritz.coefficient)[primal_region[first]],
        source=source[first],
        flux=load[:, point],
        region=region,
        robin=robin,
    )


def functional_of(problem: Arguments, field: Field) -> Ritz:
    coefficients, symmetry, conditions = field.coefficients, field.symmetry, problem.conditions_of(field)
    present, first, region = coefficients.present(problem.materials)
    flux: Flux = symmetry.flux(coefficients.coercivity[:, first])
    if any(material.turns for material in present):

        def flux(x: Floats, index: Ints) -> Floats:
            return symmetry.flux(coefficients.coercivity_at(first[index], x))

    laws: Sequence[EnergyLaw | None] = [material.bh for material in present]
    if field.axisymmetric:
        scaled = {id(each.bh): Scaled(each.bh, symmetry.extent) for each in present if each.bh is not None}
        laws = [scaled.get(id(law)) for law in laws]  # equal laws stay identical
    robin, name = dict[str, tuple[float, Value]](), problem.open_boundary
    if name is not None:
        centre, radius = circle_of(field.mesh, name)

        def load(x: Floats) -> Floats:
            applied, dimension = symmetry.uniform(x, centre, problem.applied_field)
            return symmetry.extent * dimension / radius * applied

        robin[name] = symmetry.extent / (VACUUM_PERMEABILITY * radius), load
    signed = ((1, problem.periodic), (-1, problem.antiperiodic))
    return Ritz(
        field.unknown,
        conditions.fixed,
        symmetry.extent * coefficients.reluctivity[first],
        symmetry.source(coefficients.current_density[first]),
        flux,
        region,
        laws if coefficients.nonlinear_materials else (),
        field.order,
        field.axisymmetric,
        robin,
        signs={(pair[0], pair[1]): sign for sign, pairs in signed for pair in pairs},
    )


HIGHEST_IN_SPACE = 2  # order of tetrahedra that the polish takes
NO_LOAD = 1e-12  # largest rounding error of the load of a field parallel to a face, relative to the largest load
FunctionalOn = Callable[[MeshTet], tuple[Energy, SolidField]]


def functional_in_space(problem: ArgumentsInSpace, field: SolidField, functional_on: FunctionalOn) -> Ritz:
    if field.order > HIGHEST_IN_SPACE:
        raise NotOffered(f"tetrahedra of order {field.order} are not polished, only tetrahedra of order 1 and 2")
    coefficients = field.coefficients
    present, first, region = coefficients.present(problem.materials)
    turning = [material for material in present if material.turns]
    if any(material.bh is not None for material in turning):
        raise NotOffered("nonlinear magnets that vary in a region have no functional to minimise")
    if field.order > 1 and turning:
        raise NotOffered("tetrahedra of order 2 are polished beside constant magnets")
    mu, coercivity = 1.0 / coefficients.reluctivity[first], coefficients.coercivity[:, first]
    laws = tuple(None if material.bh is None else Inverse(material.bh) for material in present)
    flux: Flux = np.where([law is None for law in laws], mu * coercivity, 0.0)
    if turning:

        def flux(x: Floats, index: Ints) -> Floats:
            return mu[index] * coefficients.coercivity_at(first[index], x)

    return Ritz(
        field.unknown,
        problem.conditions_of(field).fixed,
        mu,
        flux=flux,
        region=region,
        laws=laws if coefficients.nonlinear_materials else (),
        order=field.order,
        shift=coercivity,
        surface=surface_terms(problem, field, ~field.drive.iron[first], functional_on),
    )


def surface_terms(
    problem: ArgumentsInSpace, field: SolidField, reduced: Mask, functional_on: FunctionalOn
) -> SurfaceTerms | None:
    drive = field.drive
    if drive.function is None:
        return None
    if np.any(drive.layer):
        raise NotOffered("the potential in iron that links a current has a jump, which is not polished")

    def on_mesh(mesh: MeshTet) -> Floats:
        moved = functional_on(mesh)[1]
        return nodal_terms(moved, problem.conditions_of(moved), aligned_potential(moved.drive, drive))

    return SurfaceTerms(nodal_terms(field, problem.conditions_of(field), drive.potential), reduced, on_mesh)


def nodal_terms(field: SolidField, conditions: Conditions, potential: Floats) -> Floats:
    drive, outside = field.drive, np.zeros(potential.size, bool)
    outside[drive.elements.unknowns[:, ~drive.iron]] = True
    works = ~(conditions.fixed & (conditions.values == drive.potential))  # phi is not 0
    works &= np.abs(drive.load) > NO_LOAD * np.abs(drive.load).max(initial=0.0)
    return np.stack([np.where(outside, potential, 0.0), np.where(works, drive.load, 0.0)], axis=1)
