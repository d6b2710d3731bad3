"""Edge elements of tetrahedra and their boundary conditions."""

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, hstack
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.sparse.linalg import splu
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.elements.assembly import Reduced
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import keys_of, number_edges, number_facets
from kohonen_adapt.mesh.measures import EDGES

__all__ = [
    "FACET_SIGNS",
    "Curls",
    "EdgeElements",
    "conditions_on_edges",
    "open_surfaces",
    "prescribed_flux_load",
]

CYCLIC = ((1, 2), (2, 0), (0, 1))
FACET_EDGES = ((0, 1), (1, 2), (0, 2))
SAME, OPPOSITE = np.tile(np.arange(6), (2, 1)), np.array([[0, 1, 2], [5, 3, 4]])  # pairs of edges of an element
# of both edges of a facet at a corner, in the order of `RefTet.facets`
AT_CORNERS = np.transpose(
    [
        np.flatnonzero([corner in edge and set(edge) <= set(facet) for edge in RefTet.edges])
        for facet in RefTet.facets
        for corner in facet
    ]
)
FACET_SIGNS = np.array([1.0, 1.0, -1.0])  # of a path around a facet with ascending nodes


class EdgeElements:
    """Edge elements of lowest order on a mesh.

    The function of an edge is ``lambda_i grad lambda_j - lambda_j grad lambda_i`` (Nedelec, Numer. Math. 35, 1980). An
    unknown is the circulation along an edge from its lower to its higher node. Curls are constant in every element,
    and the flux of a curl through a facet is the circulation around the facet, so that fluxes out of an element sum to
    zero.
    """

    nodes: Ints  # (2, nedges): lower and higher node of every edge
    unknowns: Ints  # (6, nelements): edges of every element

    def __init__(self, elements: Space) -> None:
        self.elements, self.mesh = elements, elements.corners
        number_facets(self.mesh)
        number_edges(self.mesh)
        self.nodes, self.unknowns = self.mesh.edges, self.mesh.t2e
        self._sign = np.where(np.less(*self.mesh.t[EDGES]), 1.0, -1.0)

    @property
    def volumes(self) -> Floats:
        return self.elements.volumes

    @property
    def hats(self) -> Floats:
        return self.elements.hats

    @cached_property
    def curls(self) -> Floats:
        """Curls of the functions of every element, (3, 6, nelements) in 1/m^2."""
        first, second = (self.hats[:, ends] for ends in EDGES)
        return 2.0 * self._sign * np.stack([first[i] * second[j] - first[j] * second[i] for i, j in CYCLIC])

    def curl(self, a: Floats) -> Floats:
        return np.einsum("cik,ik->ck", self.curls, a[self.unknowns])

    def at(self, a: Floats, x: Floats, element: Ints) -> Floats:
        t, hats = self.mesh.t[:, element], self.hats[:, :, element]
        middle = self.mesh.p[:, t].mean(axis=1)
        barycentric = 0.25 + np.einsum("cin,cn->in", hats, x - middle)
        first, second = EDGES
        functions = barycentric[first] * hats[:, second] - barycentric[second] * hats[:, first]
        return np.einsum("cin,in->cn", functions, self._sign[:, element] * a[self.unknowns[:, element]])

    def mean(self, a: Floats) -> Floats:
        first, second = EDGES
        slopes = self.hats[:, second] - self.hats[:, first]
        return np.einsum("cik,ik->ck", slopes, 0.25 * self._sign * a[self.unknowns])

    @cached_property
    def gradient(self) -> csr_array:
        """Circulations of the gradients of the hat functions, (nedges, nnodes)."""
        count, (lower, upper) = self.nodes.shape[1], self.nodes
        edge, one = np.arange(count), np.ones(count)
        entries = np.concatenate((-one, one)), (np.tile(edge, 2), np.concatenate((lower, upper)))
        return coo_array(entries, shape=(count, self.mesh.p.shape[1])).tocsr()

    @cached_property
    def directions(self) -> Floats:
        return self.mesh.p[:, self.nodes[1]] - self.mesh.p[:, self.nodes[0]]

    def on_facets(self, facets: Ints) -> Ints:
        corners, size = np.sort(self.mesh.facets[:, facets], axis=0), self.mesh.p.shape[1]
        keys = keys_of(self.nodes, size)
        return np.stack([np.searchsorted(keys, keys_of(corners[[i, j]], size)) for i, j in FACET_EDGES])

    def circulation(self, a: Floats, facets: Ints) -> Floats:
        return FACET_SIGNS @ a[self.on_facets(facets)]

    def turns_outward(self, facets: Ints) -> Mask:
        corners = np.sort(self.mesh.facets[:, facets], axis=0)
        outward = self.mesh.p[:, corners[0]] - self.mesh.p[:, self.mesh.t[:, self.mesh.f2t[0, facets]]].mean(axis=1)
        return np.sum(normals(self.mesh.p.T, corners.T).T * outward, axis=0) > 0.0


class Curls:
    """Curls of functions on edges, in place of the gradients of an `Energy`.

    The matrix of ``int nu curl w . curl w`` of the free edges has one entry for both edges at a corner of a facet, and
    one for opposite edges of an element. Its pattern is computed once for all nu.
    """

    def __init__(self, edges: EdgeElements, free: Ints) -> None:
        self.edges, self.free = edges, free

    def gradient(self, a: Floats) -> Floats:
        return self.edges.curl(a)

    def against_gradients(self, strength: Floats) -> Floats:
        return np.einsum("cik,ck->ik", self.edges.curls, strength * self.edges.volumes)

    def against_slopes(self, size: Floats) -> Floats:
        return size * self.edges.volumes * np.sqrt(np.sum(self.edges.curls**2, axis=0))

    def assemble_vector(self, terms: Floats) -> Floats:
        count = self.edges.nodes.shape[1]
        return np.bincount(self.edges.unknowns.ravel(), terms.ravel(), count).astype(np.float64)

    @cached_property
    def _entry(self) -> Ints:
        # of the pairs `AT_CORNERS` in every element, (12, nelements)
        mesh, found = self.edges.mesh, list[Ints]()
        for facet, corners in enumerate(RefTet.facets):
            for corner in corners:
                others = [other for other in corners if other != corner]
                found.append(3 * mesh.t2f[facet] + np.sum(mesh.t[others] < mesh.t[corner], axis=0))
        return np.stack(found)

    @cached_property
    def _pattern(self) -> csr_array:
        # the matrix with places in `values` as entries
        edges, count = self.edges, self.free.size
        index = np.full(edges.nodes.shape[1], -1, dtype=np.int32)
        index[self.free] = np.arange(count)
        ends = np.empty((2, 3 * edges.mesh.facets.shape[1]), dtype=np.int32)
        ends[:, self._entry] = index[edges.unknowns[AT_CORNERS]]
        opposite = index[edges.unknowns[OPPOSITE]].reshape(2, -1)
        start, end = np.concatenate((ends, opposite), axis=1)
        inner = np.flatnonzero((start >= 0) & (end >= 0)).astype(np.int32)
        start, end, diagonal = start[inner], end[inner], np.arange(count, dtype=np.int32)
        place = np.concatenate((count + inner, count + inner, diagonal))
        indices = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
        return coo_array((place, indices), shape=(count, count)).tocsr()

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced:
        """Return the matrix for nu in every element.

        `across` is nu. `along` is a second coefficient and the unit vectors, shape (3, nelements), in whose direction
        it applies. `free` are the edges of the pattern.
        """
        edges, pattern = self.edges, self._pattern
        forms = [(across * edges.volumes, edges.curls)]
        if along is not None:
            slope = np.einsum("ck,cik->ik", along[1], edges.curls)
            forms.append(((along[0] - across) * edges.volumes, slope[None]))
        same, at_corners, opposite = (_products(forms, pairs) for pairs in (SAME, AT_CORNERS, OPPOSITE))
        diagonal = np.bincount(edges.unknowns.ravel(), same.ravel(), edges.nodes.shape[1])[self.free]
        on_facets = np.bincount(self._entry.ravel(), at_corners.ravel(), 3 * edges.mesh.facets.shape[1])
        values = np.concatenate((diagonal, on_facets, opposite.ravel()))
        # CSR of a symmetric matrix is CSC
        return Reduced(csc_array((values[pattern.data], pattern.indices, pattern.indptr), shape=pattern.shape))


def _products(forms: list[tuple[Floats, Floats]], pairs: Ints) -> Floats:
    # sum of ``weight a_i . a_j`` for pairs of local edges, (npairs, nelements)
    return np.stack([sum(w * np.einsum("ck,ck->k", a[:, i], a[:, j]) for w, a in forms) for i, j in pairs.T])


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
    # Sweeps of a solver from one corner of the mesh to another take a seventh fewer steps than by the numbers of edges.
    free = np.flatnonzero(~fixed)
    free = free[np.argsort(edges.mesh.p.sum(axis=0)[edges.nodes[:, free]].sum(axis=0), kind="stable")]
    if not loops.shape[1]:
        return Conditions(fixed, values, free)
    inner = np.flatnonzero(~np.isin(free, used))
    identity = coo_array((np.ones(inner.size), (inner, np.arange(inner.size))), shape=(free.size, inner.size))
    on_surface = loops.tocoo()
    row_of = np.zeros(count, dtype=np.int64)
    row_of[free] = np.arange(free.size)
    rows = row_of[used[on_surface.row]]
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
