"""Elements for u = r A around an axis, with functions that fall like r^2 there."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product

import numpy as np
from skfem import ElementLineP1
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.magnetostatics.equations.higher import ElementGroup, Higher
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC
from kohonen_adapt.mesh.basis import (
    KINDS,
    ON_AXIS,
    facet_functions,
    factor_at,
    functions_at,
    kinds_at_axis,
    points_near_axis,
)
from kohonen_adapt.mesh.curved import Isoparametric
from kohonen_adapt.mesh.measures import hat_gradients
from kohonen_adapt.mesh.polynomials import functions_near_axis, slopes_near_axis

__all__ = ["AroundAxis"]

INWARDS = 1e-6  # distance from the axis at which limits on the axis are evaluated, relative to the way to the centroid
FACET = 10  # degree of the rule along facets


@dataclass(frozen=True, eq=False)
class AxisGroup(ElementGroup):
    shape: Isoparametric
    order: int
    kind: int
    law: bool

    @property
    def barycentric(self) -> Floats:
        return points_near_axis(self.order, self.law)[0][self.kind].T

    @cached_property
    def x(self) -> Floats:
        return self._per_element(self.shape.points(*self._all_points))

    @cached_property
    def weights(self) -> Floats:
        (a, b), (c, d) = self._hats[:, 1:]
        return 0.5 * points_near_axis(self.order, self.law)[1][self.kind] / np.abs(a * d - b * c)

    @cached_property
    def values(self) -> Floats:
        functions = functions_near_axis(np.full(self.barycentric.shape[1], self.kind), self.barycentric.T, self.order)
        return (functions @ coefficients_of_values(self.order)[self.kind]).T[:, None]

    @cached_property
    def gradients(self) -> Floats:
        slopes = np.einsum(
            "qfc,fi->iqc", slopes_near_axis(self.kind, self.barycentric.T, self.order), self._coefficients_of_values
        )
        if self._is_curved:
            return np.einsum("iqc,dceq->ideq", slopes, self._hats[:, 1:], optimize=True)
        return np.einsum("iqc,dce->ideq", slopes, self._hats[:, 1:, :, 0], optimize=True)

    @property
    def _coefficients_of_values(self) -> Floats:
        return coefficients_of_values(self.order)[self.kind]

    @cached_property
    def _hats(self) -> Floats:
        """Gradients of the barycentric coordinates at all points, (2, 3, nelements, q)."""
        if self._is_curved:
            return self._per_element(self.shape.hat_gradients(*self._all_points))
        hats = hat_gradients(self.shape.corners)[:, :, self.rows, None]
        return np.broadcast_to(hats, (*hats.shape[:-1], self.barycentric.shape[1]))

    @property
    def _is_curved(self) -> bool:
        return bool(self.shape.curved[self.rows].any())

    @property
    def _all_points(self) -> tuple[Ints, Floats]:
        rows, barycentric = np.asarray(self.rows), self.barycentric
        return np.repeat(rows, barycentric.shape[1]), np.tile(barycentric, rows.size)

    def _per_element(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, self.barycentric.shape[1])


@cache
def coefficients_of_values(order: int) -> Floats:
    """Return the matrices from values to coefficients, (7, functions, unknowns).

    Matrix k belongs to the kind k of `ON_AXIS`. Values on the axis are those of the functions without the factor that
    is 0 there.
    """
    second, third = KINDS[order].doflocs.T
    barycentric, matrices = np.stack([1.0 - second - third, second, third], axis=1), []
    for kind in np.repeat(np.arange(len(ON_AXIS))[:, None], len(barycentric), axis=1):
        is_off_axis = factor_at(kind, barycentric)[:, None] > 1e-9
        functions = np.where(
            is_off_axis, functions_near_axis(kind, barycentric, order), functions_at(barycentric, order)
        )
        matrices.append(np.linalg.inv(functions))
    return np.stack(matrices)


class AroundAxis(Higher):
    """Elements of order 1 to 3 for u = r A in the half-plane x = r >= 0.

    The unknowns are the values of u at scikit-fem's degrees of freedom. u falls like r^2 towards the axis. Therefore
    ``nu |grad u|^2 / r`` is integrated without modification, the energy is an upper bound of the exact one, and
    ``B = (-du/dz, du/dr) / r`` also holds on the axis.
    """

    def _make_groups(self) -> Sequence[ElementGroup]:
        groups, first = list[ElementGroup](), 0
        for kind, law in product(np.unique(self.kind), (False, True)):
            rows = np.flatnonzero((self.kind == kind) & (self.nonlinear == law))
            if rows.size:
                own = slice(first, first + points_near_axis(self.order, law)[1].shape[1] * rows.size)
                groups.append(AxisGroup(rows, own, self.shape, self.order, int(kind), law))
                first = own.stop
        return groups

    @cached_property
    def kind(self) -> Ints:
        return kinds_at_axis(self.corners.p[0, self.corners.t.T])

    def on_facets(self, facets: Ints) -> Ints:
        return self.corners.facets[:, facets] if self.order == 1 else super().on_facets(facets)

    def mean(self, values: Floats) -> Floats:
        # weighted by r, as the volume of a ring is
        return super().mean(values * self.points[0]) / super().mean(self.points[0])

    @property
    def centroids(self) -> Floats:
        return super().mean(self.points)

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        """Return integrals of ``weight phi_i phi_j / r`` over facets, (k, k, nfacets)."""
        (at,), weights = get_quadrature(ElementLineP1, FACET)
        (start, end), offset = (
            self.corners.p[:, self.corners.facets[:, facets]].swapaxes(0, 1),
            self.shape.facet_offset[:, facets],
        )
        points = (1.0 - at) * start[..., None] + at * end[..., None] + 4.0 * offset[..., None] * at * (1.0 - at)
        length = np.hypot(*((end - start)[..., None] + 4.0 * offset[..., None] * (1.0 - 2.0 * at)))
        start_on_axis, end_on_axis = (np.isin(nodes, self._on_axis) for nodes in self.corners.facets[:, facets])
        locations = np.concatenate(([0.0, 1.0], np.arange(1, self.order) / self.order))
        factor, factor_there = (
            1.0 - start_on_axis * (1.0 - t) - end_on_axis * t for t in (at[:, None], locations[:, None])
        )
        values = (at[:, None] ** np.arange(self.order + 1)) @ facet_functions(self.order)
        values = values[:, :, None] * factor[:, None] / np.where(factor_there > 0.0, factor_there, 1.0)
        return np.einsum("qif,qjf,fq,q,f->ijf", values, values, length / points[0], weights, weight)

    @cached_property
    def _on_axis(self) -> Ints:
        return np.unique(self.corners.t[ON_AXIS[self.kind].T])

    def limit_points(self, element: Ints, barycentric: Floats) -> Floats:
        # On the axis B is the limit from inside the element.
        on_axis = factor_at(self.kind[element], barycentric.T) < INWARDS
        return np.where(on_axis, barycentric + INWARDS * (1.0 / 3.0 - barycentric), barycentric)

    def _gradients(self, element: Ints, barycentric: Floats) -> Floats:
        # Functions with values on the axis, where u is 0, have no finite energy.
        off_axis = ~AXISYMMETRIC.on_axis(self.doflocs)[self.unknowns[:, element]]
        return off_axis[:, None] * super()._gradients(element, barycentric)

    def _functions(self, element: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
        kind, points = self.kind[element], barycentric.T
        values, slopes = np.empty((len(self.unknowns), element.size)), np.empty((len(self.unknowns), 2, element.size))
        for value in np.unique(kind):
            rows = np.flatnonzero(kind == value)
            matrix = coefficients_of_values(self.order)[value]
            values[:, rows] = (functions_near_axis(kind[rows], points[rows], self.order) @ matrix).T
            slopes[:, :, rows] = np.einsum(
                "nfc,fi->icn", slopes_near_axis(int(value), points[rows], self.order), matrix
            )
        return values, slopes

    def balanced(self, flux: Floats, source: Floats) -> Floats:
        """Return element means of a flux with equal loads, shape (2, nelements).

        `flux` is at the quadrature points, `source` has shape (nelements,). The loads of the means by hat functions
        equal the loads of the flux by the functions of these elements, so that the estimators of order 1 see a balanced
        problem. Edges from the axis are dual to the gradients of the hat functions at their outer ends.
        """
        mean, off_axis = super().mean(flux), np.where(ON_AXIS[self.kind].T, 0.0, 1.0)
        size = self._by_element([group.weights.sum(axis=1) for group in self._groups])
        target = (self.against_gradients(flux) - self.against_functions(source)) / size + source / 3.0
        missing = off_axis * (target - np.einsum("ck,cik->ik", mean, self.hats))
        touching = np.flatnonzero(self.kind)
        corner, off_axis = self.corners.p[:, self.corners.t[:, touching]], off_axis[:, touching]
        projection = np.sum((1.0 - off_axis) * corner, axis=1) / np.sum(1.0 - off_axis, axis=0)
        mean[:, touching] += np.einsum("ik,cik->ck", missing[:, touching], corner - projection[:, None])
        return mean
