"""Access to scikit-fem meshes beyond their public interface."""

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from math import comb
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import Mesh

from kohonen_adapt.mesh.cells import cell_of

__all__ = [
    "ascending",
    "count_unknowns",
    "edges_between",
    "edges_in",
    "facets_opposite",
    "is_own_name",
    "keys_of",
    "number_edges",
    "number_facets",
    "of_kind",
    "remade",
    "set_boundaries",
]

Host = TypeVar("Host", bound=Mesh)
CONNECTIVITY = "_facets", "_t2f", "_f2t", "_edges", "_t2e"
Names = Mapping[str, NDArray[np.integer]] | None


def is_own_name(name: str) -> bool:
    # scikit-fem adds sets called ``gmsh:*`` when reading a Gmsh file.
    return not name.startswith("gmsh:")


def remade(mesh: Host, p: NDArray[np.float64], t: ArrayLike, *, boundaries: Names, subdomains: Names) -> Host:
    return replace(mesh, doflocs=p, t=t, _boundaries=boundaries, _subdomains=subdomains)


def of_kind(kind: type[Host], p: NDArray[np.float64], mesh: Mesh) -> Host:
    made = kind(np.ascontiguousarray(p), mesh.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)
    cached = {name: vars(mesh)[name] for name in CONNECTIVITY if name in vars(mesh)}
    if np.array_equal(made.t, mesh.t):
        vars(made).update(cached)
    return made


def set_boundaries(mesh: Mesh, boundaries: Names) -> None:
    mesh._boundaries = boundaries


def number_facets(mesh: Mesh) -> None:
    """Set `facets`, `t2f` and `f2t` of a mesh, unless they are cached.

    scikit-fem sorts columns of two or three nodes. Sorting one integer per column gives the same arrays in a fraction
    of the time. The result is stored in scikit-fem's own cache attributes. If a later version renames these, scikit-fem
    computes the arrays itself.
    """
    if hasattr(mesh, "_facets"):
        return
    corners = np.array(mesh.elem.refdom.facets).T
    rows = ascending(*mesh.t[corners])
    key, side = np.unique(keys_of(rows, mesh.p.shape[1]), return_inverse=True)
    one = np.empty(key.size, dtype=np.int64)
    one[side.ravel()] = np.arange(side.size)  # any side of a facet, because all have the same nodes
    mesh._facets = np.take(rows.reshape(len(rows), -1), one, axis=1)
    mesh._t2f = side.reshape(rows.shape[1:])
    mesh._f2t = elements_of(mesh._t2f, key.size)


def number_edges(mesh: Mesh) -> None:
    # `edges` and `t2e` of tetrahedra, for the reason of `number_facets`
    if len(mesh.t) == 3 or hasattr(mesh, "_edges"):
        return
    start, end = ascending(*mesh.t[np.transpose(mesh.elem.refdom.edges)])
    nnodes = mesh.p.shape[1]
    key, index = np.unique(keys_of(np.stack([start, end]), nnodes), return_inverse=True)
    mesh._edges = np.stack([key // nnodes, key % nnodes]).astype(mesh.t.dtype)
    mesh._t2e = index.reshape(start.shape)


def edges_in(mesh: Mesh, elements: NDArray[np.integer] | NDArray[np.bool_]) -> NDArray[np.int64]:
    # lower and higher nodes (2, k) of the edges of some tetrahedra, sorted
    number_edges(mesh)
    used = np.zeros(mesh.edges.shape[1], dtype=bool)
    used[mesh.t2e[:, elements]] = True
    return mesh.edges[:, used].astype(np.int64)


def edges_between(mesh: Mesh, one: NDArray[np.integer], other: NDArray[np.integer]) -> NDArray[np.int64]:
    number_edges(mesh)
    nnodes = mesh.p.shape[1]
    return np.searchsorted(keys_of(mesh.edges, nnodes), keys_of(ascending(one, other), nnodes))


def facets_opposite(mesh: Mesh, node: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the index in `mesh` of the facet opposite to each corner, (m, d + 1)."""
    number_facets(mesh)
    facet = np.empty_like(node)
    for own, opposite in zip(mesh.t2f, cell_of(mesh).opposite, strict=True):
        facet[node == mesh.t[opposite][:, None]] = own
    return facet


def keys_of(rows: NDArray[np.integer], count: int) -> NDArray[np.int64]:
    """Return one integer per column of node indices (k, ...) below `count`.

    The integers have the lexicographic order of the columns.
    """
    key = rows[0].astype(np.int64)
    for row in rows[1:]:
        if int(key.max(initial=0)) >= np.iinfo(np.int64).max // count - 1:
            key = np.unique(key, return_inverse=True)[1].reshape(key.shape)
        key = key * count + row
    return key


def ascending(*rows: NDArray[np.integer]) -> NDArray[np.integer]:
    low, high = reduce(np.minimum, rows), reduce(np.maximum, rows)
    return np.stack([low, sum(rows) - low - high, high] if len(rows) == 3 else [low, high])


def elements_of(facet: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    side, element = facet.ravel(), np.tile(np.arange(facet.shape[1], dtype=np.int32), len(facet))
    elements = np.empty((2, count), dtype=np.int32)
    elements[0, side[::-1]] = element[::-1]  # of several values for one index numpy keeps the last
    elements[1, side] = element
    elements[1, elements[0] == elements[1]] = -1
    return elements


def count_unknowns(mesh: Mesh, order: int) -> int:
    if order == 1:
        return int(mesh.nvertices)
    number_facets(mesh)
    parts = [mesh.facets, mesh.t]
    if mesh.dim() == 3:
        number_edges(mesh)
        parts.insert(0, mesh.edges)
    return int(mesh.nvertices) + sum(comb(order - 1, k) * part.shape[1] for k, part in enumerate(parts, start=1))
