"""Functions of order 2 on tetrahedra, by hierarchical coefficients.

A function is stored by its values at the nodes and by the coefficients of the functions 4 L_i L_j of the edges
(`Modes`, in the order of `EDGES`). scikit-fem's `ElementTetP2` uses the values at the nodes, then at the midpoints of
``mesh.edges``.
"""

import numpy as np
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.tetrahedron.geometry import EDGES
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.host import ascending, keys_of, number_edges

__all__ = [
    "FIRST",
    "SECOND",
    "function_slopes",
    "hierarchical",
    "hierarchical_loads",
    "quadratic_functions",
    "unknowns_of_elements",
]

FIRST, SECOND = EDGES[:, 0], EDGES[:, 1]  # corners of the six edges


def unknowns_of_elements(mesh: MeshTet, node: Ints) -> Ints:
    # unknowns of `ElementTetP2`, (10, m), of elements `node` (4, m)
    number_edges(mesh)
    count = int(mesh.nvertices)
    own = keys_of(ascending(node[FIRST], node[SECOND]), count)
    return np.vstack([node, count + np.searchsorted(keys_of(ascending(*mesh.edges), count), own)])


def hierarchical(values: Floats) -> Floats:
    # coefficients of elements from their values at the unknowns, (10, m)
    return np.vstack([values[:4], values[4:] - 0.5 * (values[FIRST] + values[SECOND])])


def hierarchical_loads(mesh: MeshTet, load: Floats) -> Floats:
    # `load` by functions of `ElementTetP2`, the result by hierarchical functions, (nunknowns,)
    number_edges(mesh)
    count, found = int(mesh.nvertices), load.copy()
    for end in mesh.edges:
        found[:count] += 0.5 * np.bincount(end, load[count:], count)
    return found


def quadratic_functions(barycentric: Floats) -> Floats:
    return np.concatenate([barycentric, 4.0 * barycentric[FIRST] * barycentric[SECOND]])


def function_slopes(corners: Floats, barycentric: Floats) -> Floats:
    hats = TETRAHEDRON.hat_gradients(corners)
    first, second = barycentric[FIRST, None], barycentric[SECOND, None]
    return np.concatenate([hats, 4.0 * (first * hats[:, SECOND] + second * hats[:, FIRST])], axis=1)
