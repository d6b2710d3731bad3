"""Two-sided bounds of the energy in space by both potentials on one mesh."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats
from kohonen_adapt.display import significant
from kohonen_adapt.magnetostatics.coils.coil import Coil
from kohonen_adapt.magnetostatics.equations.conditions import Value
from kohonen_adapt.magnetostatics.hypercircle import gap_indicators, with_currents_of
from kohonen_adapt.magnetostatics.materials.material import Material
from kohonen_adapt.magnetostatics.quantities.edge_field import EdgeField
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.magnetostatics.scalar_potential import MagneticScalarPotential

__all__ = ["Bracket", "bracket", "bracket_of", "reasons_against_guarantee"]

UNIFORM = 1e-9  # relative difference of values that are equal


@dataclass(frozen=True, eq=False, repr=False)
class Bracket:
    """Bounds of the exact co-energy, and of the errors of both potentials.

    The scalar potential's H has the right curl, and the vector potential's B has no divergence. Therefore the co-energy
    of the first is an upper bound, and the functional of the second is a lower bound, on every mesh and for every B-H
    law. Half the root of the summed squares of `indicators` is the error of the mean of both fields, if all materials
    are linear (Prager and Synge, Quart. Appl. Math. 5, 1947). The bounds are those of the meshed domain, with chords in
    place of curves.

    Both problems have the currents of the mesh: the current through every facet is that of the coils and the applied
    field, and the current density is constant in every element. For these currents the bounds are a guarantee. The
    change to the given currents, `source_error`, is of first order, and both bounds contain it. The lower bound is then
    a guarantee for the given currents, too, and the upper bound is one up to terms of second order.

    Attributes
    ----------
    lower, upper
        Bounds of the co-energy, `SolidField.coenergy`, in J.
    energy
        Lower and upper bound of `SolidField.energy` in J: the co-energy of linear material without magnets, and the
        negative co-energy of magnets without currents and given potentials other than 0. None in all other cases.
    inductance
        Lower and upper bound of ``2 W / (ampere turns)^2`` in H, the inductance of the meshed part for one turn, with
        one coil in linear material without magnets. None in all other cases.
    indicators : (nelements,)
        Difference of both fields in every element in the energy norm, in sqrt(J). The root of their summed squares is
        an upper bound of the error of either field in the energy norm, if all materials are linear.
    scalar, vector
        The fields of `MagneticScalarPotential` and `MagneticVectorPotential`.
    reasons
        Reasons for which the bounds are no guarantee, a tuple of strings: magnetisations and potentials that vary
        within elements.
    source_error
        Change of the co-energy from the currents of the mesh to the given ones, to first order, in J.
    """

    lower: float
    upper: float
    energy: tuple[float, float] | None
    inductance: tuple[float, float] | None
    indicators: Floats
    scalar: SolidField
    vector: EdgeField
    reasons: tuple[str, ...] = ()
    source_error: float = 0.0

    def __repr__(self) -> str:
        return f"<Bracket: {self.summary}>"

    @property
    def guaranteed(self) -> bool:
        """True if `reasons` is empty."""
        return not self.reasons

    @property
    def width(self) -> float:
        """Difference of the bounds, relative to the larger magnitude."""
        largest = max(abs(self.lower), abs(self.upper))
        return (self.upper - self.lower) / largest if largest else 0.0

    @property
    def summary(self) -> str:
        """Sentence part with both bounds, their distance and their guarantee."""
        bounds, name = (self.lower, self.upper), "co-energy"
        if self.energy is not None:
            bounds, name = self.energy, "energy"
        first, last = (significant(value, 6) for value in bounds)
        sure = "guaranteed" if self.guaranteed else f"no guarantee, because {' and '.join(self.reasons)}"
        if abs(self.source_error) > UNIFORM * abs(self.upper):
            share = 100.0 * abs(self.source_error) / max(abs(self.lower), abs(self.upper))
            sure += f" up to the currents of the mesh, which change it by {share:.1g} % (included)"
        return f"{name} between {first} and {last} J, {100.0 * self.width:.2g} % apart; {sure}"


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
        A mesh of tetrahedra in metres, for instance from `kohonen_adapt.adapt`.
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
    problem = MagneticScalarPotential(materials, potential, applied_field, symmetry, coils=coils)
    return bracket_of(problem, problem.solve(mesh))


def bracket_of(problem: MagneticScalarPotential, field: SolidField) -> Bracket:
    vector = problem.vector_potential.solve(field.mesh)
    scalar = with_currents_of(vector, field)
    indicators, upper = gap_indicators(scalar, vector), scalar.coenergy
    source_error = vector.drive.work_of_difference(vector.flux_density)
    lower = upper - 0.5 * float(np.sum(indicators**2)) + source_error
    upper += max(source_error, 0.0)
    coils, sign = tuple((problem.coils or {}).values()), sign_of_energy(problem)
    energy = {1: (lower, upper), -1: (-upper, -lower)}.get(sign)
    inductance = None
    if len(coils) == 1 and problem.applied_field is None and sign == 1:
        inductance = 2.0 * lower / coils[0].ampere_turns ** 2, 2.0 * upper / coils[0].ampere_turns ** 2
    reasons = reasons_against_guarantee(problem, field.mesh)
    return Bracket(lower, upper, energy, inductance, indicators, field, vector, reasons, source_error)


def sign_of_energy(problem: MagneticScalarPotential) -> int:
    """Return 1 or -1 if the energy is that fraction of the co-energy, else 0."""
    materials, given = problem.materials.values(), (problem.potential or {}).values()
    magnets = any(each.coercivity is not None or callable(each.remanence) or any(each.remanence) for each in materials)
    if not magnets and all(each.bh is None for each in materials):
        return 1
    return -int(problem.free_field is None and all(not callable(value) and value == 0.0 for value in given))


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
