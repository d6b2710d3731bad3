"""Curved sides of a `MeshTri2`, as straight triangles with midside offsets.

A side with ends a, b and midside node m is the parabola through these points, with the midside offset
``d = m - (a + b) / 2`` (`midside_offsets`). An element is the image of ``x = sum_i lambda_i x_i + 4 sum_k lambda_i
lambda_j d_k``, where side k lies opposite to corner k, between i and j.
"""

import numpy as np
from skfem import MeshTri, MeshTri2
from skfem.mesh import MeshTri1

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.host import number_facets, of_kind

__all__ = [
    "AFTER",
    "BEFORE",
    "check_curved_sides",
    "check_midsides",
    "corner_positions",
    "corners_of",
    "facet_midside_offsets",
    "is_second_order",
    "jacobian_coefficients",
    "midside_offsets",
    "nodes_of_elements",
    "with_midside_offsets",
    "with_midsides",
    "with_side_offsets",
]

LATTICE = 10  # steps along a side of the lattice for determinants that the Bernstein bound leaves undecided
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]  # ends of the side opposite to each corner
OPPOSITE = [1, 2, 0]  # rows of `t2f` by opposite corner; scikit-fem orders facets as corners 01, 12, 02


def is_second_order(mesh: object) -> bool:
    return type(mesh) is MeshTri2


def corners_of(mesh: MeshTri) -> MeshTri:
    return of_kind(MeshTri1, mesh.p[:, : mesh.nvertices], mesh) if is_second_order(mesh) else mesh


def corner_positions(mesh: MeshTri) -> Floats:
    return np.moveaxis(mesh.p[:, mesh.t], (0, 1, 2), (2, 1, 0))


def nodes_of_elements(mesh: MeshTri) -> Ints:
    """Return the nodes of elements, (nelements, 3) or (nelements, 6).

    The midside nodes of a `MeshTri2` follow the corners, for the sides 01, 12, 20, as in Gmsh and VTK.
    """
    return np.vstack([mesh.t, mesh.nvertices + mesh.t2f]).T if is_second_order(mesh) else mesh.t.T


def with_midsides(mesh: MeshTri, middles: Floats) -> MeshTri2:
    return of_kind(MeshTri2, np.hstack([mesh.p[:, : mesh.nvertices], middles]), mesh)


def with_midside_offsets(mesh: MeshTri, off: Floats) -> MeshTri2:
    number_facets(mesh)
    return with_midsides(mesh, mesh.p[:, mesh.facets].mean(axis=1) + off)


def with_side_offsets(mesh: MeshTri, off: Floats) -> MeshTri:
    if not off.any():
        return mesh
    number_facets(mesh)
    bent = np.zeros(mesh.facets.shape)
    for k, row in enumerate(OPPOSITE):
        bent[:, mesh.t2f[row]] = off[:, k].T
    return with_midside_offsets(mesh, bent)


def facet_midside_offsets(mesh: MeshTri) -> Floats:
    number_facets(mesh)
    if not is_second_order(mesh):
        return np.zeros(mesh.facets.shape)
    return mesh.p[:, mesh.nvertices :] - mesh.p[:, mesh.facets].mean(axis=1)


def midside_offsets(mesh: MeshTri) -> Floats:
    """Return the midside offsets of elements, (nelements, 3, 2).

    Row k belongs to the side opposite to corner k of ``mesh.t``. Offsets of straight sides are zero.
    """
    return facet_midside_offsets(mesh).T[mesh.t2f[OPPOSITE].T]


def jacobian_coefficients(corners: Floats, bent: Floats) -> Floats:
    """Return the Bernstein coefficients of the Jacobian determinants, (m, 6).

    `bent`, shape (m, 3, 2), are the midside offsets of the sides opposite to the corners. The first three coefficients
    are values at the corners, the last three belong to the sides opposite to the corners. The smallest coefficient is a
    lower bound of the determinant. In a straight element all six are twice the signed area. (G. Farin, *Curves and
    Surfaces for CAGD*, chapter 17; A. Johnen, J.-F. Remacle and C. Geuzaine, J. Comput. Phys. 233 (2013).)
    """
    along, across = (derivative(corners, bent, corner) for corner in (1, 2))
    at = cross(along, across)
    between = 0.5 * (cross(along[:, AFTER], across[:, BEFORE]) + cross(along[:, BEFORE], across[:, AFTER]))
    return np.concatenate([at, between], axis=1)


def derivative(corners: Floats, bent: Floats, corner: int) -> Floats:
    """Return the derivative of x by the barycentric coordinate of `corner`.

    Values are at the three corners, (m, 3, 2), and linear between them.
    """
    other = 3 - corner
    straight = corners[:, corner] - corners[:, 0]
    side, beside, far = 4.0 * bent[:, other], 4.0 * bent[:, corner], 4.0 * bent[:, 0]
    found = np.repeat(straight[:, None], 3, axis=1)
    found[:, 0] += side
    found[:, corner] -= side
    found[:, other] += far - beside
    return found


def cross(u: Floats, w: Floats) -> Floats:
    return u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0]


def check_midsides(mesh: MeshTri) -> None:
    number_facets(mesh)
    wanted = mesh.nvertices + mesh.facets.shape[1]
    if mesh.p.shape[1] != wanted or not np.all(np.isfinite(mesh.p)):
        raise ValueError(
            f"a MeshTri2 must have a finite node for every corner and every side, {wanted} in all; got "
            f"{int(np.sum(np.isfinite(mesh.p).all(axis=0)))}. Make it with MeshTri2.from_mesh and set its doflocs."
        )


def check_curved_sides(mesh: MeshTri) -> None:
    folded = np.flatnonzero(~(least_determinants(mesh) > 0.0))
    if len(folded):
        raise ValueError(
            f"the bent sides of a MeshTri2 must not fold its elements over; {len(folded)} are, the first is element "
            f"{folded[0]}. Draw its mid-side nodes nearer to their chords, as kohonen_adapt.relocate does, or keep its "
            "corners only: MeshTri(mesh.p[:, :mesh.nvertices], mesh.t)."
        )


def least_determinants(mesh: MeshTri) -> Floats:
    corners, bent = corner_positions(mesh), midside_offsets(mesh)
    coefficients = jacobian_coefficients(corners, bent)
    coefficients *= np.sign(jacobian_coefficients(corners, np.zeros_like(bent))[:, :1])
    least = coefficients.min(axis=1)
    doubtful = np.flatnonzero(least <= 0.0)
    one, two = (share.ravel() / LATTICE for share in np.mgrid[: LATTICE + 1, : LATTICE + 1])
    a, b, c = (share[one + two <= 1.0 + 1e-9] for share in (1.0 - one - two, one, two))
    shares = np.stack([a * a, b * b, c * c, 2.0 * b * c, 2.0 * c * a, 2.0 * a * b])
    least[doubtful] = (coefficients[doubtful] @ shares).min(axis=1)
    return least
