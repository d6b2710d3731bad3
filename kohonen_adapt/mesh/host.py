"""Reach into a scikit-fem mesh where it has no public way: its cache of facets, names put on unchecked and its own."""

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import Mesh, MeshTri

__all__ = ["ascending", "is_own_name", "keys_of", "number_facets", "of_kind", "remade", "set_boundaries"]

Host = TypeVar("Host", bound=Mesh)
Names = Mapping[str, NDArray[np.integer]] | None


def is_own_name(name: str) -> bool:
    """Whether a name is of the user: what scikit-fem calls ``gmsh:*`` when it loads a Gmsh file is no set of theirs."""
    return not name.startswith("gmsh:")


def remade(mesh: Host, p: NDArray[np.float64], t: ArrayLike, *, boundaries: Names, subdomains: Names) -> Host:
    """A mesh of the same kind with other nodes (d, nnodes), elements (d + 1, nelements), neither copied, and names."""
    return replace(mesh, doflocs=p, t=t, _boundaries=boundaries, _subdomains=subdomains)


def of_kind(kind: type[MeshTri], p: NDArray[np.float64], mesh: MeshTri) -> MeshTri:
    """A mesh of that class with the elements and names of another, and what is known of its facets."""
    made = kind(np.ascontiguousarray(p), mesh.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)
    known = {name: vars(mesh)[name] for name in ("_facets", "_t2f", "_f2t") if name in vars(mesh)}
    if np.array_equal(made.t, mesh.t):
        vars(made).update(known)
    return made


def set_boundaries(mesh: Mesh, boundaries: Names) -> None:
    """Name the boundaries of a mesh in place: a copy, as `with_boundaries` makes, would number its facets again."""
    mesh._boundaries = boundaries


def number_facets(mesh: Mesh) -> None:
    """Give a mesh, whose elements have nodes that exist, its `facets`, `t2f` and `f2t`, unless it has them already.

    scikit-fem sorts columns of two or three nodes; sorting one whole number for each gives the same arrays in a
    fraction of the time. They go where scikit-fem looks for what it has worked out before; were it to look elsewhere
    one day, it would work them out itself.
    """
    if hasattr(mesh, "_facets"):
        return
    corners = np.array(mesh.elem.refdom.facets).T
    rows = ascending(*mesh.t[corners])
    key, side = np.unique(keys_of(rows, mesh.p.shape[1]), return_inverse=True)
    one = np.empty(key.size, dtype=np.int64)
    one[side.ravel()] = np.arange(side.size)  # any of a facet's sides: its nodes are the same
    mesh._facets = np.take(rows.reshape(len(rows), -1), one, axis=1)
    mesh._t2f = side.reshape(rows.shape[1:])
    mesh._f2t = elements_of(mesh._t2f, key.size)


def keys_of(rows: NDArray[np.integer], count: int) -> NDArray[np.int64]:
    """One number for each column of node numbers (k, ...) below `count`: they come in the order of the columns."""
    key = rows[0].astype(np.int64)
    for row in rows[1:]:
        if int(key.max(initial=0)) >= np.iinfo(np.int64).max // count - 1:
            key = np.unique(key, return_inverse=True)[1].reshape(key.shape)
        key = key * count + row
    return key


def ascending(*rows: NDArray[np.integer]) -> NDArray[np.integer]:
    """The two or three numbers of every column in order: many times faster than a sort of short columns."""
    low, high = reduce(np.minimum, rows), reduce(np.maximum, rows)
    return np.stack([low, sum(rows) - low - high, high] if len(rows) == 3 else [low, high])


def elements_of(facet: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    """The first and the last element, by number, at each of `count` facets, (2, count); -1 for last at a boundary.

    `facet` is (d + 1, nelements), the facets of the elements.
    """
    side, element = facet.ravel(), np.tile(np.arange(facet.shape[1], dtype=np.int32), len(facet))
    elements = np.empty((2, count), dtype=np.int32)
    elements[0, side[::-1]] = element[::-1]  # of values for one place numpy leaves the last
    elements[1, side] = element
    elements[1, elements[0] == elements[1]] = -1
    return elements
