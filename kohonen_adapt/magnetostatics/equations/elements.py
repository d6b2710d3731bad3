"""Integrate linear functions over the elements of a mesh: unknowns, their places, gradients and weights."""

from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.isoparametric import Isoparametric
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients

__all__ = ["Linear", "Placed", "Polynomials"]


class Placed(Protocol):
    """Elements that know the places of their unknowns and which are on facets, in the plane and in space."""

    @property
    def corners(self) -> Mesh: ...
    @property
    def places(self) -> Floats: ...
    def on_facets(self, facets: Ints) -> Ints: ...


class Polynomials:
    """Functions that are polynomials of one degree in every element, isoparametric where it is curved.

    What is at quadrature points has them in its last axis, all of an element together, (..., npoints); of order 1 there
    is one in every element.
    """

    order: int
    facet_products: Floats  # integrals of products of the functions of a straight facet, per length; see `on_facets`
    element: Ints  # (npoints,): of every quadrature point

    def __init__(self, mesh: MeshTri, shape: Isoparametric, unknowns: Ints, places: Floats) -> None:
        self.mesh, self.shape, self.corners = mesh, shape, shape.corners
        self.unknowns = unknowns  # (k, nelements): numbers of the unknowns of every element
        self.places = places  # (2, nunknowns): where the unknowns are

    @cached_property
    def hats(self) -> Floats:
        """Gradients of the hat functions of straight elements, (2, 3, nelements)."""
        return hat_gradients(self.corners)

    @property
    def middles(self) -> Floats:
        """Centroids of the elements, (2, nelements)."""
        return self.corners.p[:, self.corners.t].mean(axis=1)

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        """Integrals over facets of a weight (nfacets,) and the products of their functions, (k, k, nfacets)."""
        start, end = self.corners.p[:, self.corners.facets[:, facets]].swapaxes(0, 1)
        return self.facet_products[:, :, None] * (weight * np.hypot(*(end - start)))

    def slope_of_corners(self, values: Floats) -> Floats:
        """Gradient at the quadrature points, (2, npoints), of what is linear in barycentric coordinates between values
        at the nodes.
        """
        return gradient(self.corners, values)[:, self.element]

    def inside(self, element: Ints, share: Floats) -> Floats:
        """The points of these elements and barycentric coordinates (3, n) at which B is asked for to have it there."""
        return share

    def balanced(self, flux: Floats, source: Floats) -> Floats:
        """Means of a flux over the elements, (2, nelements), with the loads by hat functions that it has by these."""
        return flux

    def added(self, terms: Floats) -> Floats:
        """Sum the terms (k, nelements) of the elements by unknowns, (nunknowns,)."""
        return np.bincount(self.unknowns.ravel(), terms.ravel(), self.places.shape[1]).astype(np.float64)


class Linear(Polynomials):
    """P1: the unknowns are the values at the nodes, gradients are constant in every element."""

    order = 1
    facet_products = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0

    def __init__(self, mesh: MeshTri) -> None:
        super().__init__(mesh, Isoparametric(mesh), mesh.t, mesh.p)
        self.element = np.arange(mesh.t.shape[1])

    @property
    def fine_rule(self) -> tuple[Ints, Floats, Floats]:
        """The middles of the sides, as of other orders."""
        share = np.array([[0.5, 0.0, 0.5], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5]])
        return np.repeat(self.element, 3), np.tile(share, self.element.size), np.repeat(self.weights / 3.0, 3)

    @cached_property
    def points(self) -> Floats:
        """The middles of the elements."""
        return self.mesh.p[:, self.mesh.t].mean(axis=1)

    @cached_property
    def weights(self) -> Floats:
        """Areas of the elements."""
        return area(self.mesh)

    def on_facets(self, facets: Ints) -> Ints:
        """Numbers of the unknowns of facets, (2, nfacets): of both ends."""
        return self.mesh.facets[:, facets]

    def gradient(self, u: Floats) -> Floats:
        """Gradient at the quadrature points, (2, npoints)."""
        return gradient(self.mesh, u, self.hats)

    def at(self, u: Floats, element: Ints, share: Floats) -> Floats:
        """Values of a function at points of these elements, by barycentric coordinates (3, n): (n,)."""
        return np.sum(share * u[self.unknowns[:, element]], axis=0)

    def mean(self, values: Floats) -> Floats:
        """The mean over every element, (..., nelements), of what is at the quadrature points."""
        return values

    def mean_function(self, u: Floats) -> Floats:
        """The mean of a function over every element, (nelements,)."""
        return u[self.unknowns].mean(axis=0)

    def against_functions(self, source: Floats) -> Floats:
        """``int source phi`` for a source (nelements,): the same for each corner of an element, (nelements,)."""
        return self.weights * source / 3.0

    def against_function(self, source: Floats, u: Floats) -> Floats:
        """The terms that add up to ``int source u`` for a source (nelements,)."""
        return self.against_functions(source) * np.sum(u[self.unknowns], axis=0)

    def against_gradients(self, flux: Floats) -> Floats:
        """``int flux . grad phi`` for a flux at the quadrature points, (3, nelements)."""
        return np.einsum("ck,cik->ik", flux * self.weights, self.hats)

    def against_slopes(self, size: Floats) -> Floats:
        """``int size |grad phi|`` for a size at the quadrature points, (3, nelements)."""
        return size * self.weights * np.hypot(*self.hats)

    def loads(self, source: Floats, flux: Floats) -> Floats:
        """``int source phi + flux . grad phi`` of every unknown, for a source (nelements,) and a flux at the points."""
        return self.added(self.weights * (source / 3.0 + np.einsum("ck,cik->ik", flux, self.hats)))

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> csc_array:
        """Matrix of ``int nu grad phi . grad phi`` of the free unknowns, for a coefficient at the quadrature points.

        Where the coefficient along a direction is another, `along` is that coefficient and the direction, unit vectors
        (2, npoints).
        """
        after, across = [1, 2, 0], self.weights * across
        own = across * np.einsum("cik,cik->ik", self.hats, self.hats)
        next_one = across * np.einsum("cik,cik->ik", self.hats, self.hats[:, after])
        if along is not None:
            more, slope = self.weights * along[0] - across, np.einsum("ck,cik->ik", along[1], self.hats)
            own, next_one = own + more * slope**2, next_one + more * slope * slope[after]
        return self._assembled(own, next_one, free)

    def _assembled(self, own: Floats, next_one: Floats, free: Ints) -> csc_array:
        """The symmetric matrix whose elements add `own` on the diagonal, for each of their corners, and `next_one` for
        each corner and the next, (3, nelements) each.
        """
        number = np.full(self.places.shape[1], -1, dtype=np.int32)
        number[free] = np.arange(free.size)
        # A product off the diagonal is worked out once and stands in two places; those on it are summed beforehand.
        on = np.bincount(self.unknowns.ravel(), own.ravel(), number.size)
        start, end = number[self.unknowns], number[self.unknowns[[1, 2, 0]]]
        inner = (start >= 0) & (end >= 0)
        off, start, end, diagonal = next_one[inner], start[inner], end[inner], number[free]
        row, column = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
        return coo_array((np.concatenate((off, off, on[free])), (row, column)), shape=(free.size, free.size)).tocsc()
