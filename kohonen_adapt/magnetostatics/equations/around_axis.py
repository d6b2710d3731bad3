"""Take u = r A around an axis r = 0, by functions of order 1 to 3 that fall like r squared there."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product

import numpy as np
from skfem import ElementLineP1, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.elements import Linear
from kohonen_adapt.magnetostatics.equations.higher import Elements, Higher, Part
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, Symmetry
from kohonen_adapt.mesh.isoparametric import Isoparametric
from kohonen_adapt.mesh.measures import hat_gradients
from kohonen_adapt.mesh.near_axis import ON_AXIS, factor_at, kinds_at_axis, points_near_axis
from kohonen_adapt.mesh.polynomials import (
    KINDS,
    facet_functions,
    functions_at,
    functions_near_axis,
    slopes_near_axis,
)

__all__ = ["AroundAxis", "elements_on"]

INWARDS = 1e-6  # of the way to the middle: so far inside an element is what counts as its limit on the axis
FACET = 10  # degree of the rule along facets


@dataclass(frozen=True, eq=False)
class PartAroundAxis(Part):
    """Elements with the same corners on the axis, all with a law or all without one."""

    shape: Isoparametric
    order: int
    kind: int
    law: bool

    @property
    def share(self) -> Floats:
        return points_near_axis(self.order, self.law)[0][self.kind].T

    @cached_property
    def x(self) -> Floats:
        return self._everywhere(self.shape.points(*self._all_points))

    @cached_property
    def weights(self) -> Floats:
        (a, b), (c, d) = self._hats[:, 1:]
        return 0.5 * points_near_axis(self.order, self.law)[1][self.kind] / np.abs(a * d - b * c)

    @cached_property
    def values(self) -> Floats:
        own = functions_near_axis(np.full(self.share.shape[1], self.kind), self.share.T, self.order)
        return (own @ from_values(self.order)[self.kind]).T[:, None]

    @cached_property
    def gradients(self) -> Floats:
        slopes = np.einsum("qfc,fi->iqc", slopes_near_axis(self.kind, self.share.T, self.order), self._from_values)
        if self._bent:
            return np.einsum("iqc,dceq->ideq", slopes, self._hats[:, 1:], optimize=True)
        return np.einsum("iqc,dce->ideq", slopes, self._hats[:, 1:, :, 0], optimize=True)

    @property
    def _from_values(self) -> Floats:
        return from_values(self.order)[self.kind]

    @cached_property
    def _hats(self) -> Floats:
        """Gradients of the barycentric coordinates at all points, (2, 3, nelements, q)."""
        if self._bent:
            return self._everywhere(self.shape.hats(*self._all_points))
        hats = hat_gradients(self.shape.corners)[:, :, self.rows, None]
        return np.broadcast_to(hats, (*hats.shape[:-1], self.share.shape[1]))

    @property
    def _bent(self) -> bool:
        """Whether any of the elements has a curved side."""
        return bool(self.shape.curved[self.rows].any())

    @property
    def _all_points(self) -> tuple[Ints, Floats]:
        """The element of every point, and the barycentric coordinates there, those of an element together."""
        rows, share = np.asarray(self.rows), self.share
        return np.repeat(rows, share.shape[1]), np.tile(share, rows.size)

    def _everywhere(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, self.share.shape[1])


@cache
def from_values(order: int) -> Floats:
    """The coefficients of the functions of `Reference` that have values at scikit-fem's places, by kind of element.

    (7, functions, unknowns). Values on the axis are those of the functions without the factor that is 0 there.
    """
    second, third = KINDS[order].doflocs.T
    share, found = np.stack([1.0 - second - third, second, third], axis=1), []
    for kind in np.repeat(np.arange(len(ON_AXIS))[:, None], len(share), axis=1):
        off = factor_at(kind, share)[:, None] > 1e-9
        own = np.where(off, functions_near_axis(kind, share, order), functions_at(share, order))
        found.append(np.linalg.inv(own))
    return np.stack(found)


class AroundAxis(Higher):
    """Functions u = r A of order 1 to 3 in the half-plane x = r >= 0, as of `Ritz` with ``axisymmetric=True``.

    The unknowns are the values of u at the places of scikit-fem's elements. u falls like r^2 at the axis, as it has to,
    so that ``nu |grad u|^2 / r`` is integrated as it is, the energy is an upper bound of the exact one, and
    ``B = (-du/dz, du/dr) / r`` is right on the axis, too.
    """

    def _parts_of(self, bent: MeshTri) -> Sequence[Part]:
        parts, first = list[Part](), 0
        for kind, law in product(np.unique(self.kind), (False, True)):
            rows = np.flatnonzero((self.kind == kind) & (self.lawful == law))
            if rows.size:
                own = slice(first, first + points_near_axis(self.order, law)[1].shape[1] * rows.size)
                parts.append(PartAroundAxis(rows, own, self.shape, self.order, int(kind), law))
                first = own.stop
        return parts

    @cached_property
    def kind(self) -> Ints:
        """The corners of every element that are on the axis, (nelements,): see `ON_AXIS`."""
        return kinds_at_axis(self.corners.p[0, self.corners.t.T])

    def on_facets(self, facets: Ints) -> Ints:
        return self.corners.facets[:, facets] if self.order == 1 else super().on_facets(facets)

    def mean(self, values: Floats) -> Floats:
        """The mean over the volume of every ring, (..., nelements), of what is at the quadrature points."""
        return super().mean(values * self.points[0]) / super().mean(self.points[0])

    @property
    def middles(self) -> Floats:
        return super().mean(self.points)

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        """Integrals over facets of a weight (nfacets,) over r and the products of their functions, (k, k, nfacets)."""
        (at,), weights = get_quadrature(ElementLineP1, FACET)
        (start, end), off = self.corners.p[:, self.corners.facets[:, facets]].swapaxes(0, 1), self.shape.off[:, facets]
        there = (1.0 - at) * start[..., None] + at * end[..., None] + 4.0 * off[..., None] * at * (1.0 - at)
        length = np.hypot(*((end - start)[..., None] + 4.0 * off[..., None] * (1.0 - 2.0 * at)))
        begins, ends = (np.isin(nodes, self._on_axis) for nodes in self.corners.facets[:, facets])
        places = np.concatenate(([0.0, 1.0], np.arange(1, self.order) / self.order))
        factor, own = (1.0 - begins * (1.0 - t) - ends * t for t in (at[:, None], places[:, None]))
        values = (at[:, None] ** np.arange(self.order + 1)) @ facet_functions(self.order)
        values = values[:, :, None] * factor[:, None] / np.where(own > 0.0, own, 1.0)
        return np.einsum("qif,qjf,fq,q,f->ijf", values, values, length / there[0], weights, weight)

    @cached_property
    def _on_axis(self) -> Ints:
        """The nodes on the axis."""
        return np.unique(self.corners.t[ON_AXIS[self.kind].T])

    def inside(self, element: Ints, share: Floats) -> Floats:
        """The same points, those on the axis a little way off it, where B of this element is what it tends to."""
        on = factor_at(self.kind[element], share.T) < INWARDS
        return np.where(on, share + INWARDS * (1.0 / 3.0 - share), share)

    def _functions(self, element: Ints, share: Floats) -> tuple[Floats, Floats]:
        kind, turned = self.kind[element], share.T
        values, slopes = np.empty((len(self.unknowns), element.size)), np.empty((len(self.unknowns), 2, element.size))
        for each in np.unique(kind):
            rows = np.flatnonzero(kind == each)
            own = from_values(self.order)[each]
            values[:, rows] = (functions_near_axis(kind[rows], turned[rows], self.order) @ own).T
            slopes[:, :, rows] = np.einsum("nfc,fi->icn", slopes_near_axis(int(each), turned[rows], self.order), own)
        return values, slopes

    def balanced(self, flux: Floats, source: Floats) -> Floats:
        """Means of a flux over the elements, (2, nelements), with the loads by hat functions that it has by these.

        So the estimators of order 1 find balanced what is, for a flux at the quadrature points and a source
        (nelements,). Edges from the axis are dual to the gradients of the hats at their other ends.
        """
        mean, off = super().mean(flux), np.where(ON_AXIS[self.kind].T, 0.0, 1.0)
        size = self._by_element([part.weights.sum(axis=1) for part in self._parts])
        wanted = (self.against_gradients(flux) - self.against_functions(source)) / size + source / 3.0
        missing = off * (wanted - np.einsum("ck,cik->ik", mean, self.hats))
        touching = np.flatnonzero(self.kind)
        corner, off = self.corners.p[:, self.corners.t[:, touching]], off[:, touching]
        foot = np.sum((1.0 - off) * corner, axis=1) / np.sum(1.0 - off, axis=0)
        mean[:, touching] += np.einsum("ik,cik->ck", missing[:, touching], corner - foot[:, None])
        return mean


def elements_on(mesh: MeshTri, order: int, symmetry: Symmetry, lawful: Mask) -> Elements:
    """Return the elements of that order on a mesh, of which these have a B-H law, (nelements,)."""
    if symmetry is AXISYMMETRIC:
        return AroundAxis(mesh, order, lawful)
    return Higher(mesh, order, lawful) if order > 1 else Linear(mesh)
