"""Reach into a scikit-fem mesh where it has no public way: its cache of facets, names put on unchecked and its own."""

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import Mesh, MeshTri

__all__ = ["ascending", "is_own_name", "number_facets", "of_kind", "remade", "set_boundaries"]

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

    scikit-fem sorts pairs or triples of nodes; sorting one whole number for each gives the same arrays in a fraction of
    the time. They go where scikit-fem looks for what it has worked out before; were it to look elsewhere one day, it
    would work them out itself, as it does where these numbers would be too large.
    """
    count, corners = mesh.p.shape[1], mesh.t[np.asarray(mesh.elem.refdom.facets).T]
    if hasattr(mesh, "_facets") or float(count) ** len(corners) > np.iinfo(np.int64).max:
        return
    code = np.zeros(corners.shape[1:], dtype=np.int64)
    for node in ascending(*corners):
        code = code * count + node
    number, side = np.unique(code, return_inverse=True)
    mesh._facets = np.stack(np.unravel_index(number, (count,) * len(corners))).astype(mesh.t.dtype)
    mesh._t2f = side.reshape(code.shape)
    mesh._f2t = elements_of(mesh._t2f, number.size)


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
