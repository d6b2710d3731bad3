"""Curved sides of a `MeshTri2` or `MeshTet2`, and points in curved elements.

A side with ends a, b and midside node m is the parabola through these points, with the midside offset
``d = m - (a + b) / 2``. An element is the image of ``x = sum_i lambda_i x_i + 4 sum_k lambda_a lambda_b d_k``, where
side k joins the corners a and b of `Cell.edges`; in the plane it lies opposite to corner k. Offsets have shape (d,
nsides) for the sides of a mesh, its facets in the plane and its edges in space, and (d, sides, m) for elements.
"""

from functools import cached_property
from itertools import product
from math import factorial

import numpy as np
from scipy.spatial import KDTree
from skfem import Mesh, MeshTri, MeshTri2

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, IntsPair, Mask
from kohonen_adapt.mesh.cells import CELLS, TRIANGLE, cell_of, determinants
from kohonen_adapt.mesh.host import number_edges, number_facets, of_kind

__all__ = [
    "AFTER",
    "BEFORE",
    "CurvedElements",
    "Isoparametric",
    "all_points",
    "check_curved_sides",
    "check_midsides",
    "corners_of",
    "curved_determinants",
    "determinant_coefficients",
    "inverted_elements",
    "is_second_order",
    "midside_offsets",
    "nodes_of_elements",
    "numbered_sides",
    "offsets_of_sides",
    "refined",
    "tangent_corners",
    "with_midside_offsets",
    "with_midsides",
]

LATTICE = 10  # steps along a side of the lattice for determinants that the Bernstein bound leaves undecided
AFTER, BEFORE = np.transpose(TRIANGLE.edges).tolist()  # ends of the side opposite to each corner
STRAIGHT = 1e-10  # midside offset below which a side is straight, relative to its chord
INSIDE = 1e-9  # tolerance for negative barycentric coordinates of a point inside
MOST_STEPS = 20  # maximum iterations of Newton's method, which needs four to six
SETTLED = 1e-8  # step after which the next step is rounding error
NEAR = 4  # number of nearest boundary sides tried for a point beyond the chords
WALK = 12  # maximum steps from element to element


def _coefficients(dim: int) -> tuple[Ints, Ints, Mask]:
    # The corners (k, d) of the Bernstein coefficients of determinants, the number of orders of these corners (k,), and
    # the orders of each among all choices of d corners (k, n).
    orders = np.sort(list(product(range(dim + 1), repeat=dim)), axis=1)
    corners, own, count = np.unique(orders, axis=0, return_inverse=True, return_counts=True)
    return corners, count, own.ravel() == np.arange(len(corners))[:, None]


COEFFICIENTS = {dim: _coefficients(dim) for dim in CELLS}


def is_second_order(mesh: object) -> bool:
    return type(mesh) in [cell.curved_mesh for cell in CELLS.values()]


def corners_of(mesh: Mesh) -> Mesh:
    return of_kind(cell_of(mesh).mesh, mesh.p[:, : mesh.nvertices], mesh) if is_second_order(mesh) else mesh


def nodes_of_elements(mesh: Mesh) -> Ints:
    # (nelements, k): corners, then midside nodes, for the sides 01, 12, 20 of triangles, as in Gmsh and VTK, and the
    # edges 01, 12, 02, 03, 13, 23 of tetrahedra, as in VTK
    if not is_second_order(mesh):
        return mesh.t.T
    number_edges(mesh)
    return np.vstack([mesh.t, mesh.nvertices + (mesh.t2f if len(mesh.t) == 3 else mesh.t2e)]).T


def numbered_sides(mesh: Mesh) -> IntsPair:
    # ends of sides, (2, nsides), and sides of elements in the order of `Cell.edges`
    if len(mesh.t) == 3:
        number_facets(mesh)
        return mesh.facets, mesh.t2f[AFTER]  # scikit-fem orders facets as corners 01, 12, 02
    number_edges(mesh)
    return mesh.edges, mesh.t2e


def with_midsides(mesh: Mesh, midsides: Floats) -> Mesh:
    return of_kind(cell_of(mesh).curved_mesh, np.hstack([mesh.p[:, : mesh.nvertices], midsides]), mesh)


def with_midside_offsets(mesh: Mesh, offset: Floats) -> Mesh:
    return with_midsides(mesh, mesh.p[:, numbered_sides(mesh)[0]].mean(axis=1) + offset)


def offsets_of_sides(mesh: Mesh) -> Floats:
    # (d, nsides), exactly zero for straight sides
    ends, _ = numbered_sides(mesh)
    if not is_second_order(mesh):
        return np.zeros((len(mesh.p), ends.shape[1]))
    start, end = mesh.p[:, ends].swapaxes(0, 1)
    offset = mesh.p[:, mesh.nvertices :] - 0.5 * (start + end)
    curved = np.linalg.norm(offset, axis=0) > STRAIGHT * np.linalg.norm(end - start, axis=0)
    return np.where(curved, offset, 0.0)


def midside_offsets(mesh: Mesh) -> Floats:
    return offsets_of_sides(mesh)[:, numbered_sides(mesh)[1]]


def tangent_corners(corners: Floats, offset: Floats, barycentric: Floats, slope: Floats | None = None) -> Floats:
    """Return the corners of straight elements with the Jacobian matrices at points.

    Parameters
    ----------
    corners, offset
        Corners (d, d + 1, ...) and midside offsets (d, sides, ...) of elements.
    barycentric
        Points (d + 1, ...).
    slope
        If the offsets depend on the position ``lambda_b - lambda_a`` along the sides, their derivatives.
    """
    shape = np.broadcast_shapes(corners.shape[2:], barycentric.shape[1:])
    found = np.array(np.broadcast_to(corners, (*corners.shape[:2], *shape)))
    for k, (a, b) in enumerate(CELLS[len(corners)].edges):
        turn = 0.0 if slope is None else barycentric[a] * barycentric[b] * slope[:, k]
        found[:, a] += 4.0 * (barycentric[b] * offset[:, k] - turn)
        found[:, b] += 4.0 * (barycentric[a] * offset[:, k] + turn)
    return found


def determinant_coefficients(corners: Floats, offset: Floats) -> Floats:
    """Return the Bernstein coefficients of the Jacobian determinants, (k, m).

    A coefficient is the mean determinant of derivatives at d corners, over all orders of these. The smallest is a lower
    bound of the determinant, and their mean is its mean. In a straight element all are the determinant. (G. Farin,
    *Curves and Surfaces for CAGD*, chapter 17; A. Johnen, J.-F. Remacle and C. Geuzaine, J. Comput. Phys. 233 (2013).)
    """
    dim, relative = len(corners), (corners - corners[:, :1])[:, :, None]
    at = tangent_corners(relative, offset[:, :, None], np.eye(dim + 1)[:, :, None])
    rates = at[:, 1:] - at[:, :1]  # (d, d, d + 1, m): by the barycentric coordinates but the first, at the corners
    columns = [np.expand_dims(rates[:, k], [1 + j for j in range(dim) if j != k]) for k in range(dim)]
    _, count, own = COEFFICIENTS[dim]
    return own / count[:, None] @ determinants(columns).reshape(own.shape[1], -1)


def curved_determinants(mesh: Mesh) -> tuple[Ints, Floats, Floats]:
    # curved elements (m,), their `determinant_coefficients`, and their determinants with straight sides (m,)
    shape = Isoparametric(mesh)
    rows = np.flatnonzero(shape.curved)
    corners = shape.p[:, shape.t[:, rows]]
    return rows, determinant_coefficients(corners, shape.offset[:, :, rows]), shape.cell.determinant(corners)


def inverted_elements(mesh: Mesh) -> Ints:
    rows, coefficients, straight = curved_determinants(mesh)
    coefficients = coefficients / straight
    doubtful, dim = np.flatnonzero(~(coefficients.min(axis=0) > 0.0)), len(mesh.p)
    if not doubtful.size:
        return doubtful
    at = np.array([each for each in product(range(LATTICE + 1), repeat=dim + 1) if sum(each) == LATTICE]) / LATTICE
    corners, count, _ = COEFFICIENTS[dim]
    bernstein = count * np.prod(at[:, corners], axis=2)
    return rows[doubtful[~((bernstein @ coefficients[:, doubtful]).min(axis=0) > 0.0)]]


def check_midsides(mesh: Mesh) -> None:
    kind, wanted = type(mesh).__name__, mesh.nvertices + numbered_sides(mesh)[0].shape[1]
    if mesh.p.shape[1] != wanted or not np.all(np.isfinite(mesh.p)):
        raise ValueError(
            f"a {kind} must have a finite node for every corner and every side, {wanted} in all; got "
            f"{int(np.sum(np.isfinite(mesh.p).all(axis=0)))}. Make it with {kind}.from_mesh and set its doflocs."
        )


def check_curved_sides(mesh: Mesh) -> None:
    kind, inverted = type(mesh).__name__, inverted_elements(mesh)
    if len(inverted):
        raise ValueError(
            f"the curved sides of a {kind} must not invert elements; {len(inverted)} are inverted, first element "
            f"{inverted[0]}. Draw its midside nodes nearer to their chords, as kohonen_adapt.relocate does, or keep "
            f"its corners only: {kind.removesuffix('2')}(mesh.p[:, :mesh.nvertices], mesh.t)."
        )


def all_points(rows: Ints, barycentric: Floats) -> tuple[Ints, Floats]:
    """Return elements and coordinates for points (q, d + 1) in elements `rows`."""
    return np.tile(rows, len(barycentric)), np.repeat(barycentric.T, rows.size, axis=1)


class CurvedElements:
    """Elements with curved sides, images of a quadratic map.

    Methods take element indices (n,), barycentric coordinates (d + 1, n) and points (d, n).
    """

    def __init__(self, p: Floats, t: Ints, offset: Floats, neighbour: Ints) -> None:
        self.p, self.t = p, t  # (d, nnodes), (d + 1, nelements)
        self.offset = offset  # (d, sides, nelements): midside offsets
        self.neighbour = neighbour  # (d + 1, nelements): neighbours opposite to the corners, -1 for none
        self.cell = CELLS[len(p)]
        self.ends = np.transpose(self.cell.edges)  # (2, sides)

    @cached_property
    def curved(self) -> Mask:
        return np.any(self.offset, axis=(0, 1), keepdims=True)[0, 0]

    def bows(self, element: Ints, barycentric: Floats) -> tuple[Floats, Floats | None]:
        # midside offsets, or other curves with offsets that depend on the position, and their derivatives
        return self.offset[:, :, element], None

    def points(self, element: Ints, barycentric: Floats) -> Floats:
        x = np.einsum("in,cin->cn", barycentric, self.p[:, self.t[:, element]])
        rows = np.flatnonzero(self.curved[element])
        if rows.size:
            own = barycentric[:, rows]
            between = np.prod(own[self.ends], axis=0)
            x[:, rows] += 4.0 * np.sum(between * self.bows(element[rows], own)[0], axis=1)
        return x

    def points_in_each(self, barycentric: Floats) -> Floats:
        # (d, k * nelements), of k positions in every element
        return self.points(*all_points(np.arange(self.t.shape[1]), barycentric.T))

    def tangent_corners(self, element: Ints, barycentric: Floats) -> Floats:
        found = self.p[:, self.t[:, element]]
        rows = np.flatnonzero(self.curved[element])
        if rows.size:
            own = barycentric[:, rows]
            offset, slope = self.bows(element[rows], own)
            found[:, :, rows] = tangent_corners(found[:, :, rows], offset, own, slope)
        return found

    def hat_gradients(self, element: Ints, barycentric: Floats) -> Floats:
        return self.cell.hat_gradients(self.tangent_corners(element, barycentric))

    def hats_in(self, rows: Ints, barycentric: Floats) -> Floats:
        # (d, d + 1, k, m), at k positions (k, d + 1) in some elements
        found = self.hat_gradients(*all_points(rows, barycentric))
        return found.reshape(*found.shape[:2], len(barycentric), -1)

    def determinants(self, element: Ints, barycentric: Floats) -> Floats:
        return self.cell.determinant(self.tangent_corners(element, barycentric))

    def quadrature(self, rows: Ints, rule: FloatsPair) -> tuple[Floats, Ints, Floats]:
        # points (d, n) in some elements, their elements and volumes
        barycentric, weight = rule
        element, at = all_points(rows, barycentric)
        volumes = np.abs(self.determinants(element, at)) / factorial(self.cell.dim)
        return self.points(element, at), element, np.repeat(weight, rows.size) * volumes

    def barycentric_coordinates(self, element: Ints, x: Floats) -> Floats:
        # Newton's method starts from the coordinates in the straight element. If the iteration does not converge,
        # for instance outside the element, the coordinates in the straight element are returned.
        return self._newton(element, x)[0]

    def _newton(self, element: Ints, x: Floats) -> tuple[Floats, Mask]:
        corners = self.p[:, self.t[:, element]]
        from_centroid = np.einsum("cin,cn->in", self.cell.hat_gradients(corners), x - corners.mean(axis=1))
        barycentric = 1.0 / len(self.t) + from_centroid
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
            element[rows] = self._found(element[rows], x[:, rows])
            rows = np.flatnonzero((element < 0) & np.isfinite(x).all(axis=0))
            element[rows] = self._beyond_chords(x[:, rows])
        barycentric = np.full((len(self.t), element.size), np.nan)
        rows = np.flatnonzero(element >= 0)
        barycentric[:, rows] = self.barycentric_coordinates(element[rows], x[:, rows])
        return element, barycentric

    def _found(self, start: Ints, x: Floats) -> Ints:
        # the elements that hold the points, by a walk, -1 for none
        element = self.walk(start, x)
        barycentric, converged = self._newton(element, x)
        return np.where(converged & (barycentric.min(axis=0) >= -INSIDE), element, -1)

    def _beyond_chords(self, x: Floats) -> Ints:
        element, corner = np.full(x.shape[1], -1), np.arange(len(self.t))[:, None]
        curved, opposite = np.any(self.offset, axis=0), np.all(self.ends != corner[:, None], axis=1)
        side, own = np.nonzero((opposite @ curved) & (self.neighbour < 0))
        if own.size and element.size:
            middle = self.points(own, np.where(side == corner, 0.0, 1.0 / self.cell.dim))
            near = KDTree(middle.T).query(x.T, k=range(1, 1 + min(NEAR, own.size)))[1]
            for start in own[near.T]:
                rows = np.flatnonzero(element < 0)
                element[rows] = self._found(start[rows], x[:, rows])
        return element


class Isoparametric(CurvedElements):
    # elements of a mesh, straight or curved
    def __init__(self, mesh: Mesh) -> None:
        self.corners = corners = corners_of(mesh)  # with the same elements, sides and names
        self.side_offset = offsets_of_sides(mesh)  # (d, nsides)
        number_facets(corners)
        facets = corners.t2f[np.argsort(cell_of(mesh).opposite)]
        neighbour = corners.f2t.sum(axis=0)[facets] - np.arange(facets.shape[1])  # -1 at the outer boundary
        super().__init__(corners.p, corners.t, self.side_offset[:, numbered_sides(corners)[1]], neighbour)

    def facet_points(self, facets: Ints, barycentric: Floats) -> FloatsPair:
        """Return points (d, f, n) and tangents (d, d - 1, f, n) of facets.

        `barycentric` (d, n) are coordinates on every facet. Tangents are derivatives by its last coordinates, in the
        plane from the lower to the higher node.
        """
        element, (count, each) = self.corners.f2t[0, facets], (len(facets), barycentric.shape[1])
        local = np.argmax(self.t[:, element] == self.corners.facets[:, None, facets], axis=1)
        at = np.zeros((len(self.t), count, each))
        at[local, np.arange(count)] = barycentric[:, None]
        inside = np.repeat(element, each), at.reshape(len(at), -1)
        ends = self.tangent_corners(*inside).reshape(-1, *at.shape)[:, local, np.arange(count)]
        return self.points(*inside).reshape(-1, count, each), ends[:, 1:] - ends[:, :1]


def refined(mesh: MeshTri) -> MeshTri:
    shape = Isoparametric(mesh)
    straight, nodes = shape.corners.refined(), shape.corners.nvertices
    if not is_second_order(mesh):
        return straight
    sides = numbered_sides(straight)[1]
    parent = np.tile(np.arange(mesh.nelements), 4)  # scikit-fem lists the first child of all elements, then the second
    lattice = np.concatenate([np.eye(3), 0.5 - 0.5 * np.eye(3)], axis=1)  # corners, and midpoints by opposite corner
    own = np.vstack([shape.t, nodes + numbered_sides(shape.corners)[1]])[:, parent]  # nodes of an element, refined
    at = lattice[:, np.argmax(own[:, None] == straight.t, axis=0)]  # (3, 3 nodes, nelements)
    middle = 0.5 * (at[:, AFTER] + at[:, BEFORE])
    midsides = np.empty((2, straight.nfacets))
    midsides[:, sides] = shape.points(np.tile(parent, 3), middle.reshape(3, -1)).reshape(2, 3, -1)
    return of_kind(MeshTri2, np.hstack([mesh.p, midsides]), straight)  # its corners are all nodes of the mesh
