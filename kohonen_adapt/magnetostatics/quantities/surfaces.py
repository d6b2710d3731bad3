"""Named surfaces in space with the direction in which a flux counts."""

import numpy as np
from skfem import MeshTet
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.symmetry import surface
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.measures import directed, unit_vectors

__all__ = ["oriented_surface"]

EDGEWISE = 0.1  # cosine between the normal of a facet and of its surface, below which the facet has no side


def oriented_surface(mesh: MeshTet, name: str) -> tuple[Ints, Floats, Floats]:
    """Return the facets of a surface, their normals, and the sign of their flux.

    The normals, (3, nfacets), point out of the first element and have the length of the area; the sign is 1 if the flux
    counts along the normal, else -1.
    """
    surface(mesh, name, "flux")
    rows = mesh.boundaries[name]
    facets = np.asarray(rows)
    if not facets.size:
        raise ValueError(f"the surface {name!r} has no facets; name one that has.")
    normal = 0.5 * normals(mesh.p.T, directed(mesh, facets)).T
    if isinstance(rows, OrientedBoundary):
        return facets, normal, np.where(rows.ori == 0, 1.0, -1.0)
    if np.all(mesh.f2t[1, facets] < 0):
        return facets, normal, np.ones(facets.size)
    unit = unit_vectors(normal)
    mean_normal = np.linalg.eigh(normal @ unit.T)[1][:, -1]
    along = (mean_normal * np.sign(mean_normal[np.argmax(np.abs(mean_normal))])) @ unit
    if np.abs(along).min() < EDGEWISE:
        raise ValueError(
            f"the surface {name!r} inside the mesh turns too far to have one normal direction; orient it by a "
            "skfem.OrientedBoundary, or name parts of it."
        )
    return facets, normal, np.sign(along)
