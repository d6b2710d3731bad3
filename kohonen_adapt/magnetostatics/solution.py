"""Solutions of plane problems, with their functionals and linearisations."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.around_axis import elements_on
from kohonen_adapt.magnetostatics.equations.conditions import Boundaries, Value, circle_of, conditions_of
from kohonen_adapt.magnetostatics.equations.energy import EnergyFunctional
from kohonen_adapt.magnetostatics.equations.newton import Newton, NewtonStep, NotConverged
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.materials.coefficients import coercivity_at
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.field import Field
from kohonen_adapt.magnetostatics.quantities.linkage import checked_circuit, turn_length, turns_density
from kohonen_adapt.problem.ritz import Flux, Ritz
from kohonen_adapt.problem.tables import EnergyLaw

__all__ = [
    "CubicField",
    "Dual",
    "QuadraticField",
    "at_points",
    "dual_of",
    "functional_of",
    "linkage_slope",
    "richer_solution",
    "solution_of",
    "tangent_solution",
]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class QuadraticField(Field):
    """Field of a P2 potential, with B linear in every element.

    Values per element are means. In elements with curved sides A and B are polynomials of the reference coordinates.

    Parameters
    ----------
    mesh, potential, coefficients, symmetry, depth, newton
        As in `Field`. The potential at the nodes is the first part of `values`.
    values : (nunknowns,)
        A in Wb/m at the degrees of freedom of scikit-fem's elements of the same order: at the nodes, on the facets and,
        of a `CubicField`, inside the elements.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import Magnetostatics, Material
    >>> mesh = skfem.MeshTri().refined(2).with_defaults().with_subdomains({"air": lambda x: x[0] > 0.0})
    >>> rim = dict.fromkeys(["left", "right", "bottom", "top"], lambda x: x[0] * x[1])
    >>> field = Magnetostatics({"air": Material()}, potential=rim, order=2).solve(mesh)  # A = x y, B = (x, -y)
    >>> np.allclose(field.flux_density_at([[0.3], [0.2]]), [[0.3], [-0.2]])
    True
    """

    values: Floats
    order: ClassVar[int] = 2

    @property
    def _values(self) -> Floats:
        return self.values


class CubicField(QuadraticField):
    """Field of a P3 potential, with B quadratic in every element.

    Parameters
    ----------
    mesh, potential, coefficients, symmetry, depth, newton, values
        As in `QuadraticField`.
    """

    order = 3


def solution_of(energy: EnergyFunctional, depth: float | None, old: Field | None, newton: Newton) -> Field:
    elements, steps = energy.elements, tuple[NewtonStep, ...]()
    if energy.coefficients.nonlinear_materials:
        unknown, steps = newton.descend(energy, _start_values(energy, old, newton))
    else:
        unknown = newton.linear(energy)
    values = energy.symmetry.potential(elements.doflocs, unknown)
    arguments = elements.mesh, values[: elements.corners.p.shape[1]], energy.coefficients, energy.symmetry, depth, steps
    if elements.order == 1:
        field = Field(*arguments)
    else:
        field = (QuadraticField if elements.order == 2 else CubicField)(*arguments, values=values)
    if steps and not steps[-1].converged:
        raise NotConverged(field)
    return field


def _start_values(energy: EnergyFunctional, old: Field | None, newton: Newton) -> Floats:
    # From A = 0 the first step is the whole linear solution, halved if that saturates everything. Beside prescribed
    # values A = 0 is a steep wall, and the linear solution is a better start.
    conditions = energy.conditions
    if old is not None:
        x = energy.elements.doflocs
        return conditions.admissible(energy.symmetry.unknown(x, old_potential_at(x, old)))
    return newton.linear(energy) if np.any(conditions.values) else conditions.values


def old_potential_at(x: Floats, old: Field) -> Floats:
    values = old.potential_at(x)
    outside = np.isnan(values)
    if outside.any():
        nearest = KDTree(old.elements.corners.p.T).query(x[:, outside].T)[1]
        values[outside] = old.potential[nearest]
    return values


def functional_of(field: Field, boundaries: Boundaries, materials: Mapping[str, Material]) -> Ritz:
    coefficients, conditions = field.coefficients, conditions_of(field.elements, boundaries, field.symmetry)
    present, first, region = coefficients.present(materials)
    varies = any(material.turns for material in present.values())
    symmetry, extent = field.symmetry, field.symmetry.extent
    flux: Flux = _flux_of(present, symmetry) if varies else symmetry.flux(coefficients.coercivity[:, first])
    laws: tuple[EnergyLaw | None, ...] = ()
    if coefficients.nonlinear_materials:
        laws = tuple(material.bh for material in present.values())
    if field.axisymmetric:
        scaled = {id(law): ScaledLaw(law, extent) for law in laws if law is not None}  # equal laws stay identical
        laws = tuple(scaled.get(id(law)) for law in laws)
    tables = extent * coefficients.reluctivity[first], symmetry.source(coefficients.current_density[first]), flux
    order, around_axis = field.elements.order, field.axisymmetric
    robin, signs = robin_of(field, boundaries), signs_of(boundaries)
    return Ritz(field.unknown, conditions.fixed, *tables, region, laws, order, around_axis, robin, signs=signs)


def signs_of(boundaries: Boundaries) -> dict[tuple[str, str], int]:
    return {
        (pair[0], pair[1]): sign
        for sign, pairs in ((1, boundaries.periodic), (-1, boundaries.antiperiodic))
        for pair in pairs
    }


def robin_of(field: Field, boundaries: Boundaries) -> dict[str, tuple[float, Value]]:
    name = boundaries.open_boundary
    if name is None:
        return {}
    (centre, radius), extent = circle_of(field.mesh, name), field.symmetry.extent

    def load(x: Floats) -> Floats:
        applied, dimension = field.symmetry.uniform(x, centre, boundaries.applied_field)
        return extent * dimension / radius * applied

    return {name: (extent / (VACUUM_PERMEABILITY * radius), load)}


@dataclass(frozen=True)
class ScaledLaw:
    """B-H law integrated over the angle around an axis."""

    law: EnergyLaw
    factor: float

    def field_strength(self, b: Floats) -> Floats:
        return self.factor * self.law.field_strength(b)

    def energy(self, b: Floats) -> Floats:
        return self.factor * self.law.energy(b)


def _flux_of(materials: Mapping[str, Material], symmetry: Symmetry) -> Callable[[Floats, Ints], Floats]:
    return lambda x, index: symmetry.flux(coercivity_at(materials, x, index))


def tangent_solution(field: Field, boundaries: Boundaries, load: Floats, newton: Newton) -> Floats:
    """Return the linearised change of `field.unknown` by `load`, shape (nunknowns,).

    The problem is linearised at the field, with the differential reluctivity along B and the secant one across.
    Prescribed values do not change. `load` is as in `Elements.loads`.
    """
    conditions = conditions_of(field.elements, boundaries, field.symmetry)
    energy = EnergyFunctional(field.elements, field.symmetry, field.coefficients, conditions)
    return newton.full_step(energy, field.unknown, -load[conditions.free])


class Dual(NamedTuple):
    """Solution of the dual problem of a goal, with the derivative that is its load."""

    values: Floats  # (nunknowns,)
    source: Floats  # (nelements,)
    load: Floats  # (2, npoints)


def dual_of(field: Field, derivative: tuple[Floats, Floats], boundaries: Boundaries, newton: Newton) -> Dual:
    source, load = at_points(field, derivative)
    return Dual(tangent_solution(field, boundaries, field.elements.loads(source, load), newton), source, load)


def at_points(field: Field, derivative: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    (source, load), at = derivative, field.at_quadrature
    return source, load if load.shape == at.x.shape else load[:, at.element]


def richer_solution(field: Field, boundaries: Boundaries, newton: Newton) -> Field:
    elements = elements_on(field.mesh, field.order + 1, field.symmetry, field.coefficients.nonlinear)
    conditions = conditions_of(elements, boundaries, field.symmetry)
    return solution_of(
        EnergyFunctional(elements, field.symmetry, field.coefficients, conditions), field.depth, field, newton
    )


def linkage_slope(field: Field, boundaries: Boundaries, circuit: Mapping[str, float], newton: Newton) -> float:
    density, zero = turns_density(field, checked_circuit(circuit)), np.zeros_like(field.elements.points)
    linked = field.elements.loads(density, zero)
    load = field.elements.loads(field.symmetry.source(density), zero)
    return turn_length(field) * float(linked @ tangent_solution(field, boundaries, load, newton))
