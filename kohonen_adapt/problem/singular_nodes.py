"""Materials of a functional, which decide where its minimiser is singular."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.corners import Materials, fixed_parts
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.problem.tables import constants_at

__all__ = ["materials_of", "materials_with"]


def materials_with(
    mesh: MeshTri, coefficient: Floats, law: Ints, region: Ints, flux: Floats | None, fixed: Mask, order: int
) -> Materials:
    """Return materials from the coefficient, the law and the flux of every element.

    Without a flux that is constant in materials, regions are materials.
    """
    values = region[None] if flux is None else flux
    kind = np.unique(np.stack([coefficient, law, *values]), axis=1, return_inverse=True)[1].ravel()
    return Materials(coefficient, kind, flux, *fixed_parts(mesh, fixed, order))


def materials_of(mesh: MeshTri, ritz: Ritz) -> Materials:
    region = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
    numbers = {id(law): number for number, law in enumerate(ritz.laws)}
    law = np.array([numbers[id(law)] for law in ritz.laws])[region] if ritz.laws else 0 * region
    flux = None if callable(ritz.flux) else constants_at(ritz.flux, region, 2)
    coefficient = constants_at(ritz.coefficient, region)
    return materials_with(mesh, coefficient, law, region, flux, np.asarray(ritz.fixed), ritz.order)
