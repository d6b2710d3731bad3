"""Tell the straight triangles of a `MeshTri2` from how far its mid-side nodes are off their chords, and join the two.

A side with the ends a, b and the mid-side node m is the parabola through the three; what bends it is its displacement
``d = m - (a + b) / 2``. An element is ``x = sum_i lambda_i x_i + 4 sum_k lambda_i lambda_j d_k`` for d_k of the side
opposite to corner k, between i and j.
"""

import numpy as np
from skfem import MeshTri, MeshTri2
from skfem.mesh import MeshTri1

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.host import number_facets, of_kind

__all__ = [
    "AFTER",
    "BEFORE",
    "check_bent",
    "check_middles",
    "corner_places",
    "corners_of",
    "displacements",
    "facet_displacements",
    "is_second_order",
    "jacobian_coefficients",
    "nodes_of_elements",
    "with_displacements",
    "with_middles",
    "with_sides",
]

LATTICE = 10  # steps along a side between the points at which a doubtful determinant is looked at
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]  # the corners that the side opposite to each corner joins
OPPOSITE = [1, 2, 0]  # rows of `t2f` by the corner opposite: scikit-fem's facets of an element are corners 01, 12, 02


def is_second_order(mesh: object) -> bool:
    """Whether a mesh has mid-side nodes, bent or not."""
    return type(mesh) is MeshTri2


def corners_of(mesh: MeshTri) -> MeshTri:
    """The straight triangles between the corners of a mesh, with every name; a `MeshTri` is returned as it is."""
    return of_kind(MeshTri1, mesh.p[:, : mesh.nvertices], mesh) if is_second_order(mesh) else mesh


def corner_places(mesh: MeshTri) -> Floats:
    """Where the corners of elements are, (nelements, 3, 2), in the order of ``mesh.t``."""
    return np.moveaxis(mesh.p[:, mesh.t], (0, 1, 2), (2, 1, 0))


def nodes_of_elements(mesh: MeshTri) -> Ints:
    """The nodes of elements, (nelements, 3), of a `MeshTri2` and then those on sides 01, 12, 20, (nelements, 6).

    So have Gmsh and VTK them.
    """
    return np.vstack([mesh.t, mesh.nvertices + mesh.t2f]).T if is_second_order(mesh) else mesh.t.T


def with_middles(mesh: MeshTri, middles: Floats) -> MeshTri2:
    """The `MeshTri2` with the corners of a mesh, every name, and these mid-side nodes of facets, (2, nfacets)."""
    return of_kind(MeshTri2, np.hstack([mesh.p[:, : mesh.nvertices], middles]), mesh)


def with_displacements(mesh: MeshTri, off: Floats) -> MeshTri2:
    """The `MeshTri2` with the corners of a mesh, every name, and its facets (2, nfacets) bent by so much."""
    number_facets(mesh)
    return with_middles(mesh, mesh.p[:, mesh.facets].mean(axis=1) + off)


def with_sides(mesh: MeshTri, off: Floats) -> MeshTri:
    """The mesh with its sides bent as elements have them, (nelements, 3, 2) as of `displacements`.

    Of two elements at a facet the one by its greater number counts. Where no side is bent it is the mesh itself.
    """
    if not off.any():
        return mesh
    number_facets(mesh)
    bent = np.zeros(mesh.facets.shape)
    for k, row in enumerate(OPPOSITE):
        bent[:, mesh.t2f[row]] = off[:, k].T
    return with_displacements(mesh, bent)


def facet_displacements(mesh: MeshTri) -> Floats:
    """How far the mid-side node of every facet is off the middle of its chord, (2, nfacets); 0 on a `MeshTri`."""
    number_facets(mesh)
    if not is_second_order(mesh):
        return np.zeros(mesh.facets.shape)
    return mesh.p[:, mesh.nvertices :] - mesh.p[:, mesh.facets].mean(axis=1)


def displacements(mesh: MeshTri) -> Floats:
    """The displacement of the side opposite to every corner of ``mesh.t``, (nelements, 3, 2); 0 of straight sides."""
    return facet_displacements(mesh).T[mesh.t2f[OPPOSITE].T]


def jacobian_coefficients(corners: Floats, bent: Floats) -> Floats:
    """Bernstein coefficients of the Jacobian determinants of elements, (m, 6); the least is below every value of it.

    `corners` are (m, 3, 2), `bent` the displacements of the sides opposite to them, (m, 3, 2). The determinant is a
    polynomial of degree 2: the first three coefficients are its values at the corners, the others belong to the sides
    opposite to these. Straight elements have their doubled signed area in all six. (G. Farin, *Curves and Surfaces for
    CAGD*, chapter 17; A. Johnen, J.-F. Remacle and C. Geuzaine, J. Comput. Phys. 233 (2013).)
    """
    along, across = (derivative(corners, bent, corner) for corner in (1, 2))
    at = cross(along, across)
    between = 0.5 * (cross(along[:, AFTER], across[:, BEFORE]) + cross(along[:, BEFORE], across[:, AFTER]))
    return np.concatenate([at, between], axis=1)


def derivative(corners: Floats, bent: Floats, corner: int) -> Floats:
    """Derivatives of x from corner 0 towards another one, at the three corners, (m, 3, 2); linear in between."""
    other = 3 - corner
    straight = corners[:, corner] - corners[:, 0]
    side, beside, far = 4.0 * bent[:, other], 4.0 * bent[:, corner], 4.0 * bent[:, 0]
    found = np.repeat(straight[:, None], 3, axis=1)
    found[:, 0] += side
    found[:, corner] -= side
    found[:, other] += far - beside
    return found


def cross(u: Floats, w: Floats) -> Floats:
    """Third component of the cross products of vectors (..., 2)."""
    return u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0]


def check_middles(mesh: MeshTri) -> None:
    """Refuse a `MeshTri2` without a mid-side node for every side."""
    number_facets(mesh)
    wanted = mesh.nvertices + mesh.facets.shape[1]
    if mesh.p.shape[1] != wanted or not np.all(np.isfinite(mesh.p)):
        raise ValueError(
            f"a MeshTri2 must have a finite node for every corner and every side, {wanted} in all; got "
            f"{int(np.sum(np.isfinite(mesh.p).all(axis=0)))}. Make it with MeshTri2.from_mesh and set its doflocs."
        )


def check_bent(mesh: MeshTri) -> None:
    """Refuse a `MeshTri2` with an element that its bent sides fold over."""
    folded = np.flatnonzero(~(least_determinants(mesh) > 0.0))
    if len(folded):
        raise ValueError(
            f"the bent sides of a MeshTri2 must not fold its elements over; {len(folded)} are, the first is element "
            f"{folded[0]}. Draw its mid-side nodes nearer to their chords, as kohonen_adapt.relocate does, or keep its "
            "corners only: MeshTri(mesh.p[:, :mesh.nvertices], mesh.t)."
        )


def least_determinants(mesh: MeshTri) -> Floats:
    """The least Jacobian determinants of the elements of a `MeshTri2`, or bounds below them that are positive."""
    corners, bent = corner_places(mesh), displacements(mesh)
    coefficients = jacobian_coefficients(corners, bent)
    coefficients *= np.sign(jacobian_coefficients(corners, np.zeros_like(bent))[:, :1])
    least = coefficients.min(axis=1)
    doubtful = np.flatnonzero(least <= 0.0)
    one, two = (share.ravel() / LATTICE for share in np.mgrid[: LATTICE + 1, : LATTICE + 1])
    a, b, c = (share[one + two <= 1.0 + 1e-9] for share in (1.0 - one - two, one, two))
    shares = np.stack([a * a, b * b, c * c, 2.0 * b * c, 2.0 * c * a, 2.0 * a * b])
    least[doubtful] = (coefficients[doubtful] @ shares).min(axis=1)
    return least
