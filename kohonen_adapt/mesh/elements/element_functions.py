"""Functions of separate elements by hierarchical coefficients, as of the kernels."""

from collections.abc import Sequence
from functools import cache, cached_property
from itertools import product
from math import factorial

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.elements.functions import kinds_at_axis, near_axis
from kohonen_adapt.mesh.elements.groups import Form, Group, Reference
from kohonen_adapt.mesh.elements.rules import (
    CURVED_RULE_IN_SPACE,
    LAW_DEGREE,
    LAW_RULE_IN_SPACE,
    Rule,
    points_near_axis,
    triangle_rule,
)
from kohonen_adapt.mesh.measures import EDGES

__all__ = ["ElementFunctions"]

ENDS = {2: np.array([AFTER, BEFORE]), 3: EDGES}  # corners of the sides or edges of midside offsets, by dimension


def _rule_of(form: Form) -> Rule:
    # Without a law the rules of straight elements are exact for products of gradients and for the functions.
    if form.dim == 3 and form.order > 1:
        return LAW_RULE_IN_SPACE if form.law else CURVED_RULE_IN_SPACE
    if form.axis or form.curved:
        points, weights = points_near_axis(form.order, form.law)
        return points[form.kind], weights[form.kind]
    if form.order == 1:
        return np.full((1, form.dim + 1), 1.0 / (form.dim + 1)), np.ones(1)
    return triangle_rule(LAW_DEGREE[form.order] if form.law else 2 * (form.order - 1))


@cache
def _reference(form: Form) -> Reference:
    rule = _rule_of(form)
    return Reference(form, rule, near_axis(rule[0], form.order, form.kind))


class ElementFunctions:
    """Functions of one order on separate elements.

    Coefficients have shape (k, m), arrays at quadrature points (..., npoints) as in `Space`.

    Parameters
    ----------
    corners : (d, d + 1, m)
    order
        1 to 3 in the plane, 1 or 2 in space.
    law : (m,)
        Elements with a law, which have quadrature rules of their own.
    offset : (d, sides, m)
        Midside offsets, in the plane of the sides opposite to the corners, in space of the edges of scikit-fem. None
        for straight elements.
    axis
        True for functions around the axis x = 0.
    """

    def __init__(
        self, corners: Floats, order: int, law: Mask, offset: Floats | None = None, axis: bool = False
    ) -> None:
        self.corners, self.dim = corners, len(corners)
        self.offset: Floats = np.zeros(0) if offset is None else offset
        count = corners.shape[2]
        curved = np.zeros(count, dtype=np.bool_) if offset is None else offset.any(axis=(0, 1))
        kind = kinds_at_axis(corners[0].T) if axis else np.zeros(count, dtype=np.int64)
        kinds = np.unique(kind).tolist() if axis else [0]
        law = law & (order > 1 or axis)  # otherwise gradients are constant, and one point suffices
        self.groups, first = list[Group](), 0
        for one_kind, is_curved, has_law in product(kinds, (False, True), (False, True)):
            rows = np.flatnonzero((kind == one_kind) & (curved == is_curved) & (law == has_law))
            if rows.size:
                at = _reference(Form(order, self.dim, False, axis, one_kind, is_curved, has_law))
                own = slice(None) if rows.size == count else rows
                corner = corners[:, :, None, own]
                if is_curved:
                    corner = self._tangent_corners(at.barycentric, own)
                volumes = np.abs(CELLS[self.dim].determinant(corner)) / factorial(self.dim)
                self.groups.append(Group(at, own, first, CELLS[self.dim].hat_gradients(corner)[:, 1:], volumes))
                first = self.groups[-1].columns.stop

    def _tangent_corners(self, barycentric: Floats, rows: Ints | slice) -> Floats:
        # Corners of the straight elements with the Jacobian matrices at points (q, d + 1), (d, d + 1, q, m).
        found = np.repeat(self.corners[:, :, None, rows], len(barycentric), axis=2)
        for k, (a, b) in enumerate(ENDS[self.dim].T):
            offset = 4.0 * self.offset[:, k][:, None, rows]
            found[:, a] += barycentric[:, b, None] * offset
            found[:, b] += barycentric[:, a, None] * offset
        return found

    @cached_property
    def element(self) -> Ints:
        """Element of every quadrature point, (npoints,)."""
        count = np.arange(self.corners.shape[2])
        return np.concatenate([np.tile(count[group.rows], group.at.weight.size) for group in self.groups])

    @cached_property
    def weights(self) -> Floats:
        """Volumes that the quadrature points stand for, (npoints,)."""
        return np.concatenate([group.point_volumes.ravel() for group in self.groups])

    @cached_property
    def points(self) -> Floats:
        """Quadrature points, (d, npoints)."""
        found = [self.points_of(group).reshape(self.dim, -1) for group in self.groups]
        return np.concatenate(found, axis=1)

    def points_of(self, group: Group) -> Floats:
        """Return the quadrature points of a group, (d, q, m)."""
        at = group.at.barycentric
        x = np.einsum("qi,cim->cqm", at, self.corners[:, :, group.rows])
        if group.at.form.curved:
            a, b = ENDS[self.dim]
            x += np.einsum("qk,ckm->cqm", 4.0 * at[:, a] * at[:, b], self.offset[:, :, group.rows])
        return x

    def by_element(self, found: Sequence[Floats]) -> Floats:
        if len(found) == 1:
            return found[0]
        whole = np.empty((*found[0].shape[:-1], self.corners.shape[2]))
        for group, values in zip(self.groups, found, strict=True):
            whole[..., group.rows] = values
        return whole

    @property
    def integrals(self) -> Floats:
        """Integrals of the functions, (k, m)."""
        return self.by_element([group.integrals for group in self.groups])

    def gradient(self, coefficients: Floats) -> Floats:
        """Return gradients at the quadrature points, (d, npoints)."""
        found = [group.gradient(coefficients[:, group.rows]).reshape(self.dim, -1) for group in self.groups]
        return found[0] if len(found) == 1 else np.concatenate(found, axis=1)

    def against_gradients(self, flux: Floats) -> Floats:
        """Return ``int flux . grad phi``, (k, m), of a flux at the quadrature points."""
        return self.by_element([group.against_gradients(flux) for group in self.groups])

    def matrices(self, across: Floats) -> Floats:
        """Return the matrices of ``int nu grad phi . grad phi``, (m, k, k)."""
        found = [group.matrices(across, None) for group in self.groups]
        return np.moveaxis(self.by_element([np.moveaxis(each, 0, 2) for each in found]), 2, 0)
