"""Integrals over elements, by groups with one quadrature rule."""

from collections.abc import Callable, Iterable
from functools import cache, cached_property
from itertools import product
from typing import NamedTuple, Self

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.mesh.elements.functions import reference_functions
from kohonen_adapt.mesh.elements.rules import Rule, rule_of
from kohonen_adapt.mesh.measures import magnitude

__all__ = ["Form", "Group", "Groups", "check_orientation", "reference", "times"]


class Form(NamedTuple):
    """Properties of the elements of a group."""

    order: int
    dim: int
    arcs: bool = False  # True for spread nodes and arcs as sides
    axis: bool = False
    kind: int = 0  # of elements at an axis, as in `ON_AXIS`
    curved: bool = False
    law: bool = False

    @property
    def varies(self) -> bool:
        """True if coefficients or gradients of coordinates differ between points."""
        return self.law or self.curved or self.axis


class Reference:
    """Functions of a form of elements at the points of its rule."""

    def __init__(self, form: Form, rule: Rule, functions: FloatsPair) -> None:
        self.form = form
        self.barycentric, self.weight = rule  # (q, d + 1), (q,)
        self.values, self.slopes = functions  # (k, q), (k, d, q)

    @cached_property
    def products(self) -> Floats:
        """Products of slopes times weights, (pairs of functions, pairs of coordinates q).

        Pairs are those of upper triangles, by rows. Sums over the points replace the points if nothing varies.
        """
        (i, j), (a, b) = np.triu_indices(len(self.slopes)), np.triu_indices(self.form.dim)
        first, second = self.slopes[i], self.slopes[j]
        mixed = np.where(a == b, 0.0, 1.0)[:, None] * first[:, b] * second[:, a]
        found = (first[:, a] * second[:, b] + mixed) * self.weight
        return found.reshape(len(found), -1) if self.form.varies else found.sum(axis=2)

    @cached_property
    def pair(self) -> Ints:
        """Index of a pair of functions in `products`, (k, k)."""
        upper, found = np.triu_indices(len(self.slopes)), np.empty((len(self.slopes),) * 2, np.int64)
        found[upper] = found[upper[::-1]] = np.arange(upper[0].size)
        return found


@cache
def reference(form: Form) -> Reference:
    rule = rule_of(*form)
    return Reference(form, rule, reference_functions(rule[0], form.order, form.kind, form.arcs))


class Group:
    """Elements of one form. Arrays at points have shape (..., q, m).

    Parameters
    ----------
    at
        Functions at the quadrature points.
    rows
        Indices of the elements.
    first
        Number of quadrature points of the groups before.
    hats : (d, d, q or 1, m)
        Gradients of the last d barycentric coordinates.
    volumes : (q or 1, m)
        Volumes of the elements, in curved elements determinants over d!.
    """

    def __init__(self, at: Reference, rows: Ints | slice, first: int, hats: Floats, volumes: Floats) -> None:
        self.at, self.rows, self.hats, self.volumes = at, rows, hats, volumes
        self.columns = slice(first, first + at.weight.size * volumes.shape[1])

    @cached_property
    def point_volumes(self) -> Floats:
        return self.at.weight[:, None] * self.volumes

    @property
    def element_volumes(self) -> Floats:
        return self.point_volumes.sum(axis=0) if self.at.form.curved else self.volumes[0]

    @property
    def integrals(self) -> Floats:
        return self.at.values @ np.broadcast_to(self.point_volumes, (self.at.weight.size, self.volumes.shape[1]))

    def restrict(self, values: Floats) -> Floats:
        own = values[..., self.columns]
        return own.reshape(*own.shape[:-1], self.at.weight.size, -1)

    def mean(self, values: Floats) -> Floats:
        own = self.restrict(values)
        if self.at.form.curved:
            return np.sum(own * self.point_volumes, axis=-2) / self.element_volumes
        return np.tensordot(own, self.at.weight, (-2, 0))

    def gradient_of_linear(self, local: Floats) -> Floats:
        """Return gradients (d, q, m) of linear functions, from values at corners."""
        found = times(self.hats, (local[1:] - local[0])[:, None])
        return np.broadcast_to(found, (len(found), self.at.weight.size, local.shape[1]))

    def gradient(self, local: Floats) -> Floats:
        """Return gradients (d, q, m) from values at the unknowns (k, m)."""
        return times(self.hats, np.tensordot(self.at.slopes, local, (0, 0)))

    def against_gradients(self, flux: Floats) -> Floats:
        along = times(self.hats.swapaxes(0, 1), self.restrict(flux) * self.point_volumes)
        return np.tensordot(self.at.slopes, along, ((1, 2), (0, 1)))

    def against_slopes(self, size: Floats) -> Floats:
        # The root mean square of the slopes over all directions, which needs no gradient at each point.
        stretch = np.sqrt(np.sum(self.hats**2, axis=(0, 1)) / len(self.hats))
        return magnitude(self.at.slopes.swapaxes(0, 1)) @ (self.restrict(size) * self.point_volumes * stretch)

    def upper_products(self, across: Floats, along: FloatsPair | None) -> Floats:
        """Return the upper triangles of the element matrices, (k (k + 1) / 2, m).

        Arguments are those of `Space.stiffness`.
        """
        return self.at.products @ self._metric(across, along)

    def matrices(self, across: Floats, along: FloatsPair | None) -> Floats:
        """Return the element matrices, (m, k, k)."""
        metric, pair = self._metric(across, along), self.at.pair
        if self.at.form.varies:
            return (metric.T @ self.at.products.T)[:, pair]
        return (metric.T @ self.at.products.T[:, pair.ravel()]).reshape(-1, *pair.shape)

    def _metric(self, across: Floats, along: FloatsPair | None) -> Floats:
        # coefficient times products of the gradients of barycentric coordinates, (pairs of coordinates q or 1, m)
        a, b = np.triu_indices(len(self.hats))
        points = slice(None) if self.at.form.varies else slice(1)  # of a coefficient that is constant in elements
        weight = self.restrict(across)[points] * self.volumes
        metric = np.sum(self.hats[:, a] * self.hats[:, b], axis=0) * weight
        if along is not None and (self.at.form.law or self.at.weight.size == 1):
            more = self.restrict(along[0])[points] * self.volumes - weight
            slope = times(self.hats.swapaxes(0, 1), self.restrict(along[1])[:, points])
            metric += more * slope[a] * slope[b]
        return metric.reshape(-1, metric.shape[-1])


class Groups(list[Group]):
    """All elements by groups. Arrays at quadrature points have shape (..., npoints).

    A group has the first points of all its elements, then the second.
    """

    def __init__(self, groups: Iterable[Group], nelements: int) -> None:
        super().__init__(groups)
        self.nelements = nelements

    @classmethod
    def of(
        cls, form: Form, kind: Ints, curved: Mask, law: Mask, group: Callable[[Form, Ints | slice, int], Group]
    ) -> Self:
        """Return the groups of elements of a mesh.

        `group` makes one from the form, the elements and the number of quadrature points before.
        """
        found = cls([], kind.size)
        for one, is_curved, has_law in product(np.unique(kind).tolist(), (False, True), (False, True)):
            rows = np.flatnonzero((kind == one) & (curved == is_curved) & (law == has_law))
            if rows.size:
                own = form._replace(kind=one, curved=is_curved, law=has_law)
                first = found[-1].columns.stop if found else 0
                found.append(group(own, slice(None) if rows.size == kind.size else rows, first))
        return found

    @cached_property
    def element(self) -> Ints:
        """Element of every quadrature point, (npoints,)."""
        count = np.arange(self.nelements)
        return np.concatenate([np.tile(count[group.rows], group.at.weight.size) for group in self])

    @cached_property
    def weights(self) -> Floats:
        """Volumes that the quadrature points stand for, (npoints,)."""
        return np.concatenate([group.point_volumes.ravel() for group in self])

    @cached_property
    def barycentric(self) -> Floats:
        """Barycentric coordinates of the quadrature points, (d + 1, npoints)."""
        each = [np.repeat(group.at.barycentric.T, group.volumes.shape[1], axis=1) for group in self]
        return np.concatenate(each, axis=1)

    def at_points(self, values: Callable[[Group], Floats]) -> Floats:
        """Return values (d, q, m) of each group as columns, (d, npoints)."""
        found = [values(group) for group in self]
        columns = [each.reshape(len(each), -1) for each in found]
        return columns[0] if len(columns) == 1 else np.concatenate(columns, axis=1)

    def by_element(self, values: Callable[[Group], Floats]) -> Floats:
        """Return values (..., m) of each group for all elements, (..., nelements)."""
        found = [values(group) for group in self]
        if len(found) == 1:
            return found[0]
        whole = np.empty((*found[0].shape[:-1], self.nelements))
        for group, own in zip(self, found, strict=True):
            whole[..., group.rows] = own
        return whole

    def gradient(self, local: Floats) -> Floats:
        """Return gradients (d, npoints) from values at the unknowns (k, nelements)."""
        return self.at_points(lambda group: group.gradient(local[:, group.rows]))

    def against_gradients(self, flux: Floats) -> Floats:
        """Return ``int flux . grad phi``, (k, nelements)."""
        return self.by_element(lambda group: group.against_gradients(flux))

    def matrices(self, across: Floats, along: FloatsPair | None = None) -> Floats:
        """Return the matrices of ``int nu grad phi . grad phi``, (nelements, k, k)."""
        found = [group.matrices(across, along) for group in self]
        if len(found) == 1:
            return found[0]
        whole = np.empty((self.nelements, *found[0].shape[1:]))
        for group, own in zip(self, found, strict=True):
            whole[group.rows] = own
        return whole

    @property
    def integrals(self) -> Floats:
        """Integrals of the functions, (k, nelements)."""
        return self.by_element(lambda group: group.integrals)


def times(matrix: Floats, vector: Floats) -> Floats:
    # (r, c, ...) times (c, ...); far faster than einsum
    return np.stack([sum(entry * part for entry, part in zip(row, vector, strict=True)) for row in matrix])


def check_orientation(rows: Ints, determinants: Floats) -> None:
    """Raise an error if determinants (q, m) of elements have different signs."""
    sign = np.sign(determinants)
    folded = rows[np.any(sign != sign[:1], axis=0)]
    if folded.size:
        raise ValueError(
            f"arcs must not fold elements of order 4 and above; they fold {folded.size}, first element {folded[0]}. "
            "Refine the mesh at its curves, or use an order from 1 to 3."
        )
