"""The co-energy functional of a scalar potential, for the polish."""

from collections.abc import Callable, Mapping

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.applied_field import aligned_potential
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.energy import CoenergyFunctional
from kohonen_adapt.magnetostatics.materials.coefficients import coercivity_at
from kohonen_adapt.magnetostatics.materials.laws import Inverse
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.problem.boundary_terms import SurfaceTerms
from kohonen_adapt.problem.protocol import NotOffered
from kohonen_adapt.problem.ritz import Flux, Ritz

__all__ = ["functional_in_space"]

NO_LOAD = 1e-12  # largest rounding error of the load of a field parallel to a face, relative to the largest load
ConditionsOf = Callable[[SolidField], Conditions]
FunctionalOn = Callable[[MeshTet], tuple[CoenergyFunctional, SolidField]]


def functional_in_space(
    field: SolidField, conditions_of: ConditionsOf, materials: Mapping[str, Material], functional_on: FunctionalOn
) -> Ritz:
    coefficients_of_mesh = field.coefficients
    present, first, region = coefficients_of_mesh.present(materials)
    if any(material.turns and material.bh is not None for material in present.values()):
        raise NotOffered("nonlinear magnets that vary in a region have no functional to minimise")
    varies = field.drive.function is not None or any(material.turns for material in present.values())
    if field.order > 1 and varies:
        raise NotOffered("tetrahedra of order 2 are polished beside constant magnets without currents")
    mu, coercivity = 1.0 / coefficients_of_mesh.reluctivity[first], coefficients_of_mesh.coercivity[:, first]
    flux: Flux = np.where([material.bh is None for material in present.values()], mu * coercivity, 0.0)
    if any(material.turns for material in present.values()):

        def flux(x: Floats, index: Ints) -> Floats:
            return mu[index] * coercivity_at(present, x, index)

    laws = tuple(None if material.bh is None else Inverse(material.bh) for material in present.values())
    return Ritz(
        field.unknown,
        conditions_of(field).fixed,
        mu,
        0.0,
        flux,
        region,
        laws if coefficients_of_mesh.nonlinear_materials else (),
        order=field.order,
        shift=coercivity,
        surface=surface_terms(field, ~field.drive.iron[first], conditions_of, functional_on),
    )


def surface_terms(
    field: SolidField, reduced: Mask, conditions_of: ConditionsOf, functional_on: FunctionalOn
) -> SurfaceTerms | None:
    drive = field.drive
    if drive.function is None:
        return None
    if np.any(drive.layer):
        raise NotOffered("the potential in iron that links a current has a jump, which is not polished")

    def on_mesh(mesh: MeshTet) -> Floats:
        moved = functional_on(mesh)[1]
        return nodal_terms(moved, conditions_of(moved), aligned_potential(moved.drive, drive))

    return SurfaceTerms(nodal_terms(field, conditions_of(field), drive.potential), reduced, on_mesh)


def nodal_terms(field: SolidField, conditions: Conditions, potential: Floats) -> Floats:
    drive, outside = field.drive, np.zeros(potential.size, dtype=np.bool_)
    outside[field.mesh.t[:, ~drive.iron]] = True
    works = ~(conditions.fixed & (conditions.values == drive.potential))  # phi is not 0
    works &= np.abs(drive.load) > NO_LOAD * np.abs(drive.load).max(initial=0.0)
    return np.stack([np.where(outside, potential, 0.0), np.where(works, drive.load, 0.0)], axis=1)
