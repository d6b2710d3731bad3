"""Close an open boundary by a Robin condition: beyond a circle the field is that of a dipole at its centre."""

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.magnetostatics.equations.elements import Elements
from kohonen_adapt.magnetostatics.equations.symmetry import Symmetry
from kohonen_adapt.magnetostatics.materials.laws import VACUUM_PERMEABILITY
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.names import named

__all__ = ["circle_of", "robin_matrix"]

ROUND = 1e-3  # of the radius: nodes of an open boundary lie this near to its circle


def robin_matrix(elements: Elements, name: str, symmetry: Symmetry) -> csc_array:
    """The matrix of ``int nu0' / R0 u v ds`` over the boundary of that name, (nunknowns, nunknowns).

    In the air beyond a circle the potential of a dipole falls like 1 / r, so ``nu0 dA/dn + nu0 / R0 A = 0``; beyond a
    sphere that of a ring does like 1 / r^2, so that u = r A falls like 1 / r, too, and the condition for u is the same.

    Raises
    ------
    ValueError
        If the mesh lacks the boundary, or it lies not on one circle.
    """
    mesh = elements.mesh
    facets = np.asarray(named(mesh.boundaries, name, "boundary"))
    number_facets(mesh)
    inside = int(np.count_nonzero(mesh.f2t[1, facets] >= 0))
    if facets.size == 0 or inside:
        raise ValueError(
            f"the open boundary {name!r} must lie on the outer boundary of the mesh, all of it; "
            f"{inside} of its {facets.size} facets are inside."
        )
    start, end = mesh.facets[:, facets]
    (a, b), size = (mesh.p[:, ends] for ends in (start, end)), circle_of(mesh, name)[1]
    weight = symmetry.weight(0.5 * (a + b)) / (VACUUM_PERMEABILITY * size) * np.hypot(*(b - a))
    unknowns, count = elements.on_facets(facets), elements.places.shape[1]
    row, column = np.broadcast_arrays(unknowns[:, None], unknowns[None])
    values = elements.facet_products[:, :, None] * weight
    return coo_array((values.ravel(), (row.ravel(), column.ravel())), shape=(count, count)).tocsc()


def circle_of(mesh: MeshTri, name: str) -> tuple[Floats, float]:
    """Centre (2,) and radius of the circle that a boundary lies on, by least squares.

    Raises
    ------
    ValueError
        If its nodes lie on no circle, up to 1e-3 of the radius.
    """
    x = mesh.p[:, np.unique(mesh.facets[:, np.asarray(mesh.boundaries[name])])]
    middle = x.mean(axis=1, keepdims=True)
    scale = np.max(np.abs(x - middle))
    near = (x - middle) / scale
    solution, _, rank, _ = np.linalg.lstsq(np.vstack((2.0 * near, np.ones(x.shape[1]))).T, np.sum(near**2, axis=0))
    centre = middle[:, 0] + scale * solution[:2]
    distance = np.hypot(*(x - centre[:, None]))
    radius = float(distance.mean())
    if rank < 3 or np.ptp(distance) > 2.0 * ROUND * radius:
        raise ValueError(
            f"the open boundary {name!r} must be a circle, or an arc; its nodes are {distance.min():.6g} to "
            f"{distance.max():.6g} m from the best centre. Draw the outer boundary as a circle, or fix A on it."
        )
    return centre, radius
