"""Elements of order 4 and above, with eliminated interiors and exact arcs."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Self

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.around_axis import AroundAxis
from kohonen_adapt.magnetostatics.equations.elements import Linear
from kohonen_adapt.magnetostatics.equations.higher import ElementGroup, Elements, Higher
from kohonen_adapt.magnetostatics.equations.symmetry import AXISYMMETRIC, Symmetry
from kohonen_adapt.magnetostatics.equations.system import Interiors, Pattern, Reduced, Skeleton
from kohonen_adapt.mesh.blended import Blended, Projections
from kohonen_adapt.mesh.lagrange import functions_and_slopes, lobatto, nodes, rule_about, trace_functions, triangle_rule
from kohonen_adapt.mesh.measures import hat_gradients

__all__ = ["BY_LAGRANGE", "HighOrder", "elements_on", "high_order_elements"]

# Degree of quadrature above 2 p. Straight elements of linear material in the plane need 2 p - 2, and forces 2 p. On
# arcs, around an axis and for laws integrands are no polynomials.
CURVED, AXIS, LAW = 6, 4, 8
BY_LAGRANGE = 3  # highest order with scikit-fem's elements and parabolas, which the polish shares
FACET = 12  # points along facets above the order


class Reference:
    """Functions of one order and kind of element at the points of a rule."""

    def __init__(self, order: int, kind: int, degree: int) -> None:
        self.barycentric, self.weight = rule_about(kind - 1, degree) if kind in (1, 2, 3) else triangle_rule(degree)
        self.values, self.slopes = functions_and_slopes(self.barycentric, order, kind)  # (k, q), (k, 2, q)
        self.upper = np.triu_indices(len(self.values))
        self.index = np.zeros((len(self.values),) * 2, dtype=np.int64)  # of a pair of functions in `upper`
        self.index[self.upper] = self.index[self.upper[::-1]] = np.arange(self.upper[0].size)

    @cached_property
    def products(self) -> Floats:
        # (3 q, pairs), for the entries 00, 01 and 11 of a tensor
        first, second = (self.slopes[rows] for rows in self.upper)
        mixed = first[:, 0] * second[:, 1] + first[:, 1] * second[:, 0]
        return np.concatenate([first[:, 0] * second[:, 0], mixed, first[:, 1] * second[:, 1]], axis=1).T

    @cached_property
    def integrals(self) -> Floats:
        # of the products of slopes over an element of area 1, (3, functions^2)
        pairs = np.einsum("dqp,q->dp", self.products.reshape(3, self.weight.size, -1), self.weight)
        return pairs[:, self.index.ravel()]


@cache
def reference(order: int, kind: int, degree: int) -> Reference:
    return Reference(order, kind, degree)


@dataclass(frozen=True, eq=False)
class ReferenceGroup(ElementGroup):
    """Elements whose functions are evaluated on the reference triangle only."""

    shape: Blended
    at: Reference
    constant: bool  # True if the reluctivity is constant in each element

    @property
    def barycentric(self) -> Floats:
        return self.at.barycentric.T

    @cached_property
    def x(self) -> Floats:
        if self.shape.curved[self.rows].any():
            return self._per_element(self.shape.points(*self._all_points))
        return self.shape.p[:, self.shape.t[:, self.rows].T] @ self.barycentric

    @cached_property
    def weights(self) -> Floats:
        (a, b), (c, d) = self._inverse
        return np.asarray(0.5 * self.at.weight / np.abs(a * d - b * c))

    @property
    def values(self) -> Floats:
        return self.at.values[:, None]

    @property
    def gradients(self) -> Floats:
        return np.einsum("kdq,cdmq->kcmq", self.at.slopes, np.broadcast_to(self._inverse, self._size))

    @cached_property
    def integrals(self) -> Floats:
        return self.at.values @ self.weights.T

    def gradient(self, local: Floats) -> Floats:
        count, points = local.shape[1], self.at.weight.size
        along, aside = (local.T @ self.at.slopes.reshape(len(local), -1)).reshape(count, 2, points).swapaxes(0, 1)
        return np.stack([a * along + b * aside for a, b in self._inverse])

    def against_gradients(self, flux: Floats) -> Floats:
        x, y = self.restrict(flux) * self.weights
        (a, b), (c, d) = self._inverse
        on_reference = np.concatenate([a * x + c * y, b * x + d * y], axis=1)
        return self.at.slopes.reshape(len(self.at.slopes), -1) @ on_reference.T

    def against_slopes(self, size: Floats) -> Floats:
        # The root mean square of the slopes over all directions, which needs no gradient at each point.
        stretch = np.sqrt(0.5 * np.sum(self._inverse**2, axis=(0, 1)))
        return np.hypot(self.at.slopes[:, 0], self.at.slopes[:, 1]) @ (self.restrict(size) * self.weights * stretch).T

    def products(self, across: Floats, along: tuple[Floats, Floats] | None) -> Floats:  # (nelements, k, k)
        (a, b), (c, d), count = *self._inverse, len(self.at.values)
        entries = a * a + c * c, a * b + c * d, b * b + d * d
        weight = self.restrict(across) * self.weights
        if along is None and self.constant:
            sums = np.stack([entry[:, 0] * weight.sum(axis=1) for entry in entries], axis=1)
            return (sums @ self.at.integrals).reshape(-1, count, count)
        tensor = [entry * weight for entry in entries]
        if along is not None:
            more, (x, y) = self.restrict(along[0]) * self.weights - weight, self.restrict(along[1])
            first, second = a * x + c * y, b * x + d * y
            for entry, both in zip(tensor, (first * first, first * second, second * second), strict=True):
                entry += more * both
        return (np.concatenate(tensor, axis=1) @ self.at.products)[:, self.at.index]

    @cached_property
    def _inverse(self) -> Floats:
        """Gradients of the last two barycentric coordinates, (2, 2, nelements, q or 1)."""
        if self.shape.curved[self.rows].any():
            found = self._per_element(self.shape.hat_gradients(*self._all_points))[:, 1:]
            check_orientation(np.asarray(self.rows), found)
            return found
        return hat_gradients(self.shape.corners)[:, 1:, self.rows, None]

    @property
    def _size(self) -> tuple[int, int, int, int]:
        return 2, 2, *self.weights.shape

    @property
    def _all_points(self) -> tuple[Ints, Floats]:
        rows, barycentric = np.asarray(self.rows), self.barycentric
        return np.repeat(rows, barycentric.shape[1]), np.tile(barycentric, rows.size)

    def _per_element(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, self.at.weight.size)


def check_orientation(rows: Ints, gradients: Floats) -> None:
    (a, b), (c, d) = gradients
    sign = np.sign(a * d - b * c)
    folded = rows[np.any(sign != sign[:, :1], axis=1)]
    if folded.size:
        raise ValueError(
            f"arcs must not fold elements of order 4 and above; they fold {folded.size}, first element {folded[0]}. "
            "Refine the mesh at its curves, or use an order from 1 to 3."
        )


class HighOrder(Higher):
    """Elements of any order with values at `lagrange.nodes`.

    Unknowns are numbered as by scikit-fem: values at nodes, then on facets from the lower node, then inside elements.
    The unknowns inside elements are eliminated from the equations. Sides are arcs as in `Blended`.
    """

    shape: Blended
    skeleton: Skeleton

    def __init__(
        self,
        mesh: MeshTri,
        order: int,
        nonlinear: Mask,
        sides: Projections | None = None,
        other: "HighOrder | None" = None,
    ) -> None:
        self.sides, self._other = sides, other
        self._known: tuple[Ints, tuple[Ints, Pattern]] | None = None  # by the free unknowns
        super().__init__(mesh, order, nonlinear)
        self.skeleton = other.skeleton if other else Skeleton(self.corners)

    def at_order(self, order: int) -> Self:
        return type(self)(self.mesh, order, self.nonlinear, self.sides, self)

    def _shape_of(self, mesh: MeshTri) -> Blended:
        return self._other.shape if self._other else Blended(mesh, self.sides)

    def _numbering(self) -> tuple[Ints, Floats]:
        shape, order, at = self.shape, self.order, nodes(self.order)
        mesh = shape.corners
        (nnodes, nfacets), nelements = (mesh.p.shape[1], mesh.facets.shape[1]), mesh.t.shape[1]
        on_side, inside = np.arange(order - 1)[:, None], at[3 * order :]
        on_sides = [nnodes + (order - 1) * facet + on_side for facet in mesh.t2f]
        first, own = nnodes + (order - 1) * nfacets, np.arange(len(inside))[:, None]
        unknowns = np.vstack([mesh.t, *on_sides, first + len(inside) * np.arange(nelements) + own])
        x, _ = shape.facet_points(np.arange(nfacets), lobatto(order)[1:-1])
        element, share = np.repeat(np.arange(nelements), len(inside)), np.tile(inside.T, nelements)
        return unknowns, np.hstack([mesh.p, x.reshape(2, -1), shape.points(element, share)])

    @cached_property
    def kind(self) -> Ints:
        return np.zeros(self.corners.t.shape[1], dtype=np.int64)

    def _make_groups(self) -> Sequence[ElementGroup]:
        groups, first = list[ElementGroup](), 0
        for kind, curved, law in product(np.unique(self.kind).tolist(), (False, True), (False, True)):
            rows = np.flatnonzero((self.kind == kind) & (self.shape.curved == curved) & (self.nonlinear == law))
            if rows.size:
                at = reference(self.order, kind, 2 * self.order + self._additional_degree(curved, law))
                own = slice(first, first + at.weight.size * rows.size)
                groups.append(ReferenceGroup(rows, own, self.shape, at, self._is_constant(curved, law)))
                first = own.stop
        return groups

    def _additional_degree(self, curved: bool, law: bool) -> int:
        return LAW if law else CURVED if curved else 0

    def _is_constant(self, curved: bool, law: bool) -> bool:
        return not (curved or law)

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        at, of_point = _facet_rule(self.order)
        x, tangent = self.shape.facet_points(facets, at)
        size = np.hypot(*tangent) * of_point * self._weight_at(x) * weight[:, None]
        values = self._traces(facets, at)
        return np.einsum("fqi,fqj,fq->ijf", values, values, size, optimize=True)

    def _weight_at(self, x: Floats) -> Floats:
        return np.ones(x.shape[1:])

    def _traces(self, facets: Ints, at: Floats) -> Floats:
        return np.broadcast_to(trace_functions(at, self.order), (len(facets), at.size, self.order + 1))

    def _functions(self, element: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
        kind, count = self.kind[element], len(self.unknowns)
        values, slopes = np.empty((count, element.size)), np.empty((count, 2, element.size))
        for one in np.unique(kind).tolist():
            rows = np.flatnonzero(kind == one)
            values[:, rows], slopes[:, :, rows] = functions_and_slopes(barycentric[:, rows].T, self.order, one)
        return values, slopes

    def at_nodes(self, u: Floats, order: int) -> Floats:
        values = np.empty((len(nodes(order)), self.kind.size))
        for kind in np.unique(self.kind).tolist():
            rows = np.flatnonzero(self.kind == kind)
            functions, _ = functions_and_slopes(nodes(order), self.order, kind)
            values[:, rows] = functions.T @ u[self.unknowns[:, rows]]
        return values

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced:
        products, outside = self._products(across, along), 3 * self.order
        number, pattern = self._pattern(free)
        inverse = np.asarray(np.linalg.inv(products[:, outside:, outside:]), dtype=np.float64)
        coupling = inverse @ products[:, outside:, :outside]
        condensed = products[:, :outside, :outside] - products[:, :outside, outside:] @ coupling
        interiors = Interiors(number[self.unknowns[outside:]].T, pattern.outer, inverse, coupling)
        return Reduced(pattern.matrix(condensed), interiors, pattern.rows)

    def _products(self, across: Floats, along: tuple[Floats, Floats] | None) -> Floats:
        found = [group.products(across, along) for group in self._groups]
        if len(found) == 1:
            return found[0]
        whole = np.empty((self.unknowns.shape[1], *found[0].shape[1:]))
        for group, values in zip(self._groups, found, strict=True):
            whole[group.rows] = values
        return whole

    def _pattern(self, free: Ints) -> tuple[Ints, Pattern]:
        if self._known is None or self._known[0] is not free:
            number = np.full(self.doflocs.shape[1], -1)
            number[free] = np.arange(free.size)
            self._known = free, (number, self.skeleton.pattern(self.order, number))
        return self._known[1]


class HighOrderAroundAxis(HighOrder, AroundAxis):
    """Elements of order 4 and above for u = r A around an axis."""

    kind = AroundAxis.kind

    def _additional_degree(self, curved: bool, law: bool) -> int:
        return LAW if law else CURVED if curved else AXIS

    def _is_constant(self, curved: bool, law: bool) -> bool:
        return False

    def _weight_at(self, x: Floats) -> Floats:
        return np.asarray(1.0 / x[0])

    def _traces(self, facets: Ints, at: Floats) -> Floats:
        start_on_axis, end_on_axis = (np.isin(ends, self._on_axis) for ends in self.corners.facets[:, facets])
        there = lobatto(self.order)[[0, self.order, *range(1, self.order)]]
        factor, factor_there = (1.0 - np.outer(start_on_axis, 1.0 - t) - np.outer(end_on_axis, t) for t in (at, there))
        ratio = factor[:, :, None] / np.where(factor_there > 0.0, factor_there, 1.0)[:, None]
        return ratio * trace_functions(at, self.order)


@cache
def _facet_rule(order: int) -> tuple[Floats, Floats]:
    at, weights = np.polynomial.legendre.leggauss(order + FACET)
    return 0.5 + 0.5 * at, 0.5 * weights


def high_order_elements(
    mesh: MeshTri, order: int, symmetry: Symmetry, nonlinear: Mask, sides: Projections | None
) -> HighOrder:
    return (HighOrderAroundAxis if symmetry is AXISYMMETRIC else HighOrder)(mesh, order, nonlinear, sides)


def elements_on(
    mesh: MeshTri, order: int, symmetry: Symmetry, nonlinear: Mask, sides: Projections | None = None
) -> Elements:
    if order > BY_LAGRANGE:
        return high_order_elements(mesh, order, symmetry, nonlinear, sides)
    if symmetry is AXISYMMETRIC:
        return AroundAxis(mesh, order, nonlinear)
    return Higher(mesh, order, nonlinear) if order > 1 else Linear(mesh)
