"""Two-sided bounds of the energy in space by both potentials on one mesh."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from skfem import MeshTet

from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.equations.conditions import Value
from kohonen_adapt.magnetostatics.hypercircle import UNIFORM, Bracket, gap_indicators, with_currents_of
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential
from kohonen_adapt.mesh.curved import corners_of, is_second_order

__all__ = ["bracket", "bracket_of", "reasons_against_guarantee"]


def bracket(
    mesh: MeshTet,
    materials: Mapping[str, Material],
    potential: Mapping[str, Value] | None = None,
    *,
    applied_field: Any = None,
    symmetry: Mapping[str, str] | None = None,
    coils: Mapping[str, Coil] | None = None,
) -> Bracket:
    """Solve for both potentials on one mesh, and bound the exact energy.

    Parameters
    ----------
    mesh
        A mesh of tetrahedra in metres, for instance from `kohonen_adapt.adapt`. Edges of a `MeshTet2` count as
        straight.
    materials, potential, applied_field, symmetry, coils
        As in `MagneticScalarPotential` and `MagneticVectorPotential`.

    Returns
    -------
    Bracket
        The bounds, with both fields.

    Raises
    ------
    ValueError
        As in `MagneticScalarPotential.solve` and `MagneticVectorPotential.solve`.

    Examples
    --------
    >>> import numpy as np, skfem
    >>> from kohonen_adapt.magnetostatics import Material, bracket
    >>> def inside(x):
    ...     return np.all(np.abs(x - 0.5) < 0.26, axis=0)
    >>> mesh = skfem.MeshTet().refined(3).with_boundaries({"far": lambda x: x[0] > -1.0})
    >>> mesh = mesh.with_subdomains({"magnet": inside, "air": lambda x: ~inside(x)})
    >>> bracket(mesh, {"magnet": Material(remanence=(0.0, 0.0, 1.2)), "air": Material()}, {"far": 0.0})
    <Bracket: energy between 13200.5 and 20974.8 J, 37 % apart; guaranteed>
    """
    problem = MagneticScalarPotential(materials, potential, applied_field, symmetry, order=1, coils=coils)
    return bracket_of(problem, problem.solve(corners_of(mesh)))


def bracket_of(problem: MagneticScalarPotential, field: SolidField) -> Bracket:
    if is_second_order(field.mesh):
        raise ValueError("the bounds are those of straight edges, and the field is on curved ones; set curved=False.")
    vector = problem.vector_potential.solve(field.mesh)
    scalar = with_currents_of(vector, field)
    indicators, upper = gap_indicators(scalar, vector), scalar.coenergy
    source_error = vector.drive.work_of_difference(vector.flux_density)
    lower = upper - 0.5 * float(np.sum(indicators**2)) + source_error
    upper += max(source_error, 0.0)
    coils, materials = tuple((problem.coils or {}).values()), problem.materials.values()
    magnets = any(each.coercivity is not None or callable(each.remanence) or any(each.remanence) for each in materials)
    energy = inductance = None
    if not magnets and all(each.bh is None for each in materials):
        energy = lower, upper
    elif problem.free_field is None and all(
        not callable(value) and value == 0.0 for value in (problem.potential or {}).values()
    ):
        energy = -upper, -lower
    if len(coils) == 1 and problem.applied_field is None and energy == (lower, upper):
        inductance = 2.0 * lower / coils[0].ampere_turns ** 2, 2.0 * upper / coils[0].ampere_turns ** 2
    reasons = reasons_against_guarantee(problem, field.mesh)
    return Bracket(lower, upper, energy, inductance, indicators, field, vector, reasons, source_error)


def reasons_against_guarantee(problem: MagneticScalarPotential, mesh: MeshTet) -> tuple[str, ...]:
    found = list[str]()
    varying = [name for name, material in problem.materials.items() if material.turns]
    if varying:
        found.append(f"the magnetisation of {', '.join(varying)} varies within elements")
    for name, value in (problem.potential or {}).items():
        if callable(value):
            corners = mesh.p[:, mesh.facets[:, mesh.boundaries[name]]]
            mean = np.mean([np.asarray(value(corners[:, k])) for k in range(3)], axis=0)
            if np.abs(value(corners.mean(axis=1)) - mean).max() > UNIFORM * np.abs(mean).max():
                found.append(f"the potential of {name} is not linear in facets")
    return tuple(found)
