"""Difference of the fields of both potentials, a bound of their errors."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.materials.laws import Inverse
from kohonen_adapt.magnetostatics.quantities.edge_field import EdgeField
from kohonen_adapt.magnetostatics.quantities.local_solid import LocalSolid
from kohonen_adapt.mesh.measures import magnitude

Solid = TypeVar("Solid", bound=LocalSolid)

__all__ = ["gap_indicators", "with_currents_of"]


def gap_indicators(scalar: LocalSolid, vector: EdgeField) -> Floats:
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
