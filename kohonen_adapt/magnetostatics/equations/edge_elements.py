"""Edge elements of tetrahedra and their boundary conditions."""

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, eye_array, hstack
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.sparse.linalg import splu
from skfem.refdom import RefTet

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.given_field import FACET_SIGNS
from kohonen_adapt.mesh.cells import centroids_of
from kohonen_adapt.mesh.cells import crossed as cross_product
from kohonen_adapt.mesh.elements.assembly import Reduced
from kohonen_adapt.mesh.elements.space import Space
from kohonen_adapt.mesh.host import ascending, edges_around, elements_of, keys_of, number_edges, number_facets, summed
from kohonen_adapt.mesh.measures import EDGES, is_in_front, magnitude
from kohonen_adapt.mesh.names import connected_components_of

__all__ = [
    "EdgeElements",
    "conditions_on_edges",
    "open_surfaces",
    "prescribed_flux_load",
]

# Pairs of edges of an element: each with itself, both edges of a facet at a corner, and opposite edges
AT_CORNERS = [
    np.flatnonzero([corner in edge and set(edge) <= set(facet) for edge in RefTet.edges])
    for facet in RefTet.facets
    for corner in facet
]
PAIRS = np.hstack((np.tile(np.arange(6), (2, 1)), np.transpose(AT_CORNERS), [[0, 1, 2], [5, 3, 4]]))


class EdgeElements:
    """Edge elements of lowest order on a mesh.

    The function of an edge is ``lambda_i grad lambda_j - lambda_j grad lambda_i`` (Nedelec, Numer. Math. 35, 1980). An
    unknown is the circulation along an edge from its lower to its higher node. Curls are constant in every element,
    and the flux of a curl through a facet is the circulation around the facet, so that fluxes out of an element sum to
    zero.
    """

    nodes: Ints  # (2, nedges): lower and higher node of every edge
    unknowns: Ints  # (6, nelements): edges of every element
    _known: tuple[Ints, csr_array] | None = None  # the pattern of the matrix by the free edges

    def __init__(self, elements: Space) -> None:
        self.elements, self.mesh = elements, elements.corners
        number_facets(self.mesh)
        number_edges(self.mesh)
        self.nodes, self.unknowns = self.mesh.edges, self.mesh.t2e
        self.count = self.nodes.shape[1]
        self._sign = np.where(np.less(*self.mesh.t[EDGES]), 1.0, -1.0)

    @property
    def volumes(self) -> Floats:
        return self.elements.volumes

    @cached_property
    def curls(self) -> Floats:
        """Curls of the functions of every element, (3, 6, nelements) in 1/m^2."""
        return 2.0 * self._sign * cross_product(*(self.elements.hats[:, ends] for ends in EDGES))

    def curl(self, a: Floats) -> Floats:
        return np.einsum("cik,ik->ck", self.curls, a[self.unknowns])

    def at(self, a: Floats, x: Floats, element: Ints) -> Floats:
        hats, (first, second) = self.elements.hats[:, :, element], EDGES
        barycentric = self.elements.barycentric(x, element)
        functions = barycentric[first] * hats[:, second] - barycentric[second] * hats[:, first]
        return np.einsum("cin,in->cn", functions, self._sign[:, element] * a[self.unknowns[:, element]])

    def on_facets(self, facets: Ints) -> Ints:
        return edges_around(self.mesh, facets)

    def outward(self, facets: Ints) -> Floats:
        """Return 1 where a circulation is a flux out of the first element, else -1."""
        mesh = self.mesh
        centroid = centroids_of(mesh, mesh.f2t[0, facets])
        return np.where(is_in_front(mesh.p[:, np.sort(mesh.facets[:, facets], axis=0)], centroid), 1.0, -1.0)

    # in place of the gradients of an `Energy`

    gradient = curl

    def against_gradients(self, strength: Floats) -> Floats:
        return np.einsum("cik,ck->ik", self.curls, strength * self.volumes)

    def against_slopes(self, size: Floats) -> Floats:
        return size * self.volumes * magnitude(self.curls)

    def assemble_vector(self, terms: Floats) -> Floats:
        return summed(self.unknowns, terms, self.count)

    @cached_property
    def _entry(self) -> Ints:
        # of the pairs in every element, (21, nelements)
        mesh, first = self.mesh, self.count
        at_corners = [
            first + 3 * mesh.t2f[facet] + np.sum(mesh.t[corners] < mesh.t[corner], axis=0)
            for facet, corners in enumerate(RefTet.facets)
            for corner in corners
        ]
        first += 3 * mesh.nfacets
        opposite = np.arange(first, first + 3 * mesh.nelements).reshape(3, -1)
        return np.concatenate((self.unknowns, at_corners, opposite))

    def _pattern_of(self, free: Ints) -> csr_array:
        # the matrix with entries in place of values
        if self._known is None or self._known[0] is not free:
            index, count = np.full(self.count, -1, np.int32), free.size
            index[free] = np.arange(count)
            ends = np.empty((2, int(self._entry.max()) + 1), np.int32)
            ends[:, self._entry] = index[self.unknowns[PAIRS]]
            inner = np.flatnonzero(np.all(ends >= 0, axis=0)).astype(np.int32)
            start, end = ends[:, inner]
            other = np.flatnonzero(start != end)
            places = np.append(start, end[other]), np.append(end, start[other])
            entries = np.append(inner, inner[other])
            self._known = free, coo_array((entries, places), shape=(count, count)).tocsr()
        return self._known[1]

    def stiffness(self, across: Floats, free: Ints, along: FloatsPair | None = None) -> Reduced:
        """Return the matrix of ``int nu curl w . curl w`` of the free edges.

        `across` is nu in every element. `along` is a second coefficient and the unit vectors, shape (3, nelements), in
        whose direction it applies. The matrix has one entry for both edges at a corner of a facet, and one for opposite
        edges of an element. Its pattern is computed once for all nu.
        """
        pattern, forms = self._pattern_of(free), [(across * self.volumes, self.curls)]
        if along is not None:
            slope = np.einsum("ck,cik->ik", along[1], self.curls)
            forms.append(((along[0] - across) * self.volumes, slope[None]))
        terms = [sum(w * np.einsum("ck,ck->k", a[:, i], a[:, j]) for w, a in forms) for i, j in PAIRS.T]
        values = summed(self._entry, np.array(terms))
        # CSR of a symmetric matrix is CSC
        return Reduced(csc_array((values[pattern.data], pattern.indices, pattern.indptr), shape=pattern.shape))


def conditions_on_edges(edges: EdgeElements, closed: Ints) -> Conditions:
    """Return the conditions on A for ``B . n = 0`` on the facets `closed`.

    A is zero along their edges, up to fields without circulation around any facet that are no gradients, one for every
    loop of the surface: the sides of a bar between two poles have one, and the flux of the bar is its circulation.
    """
    fixed, values = np.zeros(edges.count, bool), np.zeros(edges.count)
    used, around = np.unique(edges.on_facets(closed), return_inverse=True)
    fixed[used] = True
    loops = _loops(edges.nodes[:, used], around.reshape(3, -1))
    fixed[used[np.diff(loops.tocsr().indptr) > 0]] = False
    # Sweeps of a solver from one corner of the mesh to another take a seventh fewer steps than by the numbers of edges.
    free = np.flatnonzero(~fixed)
    free = free[np.argsort(edges.mesh.p.sum(axis=0)[edges.nodes[:, free]].sum(axis=0), kind="stable")]
    if not loops.shape[1]:
        return Conditions(fixed, values, free)
    on_surface = loops.tocoo()
    inner, ends = free[~np.isin(free, used)], (used[on_surface.row], on_surface.col)
    extended = hstack(
        (eye_array(edges.count).tocsc()[:, inner], coo_array((on_surface.data, ends), (edges.count, loops.shape[1])))
    )
    return Conditions(fixed, values, free, join=csc_array(extended.tocsr()[free]))


def _loops(ends: Ints, around: Ints) -> csc_array:
    """Return a basis of closed functions modulo gradients, (nedges, nloops).

    A closed function on the edges of a surface has no circulation around any facet. The basis is zero on a tree of
    edges that reaches all nodes. A second tree connects the facets across further edges, and every edge in neither tree
    makes a loop (Eppstein, Proc. SODA, 2003).
    """
    nedges, nfacets = ends.shape[1], around.shape[1]
    if np.bincount(around.ravel()).max(initial=0) > 2:
        raise ValueError(
            "the mesh touches itself along an edge of its outer boundary; a vector potential needs a boundary on which "
            "two facets meet at every edge. Separate the parts, or join them by elements."
        )
    beside = elements_of(around.astype(np.int64), nedges)
    beside[beside < 0] = nfacets  # an edge at the rim leads outside
    in_tree = _spanning_edges(ends)
    crossed, rest = np.zeros(nedges, bool), np.flatnonzero(~in_tree)
    crossed[rest[_spanning_edges(beside[:, rest])]] = True
    generators, unknown = np.flatnonzero(~in_tree & ~crossed), np.flatnonzero(crossed)
    if not generators.size:
        return csc_array((nedges, 0))
    # The circulation around one facet of a closed surface follows from all others.
    part = connected_components_of(nfacets + 1, beside[:, rest].T)
    number, root = np.unique(part[:nfacets], return_index=True)
    kept = np.delete(np.arange(nfacets), root[number != part[nfacets]])
    facet, signs = np.tile(np.arange(nfacets), 3), np.repeat(FACET_SIGNS, nfacets)
    circulation = csr_array(coo_array((signs, (facet, around.ravel())), shape=(nfacets, nedges)))[kept]
    values = np.zeros((nedges, generators.size))
    values[generators, np.arange(generators.size)] = 1.0
    values[unknown] = splu(circulation[:, unknown].tocsc()).solve(-(circulation @ values))
    return csc_array(np.round(values))


def _spanning_edges(ends: Ints) -> Mask:
    size, chosen = int(ends.max(initial=0)) + 1, np.zeros(ends.shape[1], bool)
    _, edge = np.unique(keys_of(ascending(*ends), size), return_index=True)
    start, end = ends[:, edge].astype(np.int32)  # scipy before 1.15 takes no other integers
    graph = coo_array((edge + 1.0, (start, end)), shape=(size, size)).tocsr()
    chosen[minimum_spanning_tree(graph).data.astype(np.int64) - 1] = True
    return chosen


def open_surfaces(edges: EdgeElements, crossed: Ints) -> int:
    mesh, outer = edges.mesh, edges.mesh.boundary_facets()
    corners = mesh.facets[:, outer]
    surface, part = (
        connected_components_of(mesh.nvertices, np.reshape((ends[:-1], ends[1:]), (2, -1)).T)[corners[0]]
        for ends in (corners, mesh.t)
    )
    found = np.unique(np.stack((part, surface))[:, np.isin(outer, crossed)], axis=1)
    return int(np.bincount(found[0]).max(initial=0))


def prescribed_flux_load(edges: EdgeElements, crossed: Ints, potential: Floats) -> Floats:
    """Return ``-int phi n . curl w`` over outer facets, (nedges,).

    `potential` has the nodal values of phi, (nnodes,) in A.
    """
    mean = potential[edges.mesh.facets[:, crossed]].mean(axis=0)
    terms = -FACET_SIGNS[:, None] * (mean * edges.outward(crossed))
    return summed(edges.on_facets(crossed), terms, edges.count)
