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


def with_midsides(mesh: MeshTri, midsides: Floats) -> MeshTri2:
    return of_kind(MeshTri2, np.hstack([mesh.p[:, : mesh.nvertices], midsides]), mesh)


def with_midside_offsets(mesh: MeshTri, offset: Floats) -> MeshTri2:
    number_facets(mesh)
    return with_midsides(mesh, mesh.p[:, mesh.facets].mean(axis=1) + offset)


def with_side_offsets(mesh: MeshTri, offset: Floats) -> MeshTri:
    if not offset.any():
        return mesh
    number_facets(mesh)
    of_facet = np.zeros(mesh.facets.shape)
    for k, row in enumerate(OPPOSITE):
        of_facet[:, mesh.t2f[row]] = offset[:, k].T
    return with_midside_offsets(mesh, of_facet)


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


def jacobian_coefficients(corners: Floats, offset: Floats) -> Floats:
    """Return the Bernstein coefficients of the Jacobian determinants, (m, 6).

    `offset`, shape (m, 3, 2), are the midside offsets of the sides opposite to the corners. The first three
    coefficients are values at the corners, the last three belong to the sides opposite to the corners. The smallest
    coefficient is a lower bound of the determinant. In a straight element all six are twice the signed area. (G. Farin,
    *Curves and Surfaces for CAGD*, chapter 17; A. Johnen, J.-F. Remacle and C. Geuzaine, J. Comput. Phys. 233 (2013).)
    """
    along, across = (derivative(corners, offset, corner) for corner in (1, 2))
    at = cross(along, across)
    between = 0.5 * (cross(along[:, AFTER], across[:, BEFORE]) + cross(along[:, BEFORE], across[:, AFTER]))
    return np.concatenate([at, between], axis=1)


def derivative(corners: Floats, offset: Floats, corner: int) -> Floats:
    """Return the derivative of x by the barycentric coordinate of `corner`.

    Values are at the three corners, (m, 3, 2), and linear between them.
    """
    other = 3 - corner
    straight = corners[:, corner] - corners[:, 0]
    first, second, third = 4.0 * offset[:, other], 4.0 * offset[:, corner], 4.0 * offset[:, 0]
    found = np.repeat(straight[:, None], 3, axis=1)
    found[:, 0] += first
    found[:, corner] -= first
    found[:, other] += third - second
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
    inverted = np.flatnonzero(~(least_determinants(mesh) > 0.0))
    if len(inverted):
        raise ValueError(
            f"the curved sides of a MeshTri2 must not invert elements; {len(inverted)} are inverted, first element "
            f"{inverted[0]}. Draw its midside nodes nearer to their chords, as kohonen_adapt.relocate does, or keep "
            "its corners only: MeshTri(mesh.p[:, :mesh.nvertices], mesh.t)."
        )


def least_determinants(mesh: MeshTri) -> Floats:
    corners, offset = corner_positions(mesh), midside_offsets(mesh)
    coefficients = jacobian_coefficients(corners, offset)
    coefficients *= np.sign(jacobian_coefficients(corners, np.zeros_like(offset))[:, :1])
    least = coefficients.min(axis=1)
    doubtful = np.flatnonzero(least <= 0.0)
    second, third = (index.ravel() / LATTICE for index in np.mgrid[: LATTICE + 1, : LATTICE + 1])
    a, b, c = (coordinate[second + third <= 1.0 + 1e-9] for coordinate in (1.0 - second - third, second, third))
    bernstein = np.stack([a * a, b * b, c * c, 2.0 * b * c, 2.0 * c * a, 2.0 * a * b])
    least[doubtful] = (coefficients[doubtful] @ bernstein).min(axis=1)
    return least
