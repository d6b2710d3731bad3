"""Integrate functions of order 1 to 3 over the elements of a mesh: unknowns, their places, gradients and weights."""

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import Basis, ElementTriP1, ElementTriP2, ElementTriP3, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients

__all__ = ["Elements", "Higher", "Linear", "facet_products"]

HIGHER = {2: ElementTriP2, 3: ElementTriP3}


class _Polynomials:
    """Functions that are polynomials of one degree in every element.

    What is at quadrature points has them in its last axis, all of an element together, (..., npoints); of order 1 there
    is one in every element.
    """

    order: int
    facet_products: Floats  # integrals of products of the functions of a facet, per length; see `on_facets`

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


class Higher(_Polynomials):
    """P2 or P3 by quadrature: the unknowns are those of scikit-fem, at the nodes, on the facets, inside the elements.

    Methods are as of `Linear`, with as many functions in every element as it has unknowns.
    """

    def __init__(self, mesh: MeshTri, order: int) -> None:
        number_facets(mesh)
        # nu |grad u|^2 needs a degree less by 2 where nu is constant
        self.order, self._basis = order, Basis(mesh, HIGHER[order](), intorder=2 * order)
        self.facet_products = facet_products(order)
        super().__init__(mesh, self._basis.element_dofs, self._basis.doflocs)

    @cached_property
    def _gradients(self) -> Floats:
        """Of the functions of every element, (k, 2, nelements, q)."""
        return np.stack([np.asarray(function[0].grad) for function in self._basis.basis])

    @cached_property
    def _integrals(self) -> Floats:
        """Of the functions of every element, (k, nelements)."""
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
        """Numbers of the unknowns of facets, (order + 1, nfacets): of both ends, then between, from the first end."""
        inner = (self.order - 1) * np.asarray(facets) + np.arange(self.order - 1)[:, None]
        return np.vstack((self.mesh.facets[:, facets], self.mesh.p.shape[1] + inner))

    def gradient(self, u: Floats) -> Floats:
        return np.einsum("ik,ickq->ckq", u[self.unknowns], self._gradients).reshape(2, -1)

    def mean(self, values: Floats) -> Floats:
        apart = values.reshape(*values.shape[:-1], *self._basis.dx.shape)
        return np.sum(apart * self._basis.dx, axis=-1) / np.sum(self._basis.dx, axis=-1)

    def mean_function(self, u: Floats) -> Floats:
        """The mean of a function over every element, (nelements,)."""
        return np.sum(self._integrals * u[self.unknowns], axis=0) / np.sum(self._basis.dx, axis=1)

    def at(self, u: Floats, element: Ints, share: Floats) -> Floats:
        """Values of a function at points of these elements, by barycentric coordinates (3, n): (n,)."""
        values = np.stack([each[0] for each in self._functions(share)])
        return np.sum(values * u[self.unknowns[:, element]], axis=0)

    def gradient_at(self, u: Floats, element: Ints, share: Floats) -> Floats:
        """Its gradient there, (2, n)."""
        slopes = np.stack([each[1] for each in self._functions(share)])
        slope = np.einsum("icn,in->cn", slopes, u[self.unknowns[:, element]])
        return np.einsum("in,cin->cn", slope, self.hats[:, 1:, element])

    def _functions(self, share: Floats) -> list[tuple[Floats, Floats]]:
        """Values (n,) of every function at barycentric coordinates, and slopes (2, n) by the last two of these."""
        return [self._basis.elem.lbasis(share[1:], i) for i in range(len(self.unknowns))]

    def against_functions(self, source: Floats) -> Floats:
        """``int source phi`` for a source (nelements,): (k, nelements)."""
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


Elements = Linear | Higher


def facet_products(order: int) -> Floats:
    """Integrals of products of the functions of a facet of length 1: of both ends, then of those between."""
    at = np.concatenate(([0.0, 1.0], np.arange(1, order) / order))
    powers = np.arange(order + 1)
    moments = 1.0 / (powers[:, None] + powers + 1.0)
    functions = np.linalg.inv(at[:, None] ** powers)
    return functions.T @ moments @ functions
