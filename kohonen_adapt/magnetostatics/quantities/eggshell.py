"""The eggshell around a body: a weight that falls from 1 on it to 0 on everything else, through the air between."""

import numpy as np
from scipy.sparse import coo_array
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.system import Solver
from kohonen_adapt.magnetostatics.quantities.bodies import air_elements
from kohonen_adapt.magnetostatics.quantities.cuts import Cut
from kohonen_adapt.magnetostatics.quantities.local_field import LocalField
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients

__all__ = ["weight_gradient"]

# Measured for weights of one layer of elements around the body (1 on it, 0 on the other nodes) / of Laplace's solution
# itself / of this: magnet over iron, meshes of Gmsh as they are, 3623 nodes (`benchmarks force`; F_x = 106.0 N/m)
#     mean of F_x in N/m               114.0 / 108.7 / 107.2        scatter  2.4 / 0.32 / 0.10
#     the same meshes adapted          106.0 / 106.0 / 106.0        scatter  0.031 / 0.012 / 0.014
# two magnets on a regular grid, 5265 nodes: error of force 1.2 / 3.1 / 1.1 %, of order 1.5 for Laplace's, 2 for this


def weight_gradient(field: LocalField, inside: Mask, cut: Cut) -> Floats:
    """Gradient of the weight, (2, nelements) in 1/m; zero but in the air around the body.

    The weight falls smoothly between the levels 3/4 and 1/4 of the P1 solution of Laplace's equation in the air that is
    1 on the body, and 0 on all that is not air and on the outer boundary but for the cut. Any weight that is 1 on the
    body and 0 there has the same exact force. This one takes the field where it is told best, away from the corners of
    body and neighbours, and in many elements, so that the errors of single ones count little: the force converges by
    the square of the element size on uniform meshes, too.
    """
    mesh, air = field.mesh, air_elements(field) & ~inside
    values, held = np.zeros(mesh.p.shape[1]), ~_free_nodes(mesh, air, cut)
    values[cut.twin[mesh.t[:, inside]]] = 1.0
    held[cut.twin[held]] = True
    level = np.clip(2.0 * _laplace(mesh, air, cut.twin, values, held) - 0.5, 0.0, 1.0)
    return np.where(air, gradient(mesh, level**2 * (3.0 - 2.0 * level)), 0.0)


def _free_nodes(mesh: MeshTri, air: Mask, cut: Cut) -> Mask:
    """Nodes that have air all around, on the cut too."""
    free = np.ones(mesh.p.shape[1], dtype=bool)
    free[mesh.t[:, ~air]] = False
    free[mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), cut.facets)]] = False
    return free


def _laplace(mesh: MeshTri, air: Mask, twin: Ints, values: Floats, held: Mask) -> Floats:
    """The solution, (nnodes,): as given at the nodes held, solved for at the others; twins have the same."""
    hats, size = hat_gradients(mesh)[:, :, air], area(mesh)[air]
    corner = twin[mesh.t[:, air]]
    products = np.einsum("cik,cjk,k->ijk", hats, hats, size)
    row, column = (np.broadcast_to(part, products.shape).ravel() for part in (corner[:, None], corner[None, :]))
    matrix = coo_array((products.ravel(), (row, column)), shape=(values.size, values.size)).tocsr()
    solution, unknown = values.copy(), np.unique(twin[~held[twin]])
    if unknown.size:
        solution[unknown] = Solver().solve(matrix[unknown][:, unknown].tocsc(), -(matrix @ values)[unknown])
    return solution[twin]
