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
from scipy.sparse.linalg import cg

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.estimators.residual_estimator import outflows, rows_of_ends
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.elements.assembly import assembled
from kohonen_adapt.mesh.elements.functions import EDGES as OF_FUNCTIONS
from kohonen_adapt.mesh.elements.functions import hierarchical
from kohonen_adapt.mesh.elements.rules import tetrahedron_rule, triangle_rule
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import summed

__all__ = ["Surplus", "cubic_functions"]

EDGES, FACES = np.transpose(TETRAHEDRON.edges), np.transpose(TETRAHEDRON.facets)  # corners, (2, 6) and (3, 4)
# The cubic among the hierarchical functions of order 3, with edges as of scikit-fem, and their scales.
ROWS = [*(10 + OF_FUNCTIONS[3].index(ends) for ends in TETRAHEDRON.edges), *range(16, 20)]
SCALES = np.repeat([13.5, 27.0], [6, 4])
DEGREE = 5  # of products of two slopes, and of a function and a jump
TOLERANCE = 1e-4  # relative residual


class Surplus:
    # `fixed` (nfacets,) are the facets with Dirichlet values in a space of order 2. Curved elements count as straight
    # except for their normals.
    def __init__(self, space: Space, fixed: Mask) -> None:
        self.space, mesh = space, space.corners
        nedges, (i, j) = mesh.nedges, EDGES
        self.unknowns: Ints = np.vstack((mesh.t2e, nedges + mesh.t2f))
        self.signs = np.vstack((np.where(mesh.t[i] < mesh.t[j], 1.0, -1.0), np.ones(mesh.t.shape)))
        held = np.append(np.zeros(nedges, bool), fixed)
        held[space.on_facets(np.flatnonzero(fixed))[3:] - mesh.nvertices] = True
        self.free, self.count = np.flatnonzero(~held), held.size

    def residual(self, field: Floats, divergence: Floats) -> Floats:
        # Right-hand sides of elements, (10, nelements), for B, (3, 4, nelements), and its divergence, (4, nelements),
        # given at the corners and linear between them.
        mesh = self.space.corners
        size = 3.0 * self.space.volumes * np.linalg.norm(self.space.hats[:, TETRAHEDRON.opposite], axis=0)
        hats = self.space.shape.hats_in(np.arange(mesh.nelements), np.eye(4)).transpose(2, 0, 1, 3)
        inward = hats[FACES, :, TETRAHEDRON.opposite]  # (3 corners of a side, 4 sides, 3, nelements)
        outflow = -np.einsum("cjsk,jsck->jsk", field[:, FACES], inward) / np.linalg.norm(inward, axis=2)
        jump = outflows(mesh, outflow)
        jump[:, mesh.f2t[1] < 0] *= 2.0  # no flux leaves the mesh, and one element has the whole facet
        on_sides = 0.5 * size * jump[rows_of_ends(mesh), mesh.t2f]
        _, moments, of_sides = _integrals()
        right = np.einsum("jsk,sji->ik", on_sides, of_sides) - moments @ (self.space.volumes * divergence)
        return right * self.signs

    def solve(self, metric: Floats, right: Floats) -> FloatsPair:
        # The error in elements, (10, nelements), with signs as in single elements, and its squared norms, (nelements,),
        # for the products of the gradients of the last three barycentric coordinates with C, (3, 3, nelements).
        products = np.einsum("ijab,abk->ijk", _integrals()[0], self.space.volumes * metric, optimize=True)
        products *= self.signs[:, None] * self.signs
        index, values = np.full(self.count, -1), np.zeros(self.count)
        index[self.free] = np.arange(self.free.size)
        matrix = assembled(self.unknowns, products[np.triu_indices(10)], index, self.free.size)
        total = summed(self.unknowns, right, self.count)[self.free]
        values[self.free], _ = cg(matrix, total, rtol=TOLERANCE, M=diags_array(1.0 / matrix.diagonal()))
        error = values[self.unknowns]
        return error * self.signs, np.einsum("in,ijn,jn->n", error, products, error, optimize=True)


def cubic_functions(at: Floats) -> FloatsPair:
    # values (10, n) and slopes by the last three barycentric coordinates, (10, 3, n), at points (n, 4)
    values, slopes = (of_all[ROWS] for of_all in hierarchical(at, 3))
    return values / SCALES[:, None], slopes / SCALES[:, None, None]


@cache
def _integrals() -> tuple[Floats, Floats, Floats]:
    # Means over elements of products of slopes, (10, 10, 3, 3), and of functions and barycentric coordinates, (10, 4),
    # and over each side of functions and its barycentric coordinates, (4, 3, 10).
    barycentric, weights = tetrahedron_rule(DEGREE)
    values, slopes = cubic_functions(barycentric)
    products = np.asarray(np.einsum("iaq,jbq,q->ijab", slopes, slopes, weights))
    moments = np.asarray(values * weights @ barycentric)
    on_side, weights = triangle_rule(DEGREE)
    of_sides = (cubic_functions(on_side @ np.eye(4)[list(corners)])[0] for corners in TETRAHEDRON.facets)
    return products, moments, np.stack([on_side.T @ (values * weights).T for values in of_sides])
