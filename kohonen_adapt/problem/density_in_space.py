"""Integrand of a Ritz functional on tetrahedra."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import flux_table, value_by_region

__all__ = ["density_in_space", "shifted_slope"]


def density_in_space(slope: Floats, region: Ints, ritz: Ritz) -> Floats:
    # Return the integrand without the source for gradients (3, m), shape (m,).
    square = np.sum(slope**2, axis=0)
    density = 0.5 * value_by_region(np.asarray(ritz.coefficient), region) * square
    if any(ritz.laws):
        square = np.sum(shifted_slope(slope, region, ritz) ** 2, axis=0)
    for k, law in enumerate(ritz.laws):
        if law is not None:
            rows = region == k
            density[rows] = law.energy(np.sqrt(square[rows]))
    for part, along in zip(flux_table(np.asarray(ritz.flux), TETRAHEDRON.dim), slope, strict=True):
        density -= value_by_region(part, region) * along
    return density


def shifted_slope(slope: Floats, region: Ints, ritz: Ritz) -> Floats:
    nonlinear = np.array([law is not None for law in ritz.laws] or [False])
    table = flux_table(np.asarray(ritz.shift), TETRAHEDRON.dim)
    shift = np.stack([value_by_region(part, region) * np.ones(slope.shape[1]) for part in table])
    return slope - np.where(nonlinear[region] if ritz.laws else False, shift, 0.0)
