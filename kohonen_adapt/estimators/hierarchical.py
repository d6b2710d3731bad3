"""Error of order 2 on tetrahedra by cubic functions.

For ``div B = 0`` with ``B = B_h - C grad e`` the error e is a combination of ``l_i l_j (l_i - l_j)`` on edges and
``l_i l_j l_k`` on faces with ::

    int C grad e . grad w = sum_K -int_K div B_h w + 1/2 sum_F int_F [B_h . n] w

for all functions w (R. E. Bank and R. K. Smith, SIAM J. Numer. Anal. 30, 1993). These functions and the quadratic ones
are nearly orthogonal, so that few conjugate gradients with the diagonal solve the equations.
"""

from functools import cache

import numpy as np
from scipy.sparse import diags_array
from scipy.sparse.linalg import LinearOperator, cg
from skfem import MeshTet
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.estimators.residual_estimator import outflows
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.elements.rules import tetrahedron_rule
from kohonen_adapt.mesh.measures import hat_gradients

__all__ = ["Surplus", "cubic_slopes"]

EDGES, FACES = np.transpose(RefTet.edges), np.transpose(TETRAHEDRON.facets)  # corners, (2, 6) and (3, 4)
DEGREE = 5  # of products of two slopes, and of a function and a jump
TOLERANCE = 1e-4  # relative residual


class Surplus:
    # `fixed` (nfacets,) are the facets with Dirichlet values; facets and edges of the mesh are numbered.
    # Curved elements count as straight but for their `normals`, the gradients of barycentric coordinates at every
    # corner, (4, 3, 4, nelements).
    def __init__(self, mesh: MeshTet, volume: Floats, fixed: Mask, normals: Floats | None = None) -> None:
        self.mesh, self.volume, self.normals = mesh, volume, normals
        nedges, (i, j) = mesh.edges.shape[1], EDGES
        self.unknowns: Ints = np.vstack((mesh.t2e, nedges + mesh.t2f))
        self.signs = np.vstack((np.where(mesh.t[i] < mesh.t[j], 1.0, -1.0), np.ones(mesh.t.shape)))
        held = np.zeros(nedges + fixed.size, dtype=np.bool_)
        held[nedges:] = fixed
        for edges, facet in zip(_edges_of_sides(), mesh.t2f, strict=True):
            held[mesh.t2e[edges][:, fixed[facet]]] = True
        self.moving, self.count = ~held, held.size

    def residual(self, field: Floats, divergence: Floats) -> Floats:
        # Right-hand sides of elements, (10, nelements), for B, (3, 4, nelements), and its divergence, (4, nelements),
        # given at the corners and linear between them.
        mesh = self.mesh
        inward = hat_gradients(mesh)[:, TETRAHEDRON.opposite]
        size = 3.0 * self.volume * np.linalg.norm(inward, axis=0)
        jump = outflows(mesh, np.stack([self._outflow(field, inward, corners) for corners in FACES]))
        jump[:, mesh.f2t[1] < 0] *= 2.0  # no flux leaves the mesh, and one element has the whole facet
        right = -_moments() @ (self.volume * divergence)
        for table, facet, area, corners in zip(_on_sides(), mesh.t2f, size, TETRAHEDRON.facets, strict=True):
            own = [np.sum(jump[:, facet] * (mesh.facets[:, facet] == mesh.t[corner]), axis=0) for corner in corners]
            right += 0.5 * np.einsum("jk,ji->ik", area * np.stack(own), table)
        return right * self.signs

    def _outflow(self, field: Floats, inward: Floats, corners: Ints) -> Floats:
        # the normal component of the flux out of elements at one corner of every side, (4, nelements)
        if self.normals is not None:
            inward = np.moveaxis(self.normals[corners, :, TETRAHEDRON.opposite], 1, 0)
        return -np.sum(field[:, corners] * inward, axis=0) / np.linalg.norm(inward, axis=0)

    def solve(self, metric: Floats, right: Floats) -> tuple[Floats, Floats]:
        # The error in elements, (10, nelements), with signs as in single elements, and its squared norms, (nelements,),
        # for the products of the gradients of barycentric coordinates with C, (4, 4, nelements).
        products = np.einsum("ijab,abk->ijk", _products(), self.volume * metric, optimize=True)
        products *= self.signs[:, None] * self.signs

        def applied(values: Floats) -> Floats:  # of values that are 0 where they are held
            return np.where(self.moving, self._total(np.einsum("ijn,jn->in", products, values[self.unknowns])), 0.0)

        diagonal = np.where(self.moving, self._total(np.einsum("iin->in", products)), 1.0)
        matrix = LinearOperator((self.count,) * 2, applied, dtype=np.float64)
        total = np.where(self.moving, self._total(right), 0.0)
        values, _ = cg(matrix, total, rtol=TOLERANCE, M=diags_array(1.0 / diagonal))
        error = values[self.unknowns]
        return error * self.signs, np.einsum("in,ijn,jn->n", error, products, error, optimize=True)

    def _total(self, local: Floats) -> Floats:
        return np.asarray(np.bincount(self.unknowns.ravel(), local.ravel(), self.count), dtype=np.float64)


@cache
def _edges_of_sides() -> list[list[int]]:
    return [[k for k, ends in enumerate(RefTet.edges) if set(ends) <= set(side)] for side in TETRAHEDRON.facets]


def _functions(l: Floats) -> Floats:  # noqa: E741
    # (10, n) at barycentric coordinates (4, n)
    (i, j), faces = EDGES, FACES
    return np.vstack((l[i] * l[j] * (l[i] - l[j]), np.prod(l[faces], axis=0)))


def cubic_slopes(at: Floats) -> Floats:
    # derivatives by the barycentric coordinates, (10, 4, n), at points (4, n)
    slopes = np.zeros((10, 4, at.shape[1]))
    for row, (i, j) in enumerate(EDGES.T):
        slopes[row, i], slopes[row, j] = at[j] * (2.0 * at[i] - at[j]), at[i] * (at[i] - 2.0 * at[j])
    for row, corners in enumerate(FACES.T, start=6):
        for corner in corners:
            slopes[row, corner] = np.prod([at[other] for other in corners if other != corner], axis=0)
    return slopes


@cache
def _products() -> Floats:
    barycentric, weights = tetrahedron_rule(DEGREE)
    slopes = cubic_slopes(barycentric.T)
    return np.asarray(np.einsum("iaq,jbq,q->ijab", slopes, slopes, weights))


@cache
def _moments() -> Floats:
    # means of products with the barycentric coordinates, (10, 4)
    barycentric, weights = tetrahedron_rule(DEGREE)
    return np.asarray(_functions(barycentric.T) * weights @ barycentric)


@cache
def _on_sides() -> Floats:
    # means over each side of products with its barycentric coordinates, (4, 3, 10)
    points, weights = get_quadrature(RefTri, DEGREE)
    found = []
    for corners in TETRAHEDRON.facets:
        at = np.zeros((4, weights.size))
        at[list(corners)] = 1.0 - points.sum(axis=0), *points
        found.append(2.0 * np.einsum("jq,iq,q->ji", at[list(corners)], _functions(at), weights))
    return np.stack(found)
