"""Functions of separate elements by hierarchical coefficients, as of the kernels."""

from functools import cache, cached_property
from math import factorial

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import CELLS
from kohonen_adapt.mesh.curved import tangent_corners
from kohonen_adapt.mesh.elements.functions import kinds_at_axis, near_axis
from kohonen_adapt.mesh.elements.groups import Form, Group, Groups, Reference
from kohonen_adapt.mesh.elements.rules import LAW_DEGREE, rule_of, triangle_rule

__all__ = ["ElementFunctions"]


@cache
def _reference(form: Form) -> Reference:
    # Without a law the rules of straight elements are exact for products of gradients and for the functions. Elements
    # with curved sides have the points of elements at an axis.
    in_plane = form.dim == 2
    if in_plane and form.order > 1 and not form.axis and not form.curved:
        rule = triangle_rule(LAW_DEGREE[form.order] if form.law else 2 * (form.order - 1))
    else:
        rule = rule_of(*form._replace(axis=in_plane and (form.axis or form.curved), curved=not in_plane))
    return Reference(form, rule, near_axis(rule[0], form.order, form.kind))


class ElementFunctions(Groups):
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
        count = corners.shape[2]
        super().__init__([], count)
        self.corners, self.dim = corners, len(corners)
        self.offset: Floats = np.zeros(0) if offset is None else offset
        curved = np.zeros(count, bool) if offset is None else np.any(offset, axis=(0, 1))
        kind = kinds_at_axis(corners[0].T) if axis else np.zeros(count, np.int64)
        law = np.logical_and(law, order > 1 or axis)  # otherwise gradients are constant, and one point suffices
        self.extend(Groups.of(Form(order, self.dim, axis=axis), kind, curved, law, self._group))

    def _group(self, form: Form, rows: Ints | slice, first: int) -> Group:
        at, cell = _reference(form), CELLS[self.dim]
        corner = self.corners[:, :, None, rows]
        if form.curved:
            corner = tangent_corners(corner, self.offset[:, :, None, rows], at.barycentric.T[:, :, None])
        volumes = np.abs(cell.determinant(corner)) / factorial(self.dim)
        return Group(at, rows, first, cell.hat_gradients(corner)[:, 1:], volumes)

    @cached_property
    def points(self) -> Floats:
        """Quadrature points, (d, npoints)."""
        return self.at_points(self.points_of)

    def points_of(self, group: Group) -> Floats:
        """Return the quadrature points of a group, (d, q, m)."""
        at = group.at.barycentric
        x = np.einsum("qi,cim->cqm", at, self.corners[:, :, group.rows])
        if group.at.form.curved:
            a, b = np.transpose(CELLS[self.dim].edges)
            x += np.einsum("qk,ckm->cqm", 4.0 * at[:, a] * at[:, b], self.offset[:, :, group.rows])
        return x
