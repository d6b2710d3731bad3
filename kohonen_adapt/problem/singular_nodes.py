"""Materials of a functional, which decide where its minimiser is singular."""

import numpy as np
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import centroids_of
from kohonen_adapt.mesh.corners import Materials, fixed_parts
from kohonen_adapt.mesh.host import numbered
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import constants_at, numbers_of

__all__ = ["materials_of", "materials_with"]


def materials_with(
    mesh: Mesh, coefficient: Floats, law: Ints, region: Ints, flux: Floats | None, fixed: Mask, order: int
) -> Materials:
    """Return materials from the coefficient, the law and the flux of every element.

    Without a flux that is constant in materials, regions are materials.
    """
    values = region[None] if flux is None else flux
    kind = numbered_by_regions(np.stack([coefficient, law, *values]), region)
    return Materials(coefficient, kind, flux, *fixed_parts(mesh, fixed, order))


def numbered_by_regions(columns: Floats, region: Ints) -> Ints:
    # Number equal columns alike. Columns that are equal in regions are sorted once per region, not once per element.
    first, within = np.unique(region, return_index=True, return_inverse=True)[1:]
    if not np.array_equal(columns, columns[:, first][:, within]):
        first = within = np.arange(columns.shape[1])
    return numbered(columns[:, first])[within]


def materials_of(mesh: Mesh, ritz: Ritz) -> Materials:
    region = numbers_of(ritz, mesh)
    numbers = {id(law): number for number, law in enumerate(ritz.laws)}
    law = np.array([numbers[id(law)] for law in ritz.laws])[region] if ritz.laws else 0 * region
    coefficient, flux = constants_at(ritz.coefficient, region), None
    if not callable(ritz.flux):  # the shift of a law is a flux where the gradient is small
        flux, shift = (constants_at(each, region, mesh.dim()) for each in (ritz.flux, ritz.shift))
        flux = flux + coefficient * shift
    found = materials_with(mesh, coefficient, law, region, flux, np.asarray(ritz.fixed), ritz.order)
    if callable(ritz.flux) and mesh.dim() == 3:
        return found._replace(flux=np.asarray(ritz.flux(centroids_of(mesh), region)))
    return found
