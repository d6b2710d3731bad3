"""Quadrature of functions of order 2 and 3 on straight and curved triangles."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from skfem import Basis, ElementLineP1, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.elements import Linear, Polynomials
from kohonen_adapt.magnetostatics.equations.system import Reduced
from kohonen_adapt.mesh.basis import KINDS, LAW_DEGREE, LAW_DEGREE_BY_POINTS, facet_functions, facet_products
from kohonen_adapt.mesh.curved import Isoparametric, with_midside_offsets
from kohonen_adapt.mesh.host import remade

__all__ = ["ElementGroup", "Elements", "Higher"]

RANK = 1e-12  # relative size of the singular values of constants, which have no gradient
CURVED = 2  # added to the degree of quadrature on curved elements, where gradients are not polynomials


@dataclass(frozen=True, eq=False)
class ElementGroup(ABC):
    rows: Ints | slice  # indices of the elements
    points: slice  # range of the quadrature points of these elements

    @property
    @abstractmethod
    def barycentric(self) -> Floats:
        """Barycentric coordinates of the quadrature points, shape (3, q)."""

    @property
    @abstractmethod
    def x(self) -> Floats:
        """Quadrature points of every element, shape (2, nelements, q)."""

    @property
    @abstractmethod
    def weights(self) -> Floats:
        """Areas that the points stand for, shape (nelements, q)."""

    @property
    @abstractmethod
    def values(self) -> Floats:
        """Values of the functions, shape (k, nelements, q), or (k, 1, q) if all equal."""

    @property
    @abstractmethod
    def gradients(self) -> Floats:
        """Gradients of the functions, shape (k, 2, nelements, q)."""

    @cached_property
    def integrals(self) -> Floats:
        values = np.broadcast_to(self.values, (len(self.values), *self.weights.shape))
        return np.einsum("ikq,kq->ik", values, self.weights)

    def restrict(self, values: Floats) -> Floats:
        own = values[..., self.points]
        return own.reshape(*own.shape[:-1], *self.weights.shape)

    def gradient(self, local: Floats) -> Floats:
        return np.einsum("ik,ickq->ckq", local, self.gradients)

    def against_gradients(self, flux: Floats) -> Floats:
        return np.einsum("ckq,ickq->ik", self.restrict(flux) * self.weights, self.gradients)

    def against_slopes(self, size: Floats) -> Floats:
        slopes = np.hypot(self.gradients[:, 0], self.gradients[:, 1])
        return np.einsum("kq,ikq->ik", self.restrict(size) * self.weights, slopes)

    def products(self, across: Floats, along: tuple[Floats, Floats] | None) -> Floats:
        """Return the element matrices of `Higher.stiffness`, (k, k, nelements)."""
        gradients, across = self.gradients, self.restrict(across) * self.weights
        products = np.einsum("ickq,kq,jckq->ijk", gradients, across, gradients, optimize=True)
        if along is not None:
            more = self.restrict(along[0]) * self.weights - across
            slope = np.einsum("ckq,ickq->ikq", self.restrict(along[1]), gradients)
            products += np.einsum("ikq,kq,jkq->ijk", slope, more, slope, optimize=True)
        return products


@dataclass(frozen=True, eq=False)
class BasisGroup(ElementGroup):
    basis: Basis

    @property
    def barycentric(self) -> Floats:
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
    """P2 or P3 elements by quadrature, with the unknowns of scikit-fem.

    Methods are as in `Linear`, with k functions per element. Elements of a `MeshTri2` with a curved side are
    isoparametric. Elements with a B-H law, the mask `nonlinear` (nelements,), have their own quadrature rule.
    """

    def __init__(self, mesh: MeshTri, order: int, nonlinear: Mask) -> None:
        shape = self._shape_of(mesh)
        # scikit-fem sorts the corners of a `MeshTri` and relies on the order.
        if not np.array_equal(mesh.t, shape.corners.t):
            names = {"boundaries": mesh.boundaries, "subdomains": mesh.subdomains}
            mesh = remade(mesh, mesh.doflocs, shape.corners.t, **names)
        self.order, self.facet_products, self.nonlinear = order, facet_products(order), nonlinear
        self.shape = shape
        super().__init__(mesh, shape, *self._numbering())
        self._groups = self._make_groups()
        count = np.arange(mesh.t.shape[1])
        self.element = np.concatenate(
            [np.repeat(count[group.rows], group.barycentric.shape[1]) for group in self._groups]
        )

    def _shape_of(self, mesh: MeshTri) -> Isoparametric:
        return Isoparametric(mesh)

    def _numbering(self) -> tuple[Ints, Floats]:
        """Return the unknowns of elements, (k, nelements), and their positions."""
        numbered = Basis(self._curved_mesh(), KINDS[self.order](), intorder=1)
        return numbered.dofs.element_dofs, numbered.doflocs

    def _curved_mesh(self) -> MeshTri:
        shape = self.shape
        return with_midside_offsets(shape.corners, shape.facet_offset) if shape.curved.any() else shape.corners

    def _make_groups(self) -> Sequence[ElementGroup]:
        curved_mesh = self._curved_mesh()
        kind, order, curved, nonlinear = KINDS[self.order](), 2 * self.order, self.shape.curved, self.nonlinear
        if not curved.any() and not nonlinear.any():
            # two degrees more than nu |grad u|^2 needs if nu is constant
            return [BasisGroup(slice(None), slice(None), Basis(curved_mesh, kind, intorder=order))]
        groups, first = list[ElementGroup](), 0
        plain = (self.corners, ~curved & ~nonlinear, order), (curved_mesh, curved & ~nonlinear, order + CURVED)
        straight = self.corners, ~curved & nonlinear, LAW_DEGREE[self.order]
        for on, chosen, exact in (
            *plain,
            straight,
            (curved_mesh, curved & nonlinear, LAW_DEGREE_BY_POINTS[self.order]),
        ):
            if chosen.any():
                rows = np.flatnonzero(chosen)
                basis = Basis(on, kind, intorder=exact, elements=rows)
                groups.append(BasisGroup(rows, slice(first, first + basis.dx.size), basis))
                first += basis.dx.size
        return groups

    @cached_property
    def points(self) -> Floats:
        return np.concatenate([group.x.reshape(2, -1) for group in self._groups], axis=1)

    @cached_property
    def weights(self) -> Floats:
        return np.concatenate([group.weights.ravel() for group in self._groups])

    @cached_property
    def _integrals(self) -> Floats:
        return self._by_element([group.integrals for group in self._groups])

    def _by_element(self, found: Sequence[Floats]) -> Floats:
        if len(found) == 1:
            return found[0]
        whole = np.empty((*found[0].shape[:-1], self.unknowns.shape[1]))
        for group, values in zip(self._groups, found, strict=True):
            whole[..., group.rows] = values
        return whole

    def on_facets(self, facets: Ints) -> Ints:
        inner = (self.order - 1) * np.asarray(facets) + np.arange(self.order - 1)[:, None]
        return np.vstack((self.corners.facets[:, facets], self.corners.p.shape[1] + inner))

    @property
    def centroids(self) -> Floats:
        return self.mean(self.points) if self.shape.curved.any() else super().centroids

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        products, offset = super().products_on(facets, weight), self.shape.facet_offset[:, facets]
        curved = np.flatnonzero(offset.any(axis=0))
        if curved.size:
            start, end = self.corners.p[:, self.corners.facets[:, facets[curved]]].swapaxes(0, 1)
            products[:, :, curved] = weight[curved] * curved_products(self.order, end - start, offset[:, curved])
        return products

    def gradient(self, u: Floats) -> Floats:
        local = u[self.unknowns]
        found = [group.gradient(local[:, group.rows]) for group in self._groups]
        return np.concatenate([each.reshape(2, -1) for each in found], axis=1)

    @cached_property
    def fine_rule(self) -> tuple[Ints, Floats, Floats]:
        """Elements (n,), barycentric coordinates (3, n) and weights (n,) of a rule.

        It integrates the product of two gradients and two coordinates.
        """
        each = [np.tile(group.barycentric, len(group.weights)) for group in self._groups]
        return self.element, np.concatenate(each, axis=1), self.weights

    def slope_of_corners(self, values: Floats) -> Floats:
        element, barycentric, _ = self.fine_rule
        return np.einsum("in,cin->cn", values[self.corners.t[:, element]], self._hats_at(element, barycentric))

    def _hats_at(self, element: Ints, barycentric: Floats) -> Floats:
        hats, rows = self.hats[:, :, element], np.flatnonzero(self.shape.curved[element])
        if rows.size:
            hats[:, :, rows] = self.shape.hat_gradients(element[rows], barycentric[:, rows])
        return hats

    def mean(self, values: Floats) -> Floats:
        parts = self._groups
        sums = [
            np.sum(group.restrict(values) * group.weights, axis=-1) / np.sum(group.weights, axis=-1) for group in parts
        ]
        return self._by_element(sums)

    def mean_function(self, u: Floats) -> Floats:
        areas = self._by_element([np.sum(group.weights, axis=1) for group in self._groups])
        return np.sum(self._integrals * u[self.unknowns], axis=0) / areas

    def at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        return np.sum(self._functions(element, barycentric)[0] * u[self.unknowns[:, element]], axis=0)

    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        slope = np.einsum("icn,in->cn", self._functions(element, barycentric)[1], u[self.unknowns[:, element]])
        return np.einsum("in,cin->cn", slope, self._hats_at(element, barycentric)[:, 1:])

    def load_at(self, element: Ints, barycentric: Floats, vectors: Floats) -> Floats:
        # Integrals of ``load . grad phi`` equal sums of ``vectors . grad phi`` over points, for every function phi. The
        # load at the quadrature points of an element is the gradient of a function.
        order = np.argsort(element, kind="stable")
        touched, first = np.unique(element[order], return_index=True)
        sums = np.add.reduceat(self._against_vectors(element, barycentric, vectors)[:, order], first, axis=1)
        (place, inside, weight), load = self.fine_rule, np.zeros((2, self.element.size))
        for row, total in zip(touched, sums.T, strict=True):
            points = np.flatnonzero(place == row)
            slopes = self._gradients(place[points], inside[:, points])
            products = np.einsum("icn,jcn,n->ij", slopes, slopes, weight[points], optimize=True)
            load[:, points] = np.einsum("i,icn->cn", np.linalg.lstsq(products, total, rcond=RANK)[0], slopes)
        return load

    def _against_vectors(self, element: Ints, barycentric: Floats, vectors: Floats) -> Floats:
        return np.einsum("icn,cn->in", self._gradients(element, barycentric), vectors)

    def _gradients(self, element: Ints, barycentric: Floats) -> Floats:
        slopes = self._functions(element, barycentric)[1]
        return np.einsum("kin,cin->kcn", slopes, self._hats_at(element, barycentric)[:, 1:])

    def _functions(self, element: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
        """Return values (k, n), and slopes (k, 2, n) by the last two barycentrics."""
        found = [KINDS[self.order]().lbasis(barycentric[1:], i) for i in range(len(self.unknowns))]
        return np.stack([each[0] for each in found]), np.stack([each[1] for each in found])

    def against_functions(self, source: Floats) -> Floats:
        return self._integrals * source

    def against_function(self, source: Floats, u: Floats) -> Floats:
        return self.against_functions(source) * u[self.unknowns]

    def against_gradients(self, flux: Floats) -> Floats:
        return self._by_element([group.against_gradients(flux) for group in self._groups])

    def against_slopes(self, size: Floats) -> Floats:
        return self._by_element([group.against_slopes(size) for group in self._groups])

    def loads(self, source: Floats, flux: Floats) -> Floats:
        return self.assemble_vector(self.against_functions(source) + self.against_gradients(flux))

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced:
        products = self._by_element([group.products(across, along) for group in self._groups])
        row, column = np.broadcast_arrays(self.unknowns[:, None], self.unknowns[None])
        count = self.doflocs.shape[1]
        matrix = coo_array((products.ravel(), (row.ravel(), column.ravel())), shape=(count,) * 2).tocsc()
        return Reduced(matrix[free][:, free])


Elements = Linear | Higher


def curved_products(order: int, chord: Floats, offset: Floats) -> Floats:
    """Return integrals of products along curved facets, (order + 1, order + 1, n).

    `chord` and the midside offset `offset` have shape (2, n).
    """
    (at,), weights = get_quadrature(ElementLineP1, 2 * order + CURVED)
    values = (at[:, None] ** np.arange(order + 1)) @ facet_functions(order)
    length = np.hypot(*(chord[:, :, None] + 4.0 * offset[:, :, None] * (1.0 - 2.0 * at)))
    return np.einsum("qi,qj,nq,q->ijn", values, values, length, weights)
