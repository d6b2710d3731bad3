"""Materials of a functional, which decide where its minimiser is singular."""

import numpy as np
from skfem import MeshTri

from kohonen_adapt.mesh.corners import Materials, fixed_parts
from kohonen_adapt.problem.ritz import Ritz

__all__ = ["materials_of"]


def materials_of(mesh: MeshTri, ritz: Ritz) -> Materials:
    region = np.zeros(mesh.t.shape[1], dtype=np.int64) if ritz.region is None else np.asarray(ritz.region)
    flux = None if callable(ritz.flux) else np.asarray(ritz.flux, dtype=float)
    # the mesh need not have every region of the coefficients
    given = [np.size(ritz.coefficient), len(ritz.laws), flux.shape[1] if flux is not None and flux.ndim == 2 else 1]
    regions = max(int(region.max()) + 1, *given)
    numbers = {id(law): number for number, law in enumerate(ritz.laws)}
    law = np.array([numbers[id(law)] for law in ritz.laws] or [0] * regions)
    if flux is not None:
        flux = np.broadcast_to(flux if flux.ndim == 2 else np.reshape(flux, (-1, 1)), (2, regions))
    coefficient = np.broadcast_to(np.asarray(ritz.coefficient, dtype=float), regions)
    values = np.arange(regions)[None] if flux is None else flux
    kind = np.unique(np.stack([coefficient, law, *values]), axis=1, return_inverse=True)[1].ravel()
    fixed = fixed_parts(mesh, np.asarray(ritz.fixed), ritz.order)
    return Materials(coefficient[region], kind[region], None if flux is None else flux[:, region], *fixed)
