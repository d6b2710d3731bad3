"""Integrals of linear functions over triangles and tetrahedra."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from skfem import Mesh, MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.system import Reduced
from kohonen_adapt.mesh.curved import Isoparametric
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients, magnitude

__all__ = ["FiniteElements", "Linear", "LinearFunctions", "Polynomials"]


class FiniteElements(ABC):
    mesh: Mesh
    corners: Mesh  # the mesh with straight sides
    unknowns: Ints  # (k, nelements)
    doflocs: Floats  # (d, nunknowns): positions of the unknowns

    @abstractmethod
    def on_facets(self, facets: Ints) -> Ints:
        """Return the unknowns of facets, at corners first, shape (m, nfacets)."""

    @cached_property
    def hats(self) -> Floats:
        return hat_gradients(self.corners)

    def assemble_vector(self, terms: Floats) -> Floats:
        return np.bincount(self.unknowns.ravel(), terms.ravel(), self.doflocs.shape[1]).astype(np.float64)


class Polynomials(FiniteElements):
    """Functions that are polynomials of one degree in every element.

    Curved elements are isoparametric. Arrays at quadrature points have shape (..., npoints), with the points of an
    element in succession; of order 1 there is one point per element.
    """

    order: int
    facet_products: Floats  # integrals of products of the functions on a straight facet, per length, as in `on_facets`
    element: Ints  # (npoints,): element of every quadrature point

    def __init__(self, mesh: MeshTri, shape: Isoparametric, unknowns: Ints, doflocs: Floats) -> None:
        self.mesh, self.shape, self.corners = mesh, shape, shape.corners
        self.unknowns, self.doflocs = unknowns, doflocs

    @property
    def centroids(self) -> Floats:
        return self.corners.p[:, self.corners.t].mean(axis=1)

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        """Return integrals of ``weight phi_i phi_j`` over facets, (k, k, nfacets)."""
        start, end = self.corners.p[:, self.corners.facets[:, facets]].swapaxes(0, 1)
        return self.facet_products[:, :, None] * (weight * np.hypot(*(end - start)))

    def slope_of_corners(self, values: Floats) -> Floats:
        """Return gradients at the quadrature points from nodal values, (2, npoints).

        The values are linear in barycentric coordinates.
        """
        return gradient(self.corners, values)[:, self.element]

    def limit_points(self, element: Ints, barycentric: Floats) -> Floats:
        return barycentric

    def balanced(self, flux: Floats, source: Floats) -> Floats:
        return flux


class LinearFunctions(FiniteElements):
    edges: tuple[Any, Any]  # corners at the first and the second end of the edges of an element

    @cached_property
    def volumes(self) -> Floats:
        return area(self.mesh)

    def on_facets(self, facets: Ints) -> Ints:
        return self.mesh.facets[:, facets]

    def gradient(self, u: Floats) -> Floats:
        return gradient(self.mesh, u, self.hats)

    def against_gradients(self, flux: Floats) -> Floats:
        """Return ``int flux . grad phi`` of every corner, shape (d + 1, nelements)."""
        return np.einsum("ck,cik->ik", flux * self.volumes, self.hats)

    def against_slopes(self, size: Floats) -> Floats:
        return size * self.volumes * magnitude(self.hats)

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced:
        """Return the matrix of ``int nu grad phi . grad phi`` of the free unknowns.

        `across` is nu at the quadrature points. `along` is a second coefficient and the unit vectors, shape (d,
        npoints), in whose direction it applies.
        """
        hats, (first, second), across = self.hats, self.edges, self.volumes * across
        on_diagonal = across * np.einsum("cik,cik->ik", hats, hats)
        off_diagonal = across * np.einsum("cik,cik->ik", hats[:, first], hats[:, second])
        if along is not None:
            more, slope = self.volumes * along[0] - across, np.einsum("ck,cik->ik", along[1], hats)
            on_diagonal = on_diagonal + more * slope**2
            off_diagonal = off_diagonal + more * slope[first] * slope[second]
        index = np.full(self.doflocs.shape[1], -1, dtype=np.int32)
        index[free] = np.arange(free.size)
        # Symmetric: off-diagonal products are computed once, and diagonal terms are summed before the assembly.
        start, end = index[self.unknowns[first]], index[self.unknowns[second]]
        inner = (start >= 0) & (end >= 0)
        inner_values, start, end, diagonal = off_diagonal[inner], start[inner], end[inner], index[free]
        values = np.concatenate((inner_values, inner_values, self.assemble_vector(on_diagonal)[free]))
        indices = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
        return Reduced(coo_array((values, indices), shape=(free.size, free.size)).tocsc())


class Linear(LinearFunctions, Polynomials):
    order, edges = 1, (slice(None), [1, 2, 0])
    facet_products = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0

    def __init__(self, mesh: MeshTri) -> None:
        super().__init__(mesh, Isoparametric(mesh), mesh.t, mesh.p)
        self.element = np.arange(mesh.t.shape[1])

    @property
    def fine_rule(self) -> tuple[Ints, Floats, Floats]:
        barycentric = np.array([[0.5, 0.0, 0.5], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5]])
        return np.repeat(self.element, 3), np.tile(barycentric, self.element.size), np.repeat(self.weights / 3.0, 3)

    @cached_property
    def points(self) -> Floats:
        return self.mesh.p[:, self.mesh.t].mean(axis=1)

    @property
    def weights(self) -> Floats:
        return self.volumes

    def at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        return np.sum(barycentric * u[self.unknowns[:, element]], axis=0)

    def mean(self, values: Floats) -> Floats:
        return values

    def mean_function(self, u: Floats) -> Floats:
        return u[self.unknowns].mean(axis=0)

    def against_functions(self, source: Floats) -> Floats:
        """Return ``int source phi``, equal for each corner of an element, (nelements,)."""
        return self.weights * source / 3.0

    def against_function(self, source: Floats, u: Floats) -> Floats:
        return self.against_functions(source) * np.sum(u[self.unknowns], axis=0)

    def load_at(self, element: Ints, barycentric: Floats, vectors: Floats) -> Floats:
        sums = np.stack([np.bincount(element, each, self.volumes.size) for each in vectors])
        return sums / self.volumes

    def loads(self, source: Floats, flux: Floats) -> Floats:
        """Return ``int source phi + flux . grad phi`` of every unknown.

        `source` has shape (nelements,), `flux` is at the quadrature points.
        """
        return self.assemble_vector(self.weights * (source / 3.0 + np.einsum("ck,cik->ik", flux, self.hats)))
