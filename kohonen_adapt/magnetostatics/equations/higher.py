"""Integrate functions of order 2 and 3 over elements with straight and with curved sides, by quadrature."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import Basis, ElementLineP1, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.elements import Linear, Polynomials
from kohonen_adapt.mesh.curved import with_displacements
from kohonen_adapt.mesh.host import remade
from kohonen_adapt.mesh.isoparametric import Isoparametric
from kohonen_adapt.mesh.polynomials import KINDS, facet_functions, facet_products
from kohonen_adapt.mesh.quadrature import LAW_DEGREE, LAW_DEGREE_BY_POINTS

__all__ = ["Elements", "Higher", "Part"]

CURVED = 2  # degrees more by which curved elements without a law are integrated, whose gradients are no polynomials


@dataclass(frozen=True, eq=False)
class Part(ABC):
    """Elements that are integrated by one rule."""

    rows: Ints | slice  # their numbers
    points: slice  # of all quadrature points theirs

    @property
    @abstractmethod
    def share(self) -> Floats:
        """The points of the rule, (3, q) by barycentric coordinates."""

    @property
    @abstractmethod
    def x(self) -> Floats:
        """The quadrature points of every element, (2, nelements, q)."""

    @property
    @abstractmethod
    def weights(self) -> Floats:
        """Their areas, (nelements, q)."""

    @property
    @abstractmethod
    def values(self) -> Floats:
        """Of the functions of every element there, (k, nelements, q), or (k, 1, q) where they are the same."""

    @property
    @abstractmethod
    def gradients(self) -> Floats:
        """Of the functions of every element there, (k, 2, nelements, q)."""

    @cached_property
    def integrals(self) -> Floats:
        """Of the functions of every element, (k, nelements)."""
        values = np.broadcast_to(self.values, (len(self.values), *self.weights.shape))
        return np.einsum("ikq,kq->ik", values, self.weights)

    def apart(self, values: Floats) -> Floats:
        """What is at all quadrature points, (..., npoints), at those of these elements, (..., nelements, q)."""
        own = values[..., self.points]
        return own.reshape(*own.shape[:-1], *self.weights.shape)


@dataclass(frozen=True, eq=False)
class PartOfBasis(Part):
    """Elements of scikit-fem."""

    basis: Basis

    @property
    def share(self) -> Floats:
        x, y = self.basis.X
        return np.stack((1.0 - x - y, x, y))

    @property
    def x(self) -> Floats:
        return np.asarray(self.basis.global_coordinates())

    @property
    def weights(self) -> Floats:
        return self.basis.dx

    @property
    def values(self) -> Floats:
        return np.stack([np.broadcast_to(np.asarray(each[0]), self.weights.shape) for each in self.basis.basis])

    @cached_property
    def gradients(self) -> Floats:
        return np.stack([np.asarray(function[0].grad) for function in self.basis.basis])


class Higher(Polynomials):
    """P2 or P3 by quadrature: the unknowns are those of scikit-fem, at the nodes, on the facets, inside the elements.

    Methods are as of `Linear`, with as many functions in every element as it has unknowns. Elements of a `MeshTri2`
    with a curved side are isoparametric; those with a B-H law, `lawful` (nelements,), have points of their own.
    """

    def __init__(self, mesh: MeshTri, order: int, lawful: Mask) -> None:
        shape = Isoparametric(mesh)
        if not np.array_equal(mesh.t, shape.corners.t):  # scikit-fem sorts the corners of a `MeshTri`, and goes by that
            names = {"boundaries": mesh.boundaries, "subdomains": mesh.subdomains}
            mesh = remade(mesh, mesh.doflocs, shape.corners.t, **names)
        self.order, self.facet_products, self.lawful = order, facet_products(order), lawful
        bent = with_displacements(shape.corners, shape.off) if shape.curved.any() else shape.corners
        numbered = Basis(bent, KINDS[order](), intorder=1)
        super().__init__(mesh, shape, numbered.dofs.element_dofs, numbered.doflocs)
        self._parts = self._parts_of(bent)
        count = np.arange(mesh.t.shape[1])
        self.element = np.concatenate([np.repeat(count[part.rows], part.share.shape[1]) for part in self._parts])

    def _parts_of(self, bent: MeshTri) -> Sequence[Part]:
        """Return the straight and the curved elements without a law, then those with one, each with its own points."""
        kind, order, curved, lawful = KINDS[self.order](), 2 * self.order, self.shape.curved, self.lawful
        if not curved.any() and not lawful.any():
            # nu |grad u|^2 needs a degree less by 2 where nu is constant
            return [PartOfBasis(slice(None), slice(None), Basis(bent, kind, intorder=order))]
        parts, first = list[Part](), 0
        plain = (self.corners, ~curved & ~lawful, order), (bent, curved & ~lawful, order + CURVED)
        straight = self.corners, ~curved & lawful, LAW_DEGREE[self.order]
        for on, chosen, exact in (*plain, straight, (bent, curved & lawful, LAW_DEGREE_BY_POINTS[self.order])):
            if chosen.any():
                rows = np.flatnonzero(chosen)
                basis = Basis(on, kind, intorder=exact, elements=rows)
                parts.append(PartOfBasis(rows, slice(first, first + basis.dx.size), basis))
                first += basis.dx.size
        return parts

    @cached_property
    def points(self) -> Floats:
        """The quadrature points, (2, npoints)."""
        return np.concatenate([part.x.reshape(2, -1) for part in self._parts], axis=1)

    @cached_property
    def weights(self) -> Floats:
        """Of the quadrature points, (npoints,): areas of an element in sum."""
        return np.concatenate([part.weights.ravel() for part in self._parts])

    @cached_property
    def _integrals(self) -> Floats:
        """Of the functions of every element, (k, nelements)."""
        return self._by_element([part.integrals for part in self._parts])

    def _by_element(self, found: Sequence[Floats]) -> Floats:
        """What the parts have of their elements, (..., nelements) each, of all elements."""
        if len(found) == 1:
            return found[0]
        whole = np.empty((*found[0].shape[:-1], self.unknowns.shape[1]))
        for part, values in zip(self._parts, found, strict=True):
            whole[..., part.rows] = values
        return whole

    def on_facets(self, facets: Ints) -> Ints:
        """Numbers of the unknowns of facets, (order + 1, nfacets): of both ends, then between, from the first end."""
        inner = (self.order - 1) * np.asarray(facets) + np.arange(self.order - 1)[:, None]
        return np.vstack((self.corners.facets[:, facets], self.corners.p.shape[1] + inner))

    @property
    def middles(self) -> Floats:
        return self.mean(self.points) if self.shape.curved.any() else super().middles

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        products, off = super().products_on(facets, weight), self.shape.off[:, facets]
        bent = np.flatnonzero(off.any(axis=0))
        if bent.size:
            start, end = self.corners.p[:, self.corners.facets[:, facets[bent]]].swapaxes(0, 1)
            products[:, :, bent] = weight[bent] * curved_products(self.order, end - start, off[:, bent])
        return products

    def gradient(self, u: Floats) -> Floats:
        local = u[self.unknowns]
        found = [np.einsum("ik,ickq->ckq", local[:, part.rows], part.gradients) for part in self._parts]
        return np.concatenate([each.reshape(2, -1) for each in found], axis=1)

    @cached_property
    def fine_rule(self) -> tuple[Ints, Floats, Floats]:
        """Elements (n,) and barycentric coordinates (3, n) of points, and their areas (n,): they integrate the product
        of two gradients and two coordinates. These are the quadrature points.
        """
        each = [np.tile(part.share, len(part.weights)) for part in self._parts]
        return self.element, np.concatenate(each, axis=1), self.weights

    def slope_of_corners(self, values: Floats) -> Floats:
        element, share, _ = self.fine_rule
        return np.einsum("in,cin->cn", values[self.corners.t[:, element]], self._hats_at(element, share))

    def _hats_at(self, element: Ints, share: Floats) -> Floats:
        """Gradients of the barycentric coordinates at points of these elements, (2, 3, n)."""
        hats, rows = self.hats[:, :, element], np.flatnonzero(self.shape.curved[element])
        if rows.size:
            hats[:, :, rows] = self.shape.hats(element[rows], share[:, rows])
        return hats

    def mean(self, values: Floats) -> Floats:
        parts = self._parts
        sums = [np.sum(part.apart(values) * part.weights, axis=-1) / np.sum(part.weights, axis=-1) for part in parts]
        return self._by_element(sums)

    def mean_function(self, u: Floats) -> Floats:
        """The mean of a function over every element, (nelements,)."""
        areas = self._by_element([np.sum(part.weights, axis=1) for part in self._parts])
        return np.sum(self._integrals * u[self.unknowns], axis=0) / areas

    def at(self, u: Floats, element: Ints, share: Floats) -> Floats:
        """Values of a function at points of these elements, by barycentric coordinates (3, n): (n,)."""
        return np.sum(self._functions(element, share)[0] * u[self.unknowns[:, element]], axis=0)

    def gradient_at(self, u: Floats, element: Ints, share: Floats) -> Floats:
        """Its gradient there, (2, n)."""
        slope = np.einsum("icn,in->cn", self._functions(element, share)[1], u[self.unknowns[:, element]])
        return np.einsum("in,cin->cn", slope, self._hats_at(element, share)[:, 1:])

    def _functions(self, element: Ints, share: Floats) -> tuple[Floats, Floats]:
        """Values (k, n) of the functions there, and slopes (k, 2, n) by the last two barycentric coordinates."""
        found = [KINDS[self.order]().lbasis(share[1:], i) for i in range(len(self.unknowns))]
        return np.stack([each[0] for each in found]), np.stack([each[1] for each in found])

    def against_functions(self, source: Floats) -> Floats:
        """``int source phi`` for a source (nelements,): (k, nelements)."""
        return self._integrals * source

    def against_function(self, source: Floats, u: Floats) -> Floats:
        return self.against_functions(source) * u[self.unknowns]

    def against_gradients(self, flux: Floats) -> Floats:
        parts = self._parts
        found = [np.einsum("ckq,ickq->ik", part.apart(flux) * part.weights, part.gradients) for part in parts]
        return self._by_element(found)

    def against_slopes(self, size: Floats) -> Floats:
        found = []
        for part in self._parts:
            slopes = np.hypot(part.gradients[:, 0], part.gradients[:, 1])
            found.append(np.einsum("kq,ikq->ik", part.apart(size) * part.weights, slopes))
        return self._by_element(found)

    def loads(self, source: Floats, flux: Floats) -> Floats:
        return self.added(self.against_functions(source) + self.against_gradients(flux))

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> csc_array:
        products = self._by_element([self._products(part, across, along) for part in self._parts])
        row, column = np.broadcast_arrays(self.unknowns[:, None], self.unknowns[None])
        count = self.places.shape[1]
        return coo_array((products.ravel(), (row.ravel(), column.ravel())), shape=(count,) * 2).tocsc()[free][:, free]

    def _products(self, part: Part, across: Floats, along: tuple[Floats, Floats] | None) -> Floats:
        """What each two functions of an element of this part have for `stiffness`, (k, k, nelements)."""
        gradients, across = part.gradients, part.apart(across) * part.weights
        products = np.einsum("ickq,kq,jckq->ijk", gradients, across, gradients, optimize=True)
        if along is not None:
            more = part.apart(along[0]) * part.weights - across
            slope = np.einsum("ckq,ickq->ikq", part.apart(along[1]), gradients)
            products += np.einsum("ikq,kq,jkq->ijk", slope, more, slope, optimize=True)
        return products


Elements = Linear | Higher


def curved_products(order: int, chord: Floats, off: Floats) -> Floats:
    """The same integrals along curved facets, (order + 1, order + 1, n), with chords (2, n) and middles off these."""
    (at,), weights = get_quadrature(ElementLineP1, 2 * order + CURVED)
    values = (at[:, None] ** np.arange(order + 1)) @ facet_functions(order)
    length = np.hypot(*(chord[:, :, None] + 4.0 * off[:, :, None] * (1.0 - 2.0 * at)))
    return np.einsum("qi,qj,nq,q->ijn", values, values, length, weights)
