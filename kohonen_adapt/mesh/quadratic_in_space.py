"""Functions of order 2 on tetrahedra, by hierarchical coefficients.

A function is stored by its values at the nodes and by the coefficients of the functions 4 L_i L_j of the edges
(`Modes`, in the order of `EDGES`). scikit-fem's `ElementTetP2` uses the values at the nodes, then at the midpoints of
``mesh.edges``.
"""

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.arrays import Modes
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.host import ascending, keys_of, number_edges

__all__ = [
    "FIRST",
    "SECOND",
    "edge_modes",
    "edges_of_elements",
    "function_slopes",
    "quadratic_coefficients",
    "quadratic_functions",
]

FIRST, SECOND = EDGES[:, 0], EDGES[:, 1]  # corners of the six edges


def edges_of_elements(mesh: MeshTet, node: Ints) -> Ints:
    number_edges(mesh)
    count = int(mesh.nvertices)
    own = keys_of(ascending(node[:, FIRST], node[:, SECOND]), count)
    return np.searchsorted(keys_of(ascending(*mesh.edges), count), own)


def edge_modes(values: Floats, fixed: Mask, node: Ints, edge: Ints, nodes: int) -> Modes:
    """Return the coefficients of edges from values at the unknowns of `ElementTetP2`.

    `edge` (m, 6) is the result of `edges_of_elements` for elements `node` (m, 4) of a mesh with `nodes` nodes. Edges
    with a `fixed` value are Dirichlet edges.
    """
    corners = values[node]
    side = values[nodes + edge] - 0.5 * (corners[:, FIRST] + corners[:, SECOND])
    return Modes(side[..., None], np.zeros(len(node)), fixed[nodes + edge])


def quadratic_coefficients(mesh: MeshTet, values: Floats) -> Floats:
    node = mesh.t.T
    modes = edge_modes(
        values, np.zeros(len(values), dtype=np.bool_), node, edges_of_elements(mesh, node), mesh.nvertices
    )
    return np.vstack([values[mesh.t], modes.side[..., 0].T])


def quadratic_functions(barycentric: Floats) -> Floats:
    return np.concatenate([barycentric, 4.0 * barycentric[FIRST] * barycentric[SECOND]])


def function_slopes(corners: Floats, barycentric: Floats) -> Floats:
    hats = TETRAHEDRON.hat_gradients(corners)
    first, second = barycentric[FIRST, None], barycentric[SECOND, None]
    return np.concatenate([hats, 4.0 * (first * hats[:, SECOND] + second * hats[:, FIRST])], axis=1)
