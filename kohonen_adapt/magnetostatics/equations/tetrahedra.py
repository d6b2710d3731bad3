"""Integrals of P1 functions over tetrahedra."""

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.materials.coefficients import magnitude
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.measures import area, gradient, hat_gradients, inner_points

__all__ = ["Tetrahedra"]

ENDS = np.transpose(TETRAHEDRON.edges)


class Tetrahedra:
    """P1 elements on tetrahedra, with nodal unknowns and constant gradients.

    Arrays at quadrature points have shape (..., npoints): one point per element, or four if a field varies inside.
    """

    order = 1

    def __init__(self, mesh: MeshTet, varies: bool = False) -> None:
        self.mesh = self.corners = mesh
        self.unknowns, self.doflocs = mesh.t, mesh.p
        count = mesh.t.shape[1]
        corners = mesh.p[:, mesh.t]
        inside = inner_points(corners) if varies else corners.mean(axis=1, keepdims=True)
        self.points: Floats = inside.reshape(3, -1)  # (3, npoints)
        self.element = np.tile(np.arange(count), inside.shape[1])  # (npoints,)

    @cached_property
    def hats(self) -> Floats:
        return hat_gradients(self.mesh)

    @cached_property
    def volumes(self) -> Floats:
        return area(self.mesh)

    @property
    def weights(self) -> Floats:
        return (self.volumes * (self.volumes.size / self.element.size))[self.element]

    def mean(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, self.volumes.size).mean(axis=-2)

    def on_facets(self, facets: Ints) -> Ints:
        return self.mesh.facets[:, facets]

    def gradient(self, u: Floats) -> Floats:
        return gradient(self.mesh, u, self.hats)

    def slope_of_corners(self, values: Floats) -> Floats:
        return self.gradient(values)[:, self.element]

    def against_gradients(self, flux: Floats) -> Floats:
        """Return ``int flux . grad phi`` of every unknown, shape (nnodes,)."""
        return self._assemble_vector(np.einsum("ck,cik->ik", flux * self.volumes, self.hats))

    def against_slopes(self, size: Floats) -> Floats:
        return self._assemble_vector(size * self.volumes * magnitude(self.hats))

    def _assemble_vector(self, terms: Floats) -> Floats:
        return np.bincount(self.unknowns.ravel(), terms.ravel(), self.doflocs.shape[1]).astype(np.float64)

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> csc_array:
        (first, second), across = ENDS, self.volumes * across
        on_diagonal = across * np.einsum("cik,cik->ik", self.hats, self.hats)
        off_diagonal = across * np.einsum("cik,cik->ik", self.hats[:, first], self.hats[:, second])
        if along is not None:
            more, slope = self.volumes * along[0] - across, np.einsum("ck,cik->ik", along[1], self.hats)
            on_diagonal, off_diagonal = (
                on_diagonal + more * slope**2,
                off_diagonal + more * slope[first] * slope[second],
            )
        index = np.full(self.doflocs.shape[1], -1, dtype=np.int32)
        index[free] = np.arange(free.size)
        start, end = index[self.unknowns[first]], index[self.unknowns[second]]
        inner = (start >= 0) & (end >= 0)
        inner_values, start, end, diagonal = off_diagonal[inner], start[inner], end[inner], index[free]
        values = np.concatenate((inner_values, inner_values, self._assemble_vector(on_diagonal)[free]))
        indices = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
        return coo_array((values, indices), shape=(free.size, free.size)).tocsc()
