"""Access to scikit-fem meshes beyond their public interface."""

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from math import comb
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Array, Floats, Ints, IntsPair, Mask
from kohonen_adapt.mesh.cells import cell_of

__all__ = [
    "ascending",
    "count_unknowns",
    "edges_around",
    "edges_between",
    "edges_in",
    "facets_opposite",
    "is_own_name",
    "keys_of",
    "number_edges",
    "number_facets",
    "numbered",
    "of_kind",
    "remade",
    "set_boundaries",
    "summed",
]

Host = TypeVar("Host", bound=Mesh)
FACET_EDGES = (0, 1), (1, 2), (0, 2)  # corners of the edges of a face
CONNECTIVITY = "_facets", "_t2f", "_f2t", "_edges", "_t2e"
Names = Mapping[str, Ints] | None


def is_own_name(name: str) -> bool:
    # scikit-fem adds sets called ``gmsh:*`` when reading a Gmsh file.
    return not name.startswith("gmsh:")


def remade(mesh: Host, p: Floats, t: ArrayLike, *, boundaries: Names, subdomains: Names) -> Host:
    return replace(mesh, doflocs=p, t=t, _boundaries=boundaries, _subdomains=subdomains)


def of_kind(kind: type[Host], p: Floats, mesh: Mesh) -> Host:
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
    mesh._facets, mesh._t2f = _numbered(mesh, mesh.elem.refdom.facets)
    mesh._f2t = elements_of(mesh._t2f, mesh._facets.shape[1])


def number_edges(mesh: Mesh) -> None:
    # `edges` and `t2e` of tetrahedra, for the reason of `number_facets`
    if len(mesh.t) == 4 and not hasattr(mesh, "_edges"):
        mesh._edges, mesh._t2e = _numbered(mesh, mesh.elem.refdom.edges)


def _numbered(mesh: Mesh, corners: ArrayLike) -> IntsPair:
    # nodes of facets or edges, ascending, and their indices by element
    rows = ascending(*mesh.t[np.transpose(corners)])
    key, index = np.unique(keys_of(rows, mesh.p.shape[1]), return_inverse=True)
    one = np.empty(key.size, np.int64)
    one[index.ravel()] = np.arange(index.size)  # any side of a facet, because all have the same nodes
    return np.take(rows.reshape(len(rows), -1), one, axis=1), index.reshape(rows.shape[1:])


def edges_in(mesh: Mesh, elements: Ints | Mask) -> Ints:
    # lower and higher nodes (2, k) of the edges of some tetrahedra, sorted
    number_edges(mesh)
    return mesh.edges[:, np.unique(mesh.t2e[:, elements])].astype(np.int64)


def edges_between(mesh: Mesh, one: Ints, other: Ints) -> Ints:
    number_edges(mesh)
    nnodes = mesh.p.shape[1]
    return np.searchsorted(keys_of(mesh.edges, nnodes), keys_of(ascending(one, other), nnodes))


def edges_around(mesh: Mesh, facets: Ints | slice) -> Ints:
    """Return the edges of facets, (3, n), in the plane the facets themselves."""
    if len(mesh.p) == 2:
        return np.arange(mesh.facets.shape[1])[None, facets]
    corners = mesh.facets[:, facets]
    return np.stack([edges_between(mesh, corners[i], corners[j]) for i, j in FACET_EDGES])


def facets_opposite(mesh: Mesh, node: Ints) -> Ints:
    """Return the index in `mesh` of the facet opposite to each corner, (m, d + 1)."""
    number_facets(mesh)
    facet = np.empty_like(node)
    for own, opposite in zip(mesh.t2f, cell_of(mesh).opposite, strict=True):
        facet[node == mesh.t[opposite][:, None]] = own
    return facet


def keys_of(rows: Ints, count: int) -> Ints:
    """Return one integer per column of node indices (k, ...) below `count`.

    The integers have the lexicographic order of the columns.
    """
    key, count = rows[0].astype(np.int64), int(count)
    for row in rows[1:]:
        if int(key.max(initial=0)) >= np.iinfo(np.int64).max // count - 1:
            key = numbered(key.ravel()).reshape(key.shape)
        key = key * count + row
    return key


def ascending(*rows: Ints) -> Ints:
    low, high = reduce(np.minimum, rows), reduce(np.maximum, rows)
    return np.stack([low, sum(rows) - low - high, high] if len(rows) == 3 else [low, high])


def numbered(items: Array) -> Ints:
    """Return the index of items, or of columns, among the distinct values, (n,)."""
    axis = 1 if items.ndim > 1 else None
    return np.unique(items, axis=axis, return_inverse=True)[1].ravel()


def summed(index: Ints, values: Array, count: int = 0) -> Floats:
    """Return the sums of the values with each index below `count`."""
    return np.asarray(np.bincount(index.ravel(), values.ravel(), count), np.float64)


def elements_of(facet: Ints, count: int) -> Ints:
    side, element = facet.ravel(), np.tile(np.arange(facet.shape[1], dtype=np.int32), len(facet))
    elements = np.empty((2, count), np.int32)
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
