"""The eggshell around a body: a weight that falls from 1 on it to 0 on everything else, through the air between."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from skfem import MeshTri

from kohonen_adapt.estimators.gradients import gradient, hat_gradients
from kohonen_adapt.magnetostatics.bodies import Bools, air_elements
from kohonen_adapt.magnetostatics.cuts import Cut
from kohonen_adapt.magnetostatics.system import solved
from kohonen_adapt.triangles import area

if TYPE_CHECKING:
    from kohonen_adapt.magnetostatics.field import Field

__all__ = ["weight_gradient"]

Floats = NDArray[np.float64]
Integers = NDArray[np.integer]


def weight_gradient(field: "Field", inside: Bools, cut: Cut) -> Floats:
    """Gradient of the weight, (2, nelements) in 1/m; zero but in the air around the body.

    The weight is the P1 solution of Laplace's equation in the air, 1 on the body, 0 on all that is not air and on the
    outer boundary but for the cut. Any weight of these values has the same exact force; this one has the smallest
    gradient, so the errors of single elements count least. Scatter of the force over seeds after `adapt`, against the
    weight of one layer of elements (1 on the body, 0 on the other nodes): a magnet beside iron at 7857 nodes, 0.004 in
    place of 0.015 N/m of 329 N/m, at 2009 nodes 0.05 in place of 0.09; on that iron, 0.005 in place of 0.02, and at
    2009 nodes no less; two magnets at 5265 nodes, 0.002 in place of 0.06 %.
    """
    mesh, air = field.mesh, air_elements(field) & ~inside
    values, held = np.zeros(mesh.p.shape[1]), ~_free_nodes(mesh, air, cut)
    values[cut.twin[mesh.t[:, inside]]] = 1.0
    held[cut.twin[held]] = True
    return np.where(air, gradient(mesh, _laplace(mesh, air, cut.twin, values, held)), 0.0)


def _free_nodes(mesh: MeshTri, air: Bools, cut: Cut) -> Bools:
    """Nodes that have air all around, on the cut too."""
    free = np.ones(mesh.p.shape[1], dtype=bool)
    free[mesh.t[:, ~air]] = False
    free[mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), cut.facets)]] = False
    return free


def _laplace(mesh: MeshTri, air: Bools, twin: Integers, values: Floats, held: Bools) -> Floats:
    """The weight, (nnodes,): as given at the nodes held, solved for at the others; that of its twin for every node."""
    hats, size = hat_gradients(mesh)[:, :, air], area(mesh)[air]
    corner = twin[mesh.t[:, air]]
    products = np.einsum("cik,cjk,k->ijk", hats, hats, size)
    row, column = (np.broadcast_to(part, products.shape).ravel() for part in (corner[:, None], corner[None, :]))
    matrix = coo_array((products.ravel(), (row, column)), shape=(values.size, values.size)).tocsr()
    weight, unknown = values.copy(), np.unique(twin[~held[twin]])
    if unknown.size:
        weight[unknown] = solved(matrix[unknown][:, unknown].tocsc(), -(matrix @ values)[unknown])
    return weight[twin]
