"""Edge elements of lowest order on tetrahedra."""

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.tetrahedra import EDGES
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.host import keys_of, number_edges, number_facets
from kohonen_adapt.mesh.measures import area, hat_gradients

__all__ = ["FACET_SIGNS", "EdgeElements"]

CYCLIC = ((1, 2), (2, 0), (0, 1))
UPPER = np.triu_indices(6)
FACET_EDGES = ((0, 1), (1, 2), (0, 2))
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

    def __init__(self, mesh: MeshTet) -> None:
        number_facets(mesh)
        number_edges(mesh)
        self.mesh, self.nodes, self.unknowns = mesh, mesh.edges, mesh.t2e
        self._sign = np.where(np.less(*mesh.t[EDGES]), 1.0, -1.0)

    @cached_property
    def volumes(self) -> Floats:
        return area(self.mesh)

    @cached_property
    def hats(self) -> Floats:
        return hat_gradients(self.mesh)

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

    def against_curls(self, strength: Floats) -> Floats:
        terms = np.einsum("cik,ck->ik", self.curls, strength * self.volumes)
        return np.bincount(self.unknowns.ravel(), terms.ravel(), self.nodes.shape[1]).astype(np.float64)

    def stiffness(self, free: Ints, across: Floats, along: tuple[Floats, Floats] | None = None) -> csr_array:
        """Return the matrix of ``int nu curl w . curl w`` of the free edges.

        `across` is nu of every element. `along` is a second coefficient and the unit vectors, shape (3, nelements), in
        whose direction it applies.
        """
        weight, index = across * self.volumes, np.full(self.nodes.shape[1], -1, dtype=np.int32)
        index[free] = np.arange(free.size)
        curls, (first, second) = self.curls, UPPER
        values = weight * np.einsum("cik,cik->ik", curls[:, first], curls[:, second])
        if along is not None:
            slope = np.einsum("ck,cik->ik", along[1], curls)
            values += (along[0] * self.volumes - weight) * slope[first] * slope[second]
        start, end = index[self.unknowns[first]], index[self.unknowns[second]]
        inner = (start >= 0) & (end >= 0)
        start, end = np.minimum(start, end)[inner], np.maximum(start, end)[inner]
        # Symmetric: products are computed once, and terms on the diagonal, which are added twice, have half their size.
        values = np.where(np.equal(*UPPER)[:, None], 0.5 * values, values)[inner]
        upper = coo_array((values, (start, end)), shape=(free.size, free.size)).tocsr()
        return upper + upper.T.tocsr()

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
