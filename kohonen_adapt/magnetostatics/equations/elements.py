"""Integrate functions of order 1 or 2 over the elements of a mesh: unknowns, their places, gradients and weights."""

from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import Basis, ElementTriP1, ElementTriP2, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients

__all__ = ["Elements", "Linear", "Quadratic"]

INTEGRATED = 4  # degree that the quadrature of order 2 integrates exactly: nu |grad u|^2 needs 2 where nu is constant


class _Polynomials:
    """Functions that are polynomials of one degree in every element.

    What is at quadrature points has them in its last axis, all of an element together, (..., npoints); of order 1 there
    is one in every element.
    """

    order: ClassVar[int]
    facet_products: ClassVar[Floats]  # integrals of products of the functions of a facet, per length; see `on_facets`

    def __init__(self, mesh: MeshTri, unknowns: Ints, places: Floats) -> None:
        self.mesh = mesh
        self.unknowns = unknowns  # (k, nelements): numbers of the unknowns of every element
        self.places = places  # (2, nunknowns): where the unknowns are

    @cached_property
    def hats(self) -> Floats:
        """Gradients of the hat functions, (2, 3, nelements)."""
        return hat_gradients(self.mesh)

    @cached_property
    def rule(self) -> tuple[Floats, Floats]:
        """Points of a triangle, (3, q) by barycentric coordinates, and weights that add up to 1: they integrate the
        product of two gradients and two coordinates exactly.
        """
        (x, y), weights = get_quadrature(ElementTriP1, 2 * self.order)
        return np.stack((1.0 - x - y, x, y)), weights / np.sum(weights)

    def shares(self, element: Ints, x: Floats) -> Floats:
        """Barycentric coordinates of points (2, n), each in one of these elements: (3, n)."""
        corner = self.mesh.p[:, self.mesh.t[:, element]]
        (ax, ay), (bx, by) = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        x0, y0 = x - corner[:, 0]
        second, third = (x0 * by - y0 * bx) / (ax * by - ay * bx), (ax * y0 - ay * x0) / (ax * by - ay * bx)
        return np.stack((1.0 - second - third, second, third))

    def points_at(self, element: Ints, share: Floats) -> Floats:
        """The points of these elements and barycentric coordinates, (2, n)."""
        return np.einsum("in,cin->cn", share, self.mesh.p[:, self.mesh.t[:, element]])

    def balanced(self, flux: Floats) -> Floats:
        """The flux at the quadrature points whose `loads` are what `against_gradients` makes of this one: itself, but
        where something else stands for the gradients.
        """
        return flux

    def added(self, terms: Floats) -> Floats:
        """Sum the terms (k, nelements) of the elements by unknowns, (nunknowns,)."""
        return np.bincount(self.unknowns.ravel(), terms.ravel(), self.places.shape[1]).astype(np.float64)


class Linear(_Polynomials):
    """P1: the unknowns are the values at the nodes, gradients are constant in every element."""

    order = 1
    facet_products = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0

    def __init__(self, mesh: MeshTri) -> None:
        super().__init__(mesh, mesh.t, mesh.p)

    @cached_property
    def rule(self) -> tuple[Floats, Floats]:
        """The middles of the sides, as of other orders."""
        return np.array([[0.5, 0.0, 0.5], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]), np.full(3, 1.0 / 3.0)

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


class Quadratic(_Polynomials):
    """P2 by quadrature: the unknowns are the values at the nodes and then at the middles of the facets.

    Methods are as of `Linear`, with six functions in every element.
    """

    order = 2
    facet_products = np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0

    def __init__(self, mesh: MeshTri) -> None:
        number_facets(mesh)
        middles = mesh.p[:, mesh.facets].mean(axis=1)
        super().__init__(mesh, np.vstack((mesh.t, mesh.p.shape[1] + mesh.t2f)), np.hstack((mesh.p, middles)))

    @cached_property
    def _basis(self) -> Basis:
        return Basis(self.mesh, ElementTriP2(), intorder=INTEGRATED)

    @cached_property
    def _gradients(self) -> Floats:
        """Of the six functions of every element, (6, 2, nelements, q)."""
        return np.stack([np.asarray(function[0].grad) for function in self._basis.basis])

    @cached_property
    def _integrals(self) -> Floats:
        """Of the six functions of every element, (6, nelements)."""
        values = np.stack([np.broadcast_to(np.asarray(each[0]), self._basis.dx.shape) for each in self._basis.basis])
        return np.einsum("ikq,kq->ik", values, self._basis.dx)

    @cached_property
    def points(self) -> Floats:
        """The quadrature points, (2, npoints)."""
        return np.asarray(self._basis.global_coordinates()).reshape(2, -1)

    @property
    def weights(self) -> Floats:
        """Of the quadrature points, (npoints,): areas of an element in sum."""
        return self._basis.dx.ravel()

    def on_facets(self, facets: Ints) -> Ints:
        """Numbers of the unknowns of facets, (3, nfacets): of both ends, then of the middle."""
        return np.vstack((self.mesh.facets[:, facets], self.mesh.p.shape[1] + np.asarray(facets)))

    def gradient(self, u: Floats) -> Floats:
        return np.einsum("ik,ickq->ckq", u[self.unknowns], self._gradients).reshape(2, -1)

    def mean(self, values: Floats) -> Floats:
        apart = values.reshape(*values.shape[:-1], *self._basis.dx.shape)
        return np.sum(apart * self._basis.dx, axis=-1) / np.sum(self._basis.dx, axis=-1)

    def mean_function(self, u: Floats) -> Floats:
        """The mean of a function over every element, (nelements,): that of the values at the middles of its facets."""
        return u[self.unknowns[3:]].mean(axis=0)

    def at(self, u: Floats, element: Ints, share: Floats) -> Floats:
        # scikit-fem's sides join the local nodes (0, 1), (1, 2), (0, 2)
        functions = np.vstack((share * (2.0 * share - 1.0), 4.0 * share * share[[1, 2, 0]]))
        return np.sum(functions * u[self.unknowns[:, element]], axis=0)

    def gradient_at(self, u: Floats, element: Ints, share: Floats) -> Floats:
        """Gradient of a function at such points, (2, n)."""
        node, middle = u[self.unknowns[:, element]].reshape(2, 3, -1)
        other, last = [1, 2, 0], [2, 0, 1]
        by_share = (4.0 * share - 1.0) * node + 4.0 * (share[other] * middle + share[last] * middle[last])
        return np.einsum("in,cin->cn", by_share, self.hats[:, :, element])

    def against_functions(self, source: Floats) -> Floats:
        """``int source phi`` for a source (nelements,): (6, nelements)."""
        return self._integrals * source

    def against_function(self, source: Floats, u: Floats) -> Floats:
        return self.against_functions(source) * u[self.unknowns]

    def against_gradients(self, flux: Floats) -> Floats:
        weighted = flux.reshape(2, *self._basis.dx.shape) * self._basis.dx
        return np.einsum("ckq,ickq->ik", weighted, self._gradients)

    def against_slopes(self, size: Floats) -> Floats:
        slopes = np.hypot(self._gradients[:, 0], self._gradients[:, 1])
        return np.einsum("kq,ikq->ik", size.reshape(self._basis.dx.shape) * self._basis.dx, slopes)

    def loads(self, source: Floats, flux: Floats) -> Floats:
        return self.added(self.against_functions(source) + self.against_gradients(flux))

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> csc_array:
        shape, gradients = self._basis.dx.shape, self._gradients
        across = across.reshape(shape) * self._basis.dx
        products = np.einsum("ickq,kq,jckq->ijk", gradients, across, gradients, optimize=True)
        if along is not None:
            more = along[0].reshape(shape) * self._basis.dx - across
            slope = np.einsum("ckq,ickq->ikq", along[1].reshape(2, *shape), gradients)
            products += np.einsum("ikq,kq,jkq->ijk", slope, more, slope, optimize=True)
        row, column = np.broadcast_arrays(self.unknowns[:, None], self.unknowns[None])
        count = self.places.shape[1]
        return coo_array((products.ravel(), (row.ravel(), column.ravel())), shape=(count,) * 2).tocsc()[free][:, free]


Elements = Linear | Quadratic
