"""Quadratic elements for planar problems: their energy functional, gradient and Hessian, by quadrature."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array
from skfem import Basis, ElementTriP2, MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.conditions import Conditions
from kohonen_adapt.magnetostatics.equations.symmetry import PLANAR
from kohonen_adapt.magnetostatics.materials.coefficients import Coefficients, Piece

__all__ = ["Quadratic", "repeated"]

INTEGRATED = 4  # degree that the quadrature integrates exactly: nu |grad u|^2 needs 2 where nu is constant


@dataclass(frozen=True)
class Quadratic:
    """``Pi(u) = int (int H . dB) - J A`` of P2 functions on one mesh, as `Nonlinear` is of P1 ones.

    Unknowns are the values at the nodes and then at the middles of the facets. What is at quadrature points has them
    in its last axis, all q of an element together: (..., nelements * q).
    """

    mesh: MeshTri
    given: Coefficients
    conditions: Conditions

    @cached_property
    def basis(self) -> Basis:
        """The elements, by scikit-fem."""
        return Basis(self.mesh, ElementTriP2(), intorder=INTEGRATED)

    @cached_property
    def unknowns(self) -> Ints:
        """Numbers of the unknowns of every element, (6, nelements)."""
        return self.basis.element_dofs

    @cached_property
    def gradients(self) -> Floats:
        """Of the six functions of every element, (6, 2, nelements, q)."""
        return np.stack([np.asarray(function[0].grad) for function in self.basis.basis])

    @cached_property
    def weights(self) -> Floats:
        """Of the quadrature points, (nelements, q): areas of an element in sum."""
        return self.basis.dx

    @cached_property
    def _everywhere(self) -> Coefficients:
        return repeated(self.given, self.weights.shape[1])

    @cached_property
    def _integrals(self) -> Floats:
        """Of the six functions of every element, (6, nelements)."""
        values = np.stack([np.broadcast_to(np.asarray(each[0]), self.weights.shape) for each in self.basis.basis])
        return np.einsum("ikq,kq->ik", values, self.weights)

    @property
    def _load(self) -> Floats:
        """``int J phi``, (6, nelements)."""
        return self._integrals * self.given.current_density

    def loads(self, density: Floats) -> Floats:
        """``int density phi`` of every unknown, for a density (nelements,)."""
        load = (self._integrals * density).ravel()
        return np.bincount(self.unknowns.ravel(), load, self.conditions.values.size).astype(np.float64)

    def flux_density(self, u: Floats) -> Floats:
        """B at the quadrature points, (2, nelements * q)."""
        gradient = np.einsum("ik,ickq->ckq", u[self.unknowns], self.gradients)
        return PLANAR.flux_density(self.mesh, gradient.reshape(2, -1))

    def mean(self, values: Floats) -> Floats:
        """The mean over every element, (..., nelements), of what is at the quadrature points."""
        apart = values.reshape(*values.shape[:-1], *self.weights.shape)
        return np.sum(apart * self.weights, axis=-1) / np.sum(self.weights, axis=-1)

    def value(self, u: Floats) -> tuple[float, float]:
        """The functional, and the size of its rounding error."""
        stored = self.weights.ravel() * self._everywhere.energy_density(self.flux_density(u))
        spent = self._load * u[self.unknowns]
        robin = 0.0 if self.conditions.robin is None else 0.5 * float(u @ (self.conditions.robin @ u))
        rounding = np.finfo(float).eps * (float(np.sum(stored)) + float(np.sum(np.abs(spent))) + robin)
        return float(np.sum(stored) - np.sum(spent)) + robin, rounding

    def residual(self, u: Floats) -> tuple[Floats, float]:
        """Gradient at the free unknowns, (nfree,), and the norm of the sums of the sizes of its terms."""
        density, shape = self.flux_density(u), self.weights.shape
        flux = PLANAR.flux(self._everywhere.field_strength(density)).reshape(2, *shape) * self.weights
        largest = self._everywhere.largest_terms(density).reshape(shape) * self.weights
        terms = np.einsum("ckq,ickq->ik", flux, self.gradients)
        sizes = np.einsum("kq,ikq->ik", largest, np.hypot(self.gradients[:, 0], self.gradients[:, 1]))
        place, count = self.unknowns.ravel(), u.size
        total = np.bincount(place, (terms - self._load).ravel(), count).astype(np.float64)
        size = np.bincount(place, (sizes + np.abs(self._load)).ravel(), count)
        if self.conditions.robin is not None:
            total = total + self.conditions.robin @ u
        return total[self.conditions.free], float(np.linalg.norm(size))

    def hessian(self, u: Floats) -> csc_array:
        """Second derivatives at the free unknowns."""
        shape, density = self.weights.shape, self.flux_density(u)
        across, along = (each.reshape(shape) * self.weights for each in self._everywhere.reluctivities(density))
        slope = PLANAR.flux(density)
        slope = (slope / np.maximum(np.hypot(*slope), np.finfo(float).tiny)).reshape(2, *shape)
        along_slope = np.einsum("ckq,ickq->ikq", slope, self.gradients)
        products = np.einsum("ickq,kq,jckq->ijk", self.gradients, across, self.gradients, optimize=True)
        products += np.einsum("ikq,kq,jkq->ijk", along_slope, along - across, along_slope, optimize=True)
        row, column = np.broadcast_arrays(self.unknowns[:, None], self.unknowns[None])
        matrix = coo_array((products.ravel(), (row.ravel(), column.ravel())), shape=(u.size,) * 2).tocsc()
        return matrix[self.conditions.free][:, self.conditions.free]


def repeated(given: Coefficients, times: int) -> Coefficients:
    """The same for `times` points in every element, those of an element together."""
    names = ("number", "reluctivity", "remanence", "coercivity", "current_density")
    pieces = [Piece(each.law, (each.elements[:, None] * times + np.arange(times)).ravel()) for each in given.pieces]
    arrays = {name: np.repeat(getattr(given, name), times, axis=-1) for name in names}
    return replace(given, **arrays, pieces=tuple(pieces))
