"""Boundary conditions of a vector potential on edge elements."""

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, hstack
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.sparse.linalg import splu

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.edges import FACET_SIGNS, EdgeElements

__all__ = ["conditions_on_edges", "open_surfaces", "prescribed_flux_load"]


def conditions_on_edges(edges: EdgeElements, closed: Ints) -> Conditions:
    """Return the conditions on A for ``B . n = 0`` on the facets `closed`.

    A is zero along their edges, up to fields without circulation around any facet that are no gradients, one for every
    loop of the surface: the sides of a bar between two poles have one, and the flux of the bar is its circulation.
    """
    count = edges.nodes.shape[1]
    fixed, values = np.zeros(count, dtype=bool), np.zeros(count)
    used, around = np.unique(edges.on_facets(closed), return_inverse=True)
    fixed[used] = True
    loops = _loops(edges.nodes[:, used], around.reshape(3, -1))
    fixed[used[np.diff(loops.tocsr().indptr) > 0]] = False
    free = np.flatnonzero(~fixed)
    if not loops.shape[1]:
        return Conditions(fixed, values, free)
    inner = np.flatnonzero(~np.isin(free, used))
    identity = coo_array((np.ones(inner.size), (inner, np.arange(inner.size))), shape=(free.size, inner.size))
    on_surface = loops.tocoo()
    rows = np.searchsorted(free, used[on_surface.row])
    extended = coo_array((on_surface.data, (rows, on_surface.col)), shape=(free.size, loops.shape[1]))
    return Conditions(fixed, values, free, join=csc_array(hstack((identity, extended))))


def _loops(ends: Ints, around: Ints) -> csc_array:
    """Return a basis of closed functions modulo gradients, (nedges, nloops).

    A closed function on the edges of a surface has no circulation around any facet. The basis is zero on a tree of
    edges that reaches all nodes. A second tree connects the facets across further edges, and every edge in neither tree
    makes a loop (Eppstein, Proc. SODA, 2003).
    """
    nedges, nfacets = ends.shape[1], around.shape[1]
    facet, edge = np.tile(np.arange(nfacets), 3), around.ravel()
    order = np.argsort(edge, kind="stable")
    first = np.searchsorted(edge[order], np.arange(nedges))
    sides = np.bincount(edge, minlength=nedges)
    if sides.max(initial=0) > 2:
        raise ValueError(
            "the mesh touches itself along an edge of its outer boundary; a vector potential needs a boundary on which "
            "two facets meet at every edge. Separate the parts, or join them by elements."
        )
    in_tree = _spanning_edges(ends, np.arange(nedges), nedges)
    rest = np.flatnonzero(~in_tree)
    one, other = facet[order[first[rest]]], np.full(rest.size, nfacets)  # an edge at the rim leads outside
    shared = sides[rest] == 2
    other[shared] = facet[order[first[rest[shared]] + 1]]
    crossed = np.zeros(nedges, dtype=bool)
    crossed[rest[_spanning_edges(np.stack((one, other)), np.arange(rest.size), rest.size)]] = True
    generators, unknown = np.flatnonzero(~in_tree & ~crossed), np.flatnonzero(crossed)
    if not generators.size:
        return csc_array((nedges, 0))
    signs = np.repeat(FACET_SIGNS, nfacets)
    circulation = csr_array(coo_array((signs, (facet, edge)), shape=(nfacets, nedges)))
    circulation = circulation[_facets_but_roots(one, other, nfacets)]
    values = np.zeros((nedges, generators.size))
    values[generators, np.arange(generators.size)] = 1.0
    values[unknown] = splu(circulation[:, unknown].tocsc()).solve(-(circulation @ values))
    return csc_array(np.round(values))


def _spanning_edges(ends: Ints, edge: Ints, count: int) -> Mask:
    pairs, first = np.unique(np.sort(ends, axis=0), axis=1, return_index=True)
    size = int(ends.max(initial=0)) + 1
    lower, upper = pairs.astype(np.int32)  # scipy before 1.15 takes no other integers
    graph = coo_array((edge[first] + 1.0, (lower, upper)), shape=(size, size)).tocsr()
    chosen = np.zeros(count, dtype=bool)
    chosen[minimum_spanning_tree(graph).data.astype(np.int64) - 1] = True
    return chosen


def _facets_but_roots(one: Ints, other: Ints, nfacets: int) -> Mask:
    # The circulation around one facet of a closed surface follows from all others.
    size = nfacets + 1
    _, part = connected_components(coo_array((np.ones(one.size), (one, other)), shape=(size, size)), directed=False)
    kept = np.ones(nfacets, dtype=bool)
    number, first = np.unique(part[:nfacets], return_index=True)
    kept[first[number != part[nfacets]]] = False
    return kept


def open_surfaces(edges: EdgeElements, crossed: Ints) -> int:
    mesh, outer = edges.mesh, edges.mesh.boundary_facets()
    corners = mesh.facets[:, outer]
    size = mesh.p.shape[1]
    surface = _parts(corners[:2], corners[1:], size)[corners[0]]
    part = _parts(mesh.t[:3], mesh.t[1:], size)[corners[0]]
    found = np.unique(np.stack((part, surface))[:, np.isin(outer, crossed)], axis=1)
    return int(np.bincount(found[0]).max(initial=0))


def _parts(start: Ints, end: Ints, size: int) -> Ints:
    graph = coo_array((np.ones(start.size), (start.ravel(), end.ravel())), shape=(size, size))
    return connected_components(graph, directed=False)[1]


def prescribed_flux_load(edges: EdgeElements, crossed: Ints, potential: Floats) -> Floats:
    """Return ``-int phi n . curl w`` over outer facets, (nedges,).

    `potential` has the nodal values of phi, (nnodes,) in A.
    """
    mean = potential[edges.mesh.facets[:, crossed]].mean(axis=0)
    outward = np.where(edges.turns_outward(crossed), 1.0, -1.0)
    terms = -FACET_SIGNS[:, None] * (mean * outward)
    return np.bincount(edges.on_facets(crossed).ravel(), terms.ravel(), edges.nodes.shape[1]).astype(np.float64)
