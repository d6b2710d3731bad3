"""Difference of the fields of both potentials, and the bounds that follow."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.display import significant
from kohonen_adapt.magnetostatics.materials.laws import Inverse
from kohonen_adapt.magnetostatics.quantities.edge_field import EdgeField
from kohonen_adapt.magnetostatics.quantities.solid_field import SolidField
from kohonen_adapt.mesh.measures import magnitude

Solid = TypeVar("Solid", bound=SolidField)

__all__ = ["UNIFORM", "Bracket", "gap_indicators", "with_currents_of"]


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
            sure += f" up to the currents of the mesh, which change it by {significant(share, 1)} % (included)"
        return f"{name} between {first} and {last} J, {significant(100.0 * self.width, 2)} % apart; {sure}"


def gap_indicators(scalar: SolidField, vector: EdgeField) -> Floats:
    """Return the difference of both fields in the energy norm, (nelements,).

    In sqrt(J). The square is ``2 int w(B) + w*(H) - B . H`` with B of the vector potential, H of the scalar potential,
    and the energy and co-energy densities w and w*. For linear material it is ``int nu |B - mu (H + Hc)|^2``. Both
    fields have the same currents, see `with_currents_of`.
    """
    at, elements = scalar.at_quadrature, scalar.elements
    driven, density = at.field_strength + at.coefficients.coercivity, vector.flux_density[:, elements.element]
    difference = density - at.coefficients.permeabilities(at.field_strength)[0] * driven
    gap = 0.5 * np.sum(at.coefficients.reluctivity * difference**2, axis=0)
    for group in at.coefficients.nonlinear_materials:
        rows = group.elements
        b, h = magnitude(density[:, rows]), magnitude(driven[:, rows])
        law = group.law.energy(b) + Inverse(group.law).energy(h) - np.sum(density[:, rows] * driven[:, rows], axis=0)
        gap[rows] = np.maximum(law, 0.0)  # rounding
    return np.sqrt(2.0 * scalar.volume * elements.mean(gap))


def with_currents_of(vector: EdgeField, scalar: Solid) -> Solid:
    return scalar if vector.drive.function is None else replace(scalar, drive=vector.drive)
