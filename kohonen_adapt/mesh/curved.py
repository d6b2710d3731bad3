"""Curved sides of a `MeshTri2` or `MeshTet2`, and points in curved triangles.

A side with ends a, b and midside node m is the parabola through these points, with the midside offset
``d = m - (a + b) / 2`` (`midside_offsets`). An element is the image of ``x = sum_i lambda_i x_i + 4 sum_k lambda_i
lambda_j d_k``, where side k lies opposite to corner k, between i and j.
"""

from functools import cached_property

import numpy as np
from scipy.spatial import KDTree
from skfem import Mesh, MeshTet2, MeshTri, MeshTri2
from skfem.mesh import MeshTet1, MeshTri1

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.host import number_edges, number_facets, of_kind

__all__ = [
    "AFTER",
    "BEFORE",
    "CurvedElements",
    "Isoparametric",
    "check_inverted",
    "check_midsides",
    "corner_positions",
    "corners_of",
    "facet_midside_offsets",
    "is_second_order",
    "jacobian_coefficients",
    "least_determinants",
    "midside_offsets",
    "nodes_of_elements",
    "refined",
    "with_midside_offsets",
    "with_midsides",
    "with_side_offsets",
]

LATTICE = 10  # steps along a side of the lattice for determinants that the Bernstein bound leaves undecided
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]  # ends of the side opposite to each corner
OPPOSITE = [1, 2, 0]  # rows of `t2f` by opposite corner; scikit-fem orders facets as corners 01, 12, 02
STRAIGHT = 1e-10  # midside offset below which a side is straight, relative to its chord
INSIDE = 1e-9  # tolerance for negative barycentric coordinates of a point inside
MOST_STEPS = 20  # maximum iterations of Newton's method, which needs four to six
SETTLED = 1e-8  # step after which the next step is rounding error
NEAR = 4  # number of nearest boundary sides tried for a point beyond the chords
WALK = 12  # maximum steps from element to element


def is_second_order(mesh: object) -> bool:
    return type(mesh) in (MeshTri2, MeshTet2)


def corners_of(mesh: Mesh) -> Mesh:
    if not is_second_order(mesh):
        return mesh
    return of_kind(MeshTri1 if type(mesh) is MeshTri2 else MeshTet1, mesh.p[:, : mesh.nvertices], mesh)


def corner_positions(mesh: MeshTri) -> Floats:
    return np.moveaxis(mesh.p[:, mesh.t], (0, 1, 2), (2, 1, 0))


def nodes_of_elements(mesh: MeshTri) -> Ints:
    # (nelements, k): corners, then midside nodes, for the sides 01, 12, 20 of triangles, as in Gmsh and VTK, and the
    # edges 01, 12, 02, 03, 13, 23 of tetrahedra, as in VTK
    if not is_second_order(mesh):
        return mesh.t.T
    number_edges(mesh)
    return np.vstack([mesh.t, mesh.nvertices + (mesh.t2f if type(mesh) is MeshTri2 else mesh.t2e)]).T


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


def check_midsides(mesh: Mesh) -> None:
    number_facets(mesh)
    number_edges(mesh)
    kind, sides = type(mesh).__name__, mesh.facets if type(mesh) is MeshTri2 else mesh.edges
    wanted = mesh.nvertices + sides.shape[1]
    if mesh.p.shape[1] != wanted or not np.all(np.isfinite(mesh.p)):
        raise ValueError(
            f"a {kind} must have a finite node for every corner and every side, {wanted} in all; got "
            f"{int(np.sum(np.isfinite(mesh.p).all(axis=0)))}. Make it with {kind}.from_mesh and set its doflocs."
        )


def check_inverted(kind: str, inverted: Ints) -> None:
    if len(inverted):
        raise ValueError(
            f"the curved sides of a {kind} must not invert elements; {len(inverted)} are inverted, first element "
            f"{inverted[0]}. Draw its midside nodes nearer to their chords, as kohonen_adapt.relocate does, or keep "
            f"its corners only: {kind.removesuffix('2')}(mesh.p[:, :mesh.nvertices], mesh.t)."
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


class CurvedElements:
    """Triangles with curved sides, images of a quadratic map.

    For the side k between corners a and b, opposite to corner k, with midside offset ``offset_k``, ``x = sum lambda_k
    corner_k + 4 sum lambda_a lambda_b offset_k``. Methods take element indices (n,), barycentric
    coordinates (3, n) and points (2, n).
    """

    def __init__(self, p: Floats, t: Ints, offset: Floats, neighbour: Ints) -> None:
        self.p, self.t = p, t  # (2, nnodes), (3, nelements)
        self.offset = offset  # (2, 3, nelements): midside offsets
        self.neighbour = neighbour  # (3, nelements): neighbours across the sides, -1 for none

    @property
    def curved_sides(self) -> Mask:
        # (corners, nelements): sides opposite to the corners
        return np.any(self.offset, axis=0)

    @cached_property
    def curved(self) -> Mask:
        return np.any(self.offset, axis=(0, 1), keepdims=True)[0, 0]

    def points(self, element: Ints, barycentric: Floats) -> Floats:
        x = np.einsum("in,cin->cn", barycentric, self.p[:, self.t[:, element]])
        rows = np.flatnonzero(self.curved[element])
        if rows.size:
            between = barycentric[AFTER] * barycentric[BEFORE]
            x[:, rows] += 4.0 * np.sum(between[:, rows] * self.offset[:, :, element[rows]], axis=1)
        return x

    def barycentric_coordinates(self, element: Ints, x: Floats) -> Floats:
        # Newton's method starts from the coordinates in the straight triangle. If the iteration does not converge,
        # for instance outside the element, the coordinates in the straight triangle are returned.
        return self._newton(element, x)[0]

    def _newton(self, element: Ints, x: Floats) -> tuple[Floats, Mask]:
        barycentric = self.in_straight(self.p[:, self.t[:, element]], x)
        rows = np.flatnonzero(self.curved[element])
        now, converged = barycentric[:, rows], ~self.curved[element]
        done = converged[rows]
        with np.errstate(all="ignore"):  # the iteration may diverge for points far away
            for _ in range(MOST_STEPS):
                if done.all():
                    break
                residual = x[:, rows] - self.points(element[rows], now)
                step = np.einsum("cn,cin->in", residual, self.hat_gradients(element[rows], now))
                now = np.where(done, now, now + step)
                done |= np.abs(step).max(axis=0) < SETTLED
        barycentric[:, rows], converged[rows] = np.where(done, now, barycentric[:, rows]), done
        return barycentric, converged

    def in_straight(self, corner: Floats, x: Floats) -> Floats:
        (ax, ay), (bx, by) = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        x0, y0 = x - corner[:, 0]
        second, third = (x0 * by - y0 * bx) / (ax * by - ay * bx), (ax * y0 - ay * x0) / (ax * by - ay * bx)
        return np.stack((1.0 - second - third, second, third))

    def hat_gradients(self, element: Ints, barycentric: Floats) -> Floats:
        corner, offset = self.p[:, self.t[:, element]], self.offset[:, :, element]
        rate = corner + 4.0 * (offset[:, BEFORE] * barycentric[AFTER] + offset[:, AFTER] * barycentric[BEFORE])
        (a, b), (c, d) = rate[:, 1:] - rate[:, :1]
        return np.stack((np.stack((c - d, d, -c)), np.stack((b - a, -b, a)))) / (a * d - b * c)

    def walk(self, element: Ints, x: Floats) -> Ints:
        element, active = element.copy(), np.arange(element.size)
        for _ in range(WALK):
            if not active.size:
                break
            at, own = element[active], np.arange(active.size)
            barycentric, converged = self._newton(at, x[:, active])
            barycentric[self.neighbour[:, at] < 0] = np.inf
            side = np.argmin(barycentric, axis=0)
            continues = (self.neighbour[side, at] >= 0) & ~(converged & (barycentric[side, own] >= -INSIDE))
            active = active[continues]
            element[active] = self.neighbour[side, at][continues]
        return element

    def locate(self, x: Floats, straight: Ints) -> tuple[Ints, Floats]:
        """Return the element of every point, -1 outside, and barycentric coordinates.

        `straight` contains the straight elements that hold the points, -1 for none.
        """
        element = straight.astype(np.int64)
        if self.curved.any():
            rows = np.flatnonzero((element >= 0) & self.curved[element])
            found = self.walk(element[rows], x[:, rows])
            element[rows] = np.where(self._contain(found, x[:, rows]), found, -1)
            rows = np.flatnonzero((element < 0) & np.isfinite(x).all(axis=0))
            element[rows] = self._beyond_chords(x[:, rows])
        barycentric = np.full((len(self.t), element.size), np.nan)
        rows = np.flatnonzero(element >= 0)
        barycentric[:, rows] = self.barycentric_coordinates(element[rows], x[:, rows])
        return element, barycentric

    def _contain(self, element: Ints, x: Floats) -> Mask:
        barycentric, converged = self._newton(element, x)
        return converged & (barycentric.min(axis=0) >= -INSIDE)

    def _beyond_chords(self, x: Floats) -> Ints:
        element = np.full(x.shape[1], -1)
        side, own = np.nonzero(self.curved_sides & (self.neighbour < 0))
        if own.size and element.size:
            corner = np.arange(len(self.t))[:, None]
            middle = self.points(own, np.where(side == corner, 0.0, 1.0 / (len(corner) - 1)))
            near = KDTree(middle.T).query(x.T, k=range(1, 1 + min(NEAR, own.size)))[1]
            for start in own[near.T]:
                rows = np.flatnonzero(element < 0)
                tried = self.walk(start[rows], x[:, rows])
                element[rows] = np.where(self._contain(tried, x[:, rows]), tried, -1)
        return element


class Isoparametric(CurvedElements):
    def __init__(self, mesh: MeshTri) -> None:
        self.corners = corners = corners_of(mesh)  # with the same elements, facets and names
        number_facets(corners)
        start, end = corners.p[:, corners.facets].swapaxes(0, 1)
        offset, sides = facet_midside_offsets(mesh), corners.t2f[AFTER]
        curved = np.hypot(*offset) > STRAIGHT * np.hypot(*(end - start))
        self.facet_offset = np.where(curved, offset, 0.0)  # (2, nfacets)
        neighbour = corners.f2t.sum(axis=0)[sides] - np.arange(sides.shape[1])  # -1 at the outer boundary
        super().__init__(corners.p, corners.t, self.facet_offset[:, sides], neighbour)


def refined(mesh: MeshTri) -> MeshTri:
    shape = Isoparametric(mesh)
    straight, nodes = shape.corners.refined(), shape.corners.nvertices
    if not is_second_order(mesh):
        return straight
    number_facets(straight)
    parent = np.tile(np.arange(mesh.t.shape[1]), 4)  # scikit-fem lists the first child of all elements, then the second
    corner = np.concatenate([np.eye(3), 0.5 - 0.5 * np.eye(3)], axis=1)  # and midpoints by opposite corner
    own = np.vstack([shape.t, nodes + shape.corners.t2f[OPPOSITE]])[:, parent]  # nodes of an element, refined
    # (3 nodes, 3, nelements)
    barycentric = np.stack([corner[:, np.argmax(own == node, axis=0)] for node in straight.t])
    p = np.empty((2, straight.nvertices + straight.facets.shape[1]))
    for node, at in zip(straight.t, barycentric, strict=True):
        p[:, node] = shape.points(parent, at)
    for row, (a, b) in zip(OPPOSITE, zip(AFTER, BEFORE, strict=True), strict=True):
        p[:, straight.nvertices + straight.t2f[row]] = shape.points(parent, 0.5 * (barycentric[a] + barycentric[b]))
    return of_kind(MeshTri2, p, straight)
