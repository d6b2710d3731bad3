"""Finite element spaces on triangles and tetrahedra."""

from functools import cached_property
from math import comb, factorial
from typing import Self

import numpy as np

from kohonen_adapt.arrays import Floats, FloatsPair, Ints
from kohonen_adapt.mesh.cells import CELLS, centroids_of
from kohonen_adapt.mesh.curved import all_points
from kohonen_adapt.mesh.elements.assembly import (
    Interiors,
    Pattern,
    Reduced,
    Skeleton,
    Subspaces,
    assembled,
    without_interiors,
)
from kohonen_adapt.mesh.elements.functions import (
    OFF_AXIS,
    ON_AXIS,
    factor_at,
    hierarchical,
    inverse_mass,
    nodes,
    reference_functions,
)
from kohonen_adapt.mesh.elements.groups import Form, Group, Groups, check_orientation, reference, times
from kohonen_adapt.mesh.elements.unknowns import Unknowns
from kohonen_adapt.mesh.host import summed
from kohonen_adapt.mesh.measures import area, hat_gradients

__all__ = ["Space"]

SHARED = "shape", "corners", "skeleton"  # computed by elements of all orders alike
INWARDS = 1e-6  # distance from the axis at which limits on the axis are evaluated, relative to the way to the centroid
RANK = 1e-12  # relative size of the singular values of constants, which have no gradient

# number of every unknown among the free ones, pattern and subspaces of their matrix
Known = tuple[Ints, Pattern, Subspaces | None]


class Space(Unknowns):
    """Functions with values at nodes as unknowns.

    Up to order 3 sides are parabolas, and the unknowns those of scikit-fem. With `arcs` sides are arcs as in `Blended`,
    unknowns are at Gauss-Lobatto points, and those inside elements are eliminated from the equations. Around an axis,
    for u = r A in the half-plane x = r >= 0, functions fall like r^2 towards the axis. Therefore ``nu |grad u|^2 / r``
    is integrated without modification, the energy is an upper bound of the exact one, and ``B = (-du/dz, du/dr) / r``
    also holds on the axis.

    Arrays at quadrature points have shape (..., npoints). A group of elements with one rule has the first points of all
    its elements, then the second.

    Parameters
    ----------
    mesh, order
        A mesh and the order of the polynomials.
    nonlinear : (nelements,)
        Elements with a B-H law, which have quadrature rules of their own.
    axis
        True for functions around the axis x = 0.
    sides
        Projections onto the curves of boundaries by name, for `arcs`.
    arcs
        None for the default of the order.
    varies
        True if fields vary inside tetrahedra of order 1: these have four points, and one column in `gradient`.
    """

    _known: tuple[Ints, Known] | None = None  # by the free unknowns

    def at_order(self, order: int) -> Self:
        found = type(self)(self.mesh, order, self.nonlinear, self.axis, self.sides, self.arcs)
        shared = SHARED[found.has_constant_gradients != self.has_constant_gradients :]
        vars(found).update({name: vars(self)[name] for name in shared if name in vars(self)})
        return found

    # quadrature

    @cached_property
    def hats(self) -> Floats:
        """Gradients of barycentric coordinates if straight, (d, d + 1, nelements)."""
        return hat_gradients(self.corners)

    @cached_property
    def groups(self) -> Groups:
        law = self.nonlinear & (not self.has_constant_gradients)
        return Groups.of(Form(self.order, self.dim, self.arcs, self.axis), self.kind, self.curved, law, self._group)

    def _group(self, form: Form, rows: Ints | slice, first: int) -> Group:
        at = reference(form)
        if not form.curved:
            return Group(at, rows, first, self.hats[:, 1:, None, rows], self._straight_volumes[None, rows])
        element = np.arange(self.curved.size)[rows]
        hats = self.shape.hats_in(element, at.barycentric)[:, 1:]
        determinants = CELLS[self.dim].determinant(np.concatenate([np.zeros_like(hats[:, :1]), hats], axis=1))
        if self.arcs:
            check_orientation(element, determinants)
        return Group(at, rows, first, hats, np.abs(1.0 / determinants) / factorial(self.dim))

    @cached_property
    def _straight_volumes(self) -> Floats:
        return area(self.corners)

    @cached_property
    def _sampled(self) -> Groups:
        # groups with the points at which fields are evaluated
        if not self._varies or not self.has_constant_gradients:
            return self.groups
        return Groups([self._group(Form(1, self.dim, law=True), slice(None), 0)], self.kind.size)

    @cached_property
    def volumes(self) -> Floats:
        return self.groups.by_element(lambda group: group.element_volumes)

    @property
    def element(self) -> Ints:
        """Element of every quadrature point, (npoints,)."""
        return self._sampled.element

    @property
    def weights(self) -> Floats:
        """Volumes that the quadrature points stand for, (npoints,)."""
        return self._sampled.weights

    @property
    def gradient_weights(self) -> Floats:
        """Volumes of the columns of `gradient`."""
        return self.volumes if self.has_constant_gradients else self.weights

    @cached_property
    def points(self) -> Floats:
        """Quadrature points, (d, npoints)."""
        return self._sampled.at_points(self._points_of)

    def _points_of(self, group: Group) -> Floats:
        at, elements = group.at.barycentric, np.arange(self.kind.size)[group.rows]
        if group.at.form.curved:
            return self.shape.points(*all_points(elements, at)).reshape(self.dim, len(at), -1)
        return at @ self.corners.p[:, self.corners.t[:, group.rows]]

    @property
    def barycentric_of_points(self) -> Floats:
        """Barycentric coordinates of the quadrature points, (d + 1, npoints)."""
        return self._sampled.barycentric

    @property
    def centroids(self) -> Floats:
        corners = self.corners
        return self.plain_mean(self.points) if self.curved.any() else centroids_of(corners)

    def plain_mean(self, values: Floats) -> Floats:
        """Return means over elements in the plane, of values at the quadrature points."""
        return self._sampled.by_element(lambda group: group.mean(values))

    def mean(self, values: Floats) -> Floats:
        # around an axis weighted by r, as the volume of a ring is
        return (
            self.plain_mean(values * self.points[0]) / self.plain_mean(self.points[0])
            if self.axis
            else self.plain_mean(values)
        )

    def mean_function(self, u: Floats) -> Floats:
        return np.sum(self.integrals * u[self.unknowns], axis=0) / self.volumes

    # integrals

    @cached_property
    def integrals(self) -> Floats:
        """Integrals of the functions, (k, nelements)."""
        return self.groups.integrals

    def gradient(self, u: Floats) -> Floats:
        """Return gradients at the quadrature points, if constant of elements."""
        return self.groups.gradient(u[self.unknowns])

    def gradient_at_points(self, u: Floats) -> Floats:
        return self._sampled.gradient(u[self.unknowns])

    def slope_of_corners(self, values: Floats) -> Floats:
        """Return gradients at the quadrature points from nodal values, (d, npoints).

        The values are linear in barycentric coordinates.
        """
        local = values[self.corners.t]
        return self._sampled.at_points(lambda group: group.gradient_of_linear(local[:, group.rows]))

    def against_functions(self, source: Floats) -> Floats:
        """Return ``int source phi``, (k, nelements), of a source by element."""
        return self.integrals * source

    def against_gradients(self, flux: Floats) -> Floats:
        """Return ``int flux . grad phi``, (k, nelements), of columns as in `gradient`."""
        return self.groups.against_gradients(flux)

    def against_slopes(self, size: Floats) -> Floats:
        return self.groups.by_element(lambda group: group.against_slopes(size))

    def assemble_vector(self, terms: Floats) -> Floats:
        return summed(self.unknowns, terms, self.doflocs.shape[1])

    def loads(self, source: Floats, flux: Floats) -> Floats:
        """Return ``int source phi + flux . grad phi`` of every unknown.

        `source` has shape (nelements,), `flux` is at the quadrature points.
        """
        return self.assemble_vector(self.against_functions(source) + self.against_gradients(flux))

    # equations

    def stiffness(self, across: Floats, free: Ints, along: FloatsPair | None = None) -> Reduced:
        """Return the matrix of ``int nu grad phi . grad phi`` of the free unknowns.

        `across` is nu at the columns of `gradient`, constant in straight elements without a law. `along` is a second
        coefficient and the unit vectors, shape (d, npoints), in whose direction it applies in elements with a law.
        """
        if self.arcs:
            return self._without_interiors(across, free, along)
        products = self.groups.by_element(lambda group: group.upper_products(across, along))
        index = np.full(self.doflocs.shape[1], -1, np.int32)
        index[free] = np.arange(free.size)
        matrix = assembled(self.unknowns, products, index, free.size)
        return Reduced(matrix, subspaces=self._subspaces(index))

    def _subspaces(self, index: Ints) -> Subspaces | None:
        if self.dim == 2 or self.order == 1:
            return None
        return Subspaces(self.prolongation(index), self.stars(index) if self.order > 2 else ())

    def _without_interiors(self, across: Floats, free: Ints, along: FloatsPair | None) -> Reduced:
        condensed, inverse, coupling = without_interiors(self.groups.matrices(across, along), self._outside)
        number, pattern, subspaces = self._pattern(free)
        interiors = Interiors(number[self.unknowns[self._outside :]].T, pattern.outer, inverse, coupling)
        return Reduced(pattern.matrix(condensed), interiors, pattern.rows, subspaces)

    @property
    def _outside(self) -> int:
        # number of the unknowns of an element that are not inside
        return len(self.unknowns) - comb(self.order - 1, self.dim)

    @cached_property
    def skeleton(self) -> Skeleton:
        return Skeleton(self.corners)

    def _pattern(self, free: Ints) -> Known:
        if self._known is None or self._known[0] is not free:
            number, index = np.full((2, self.doflocs.shape[1]), -1)
            number[free] = np.arange(free.size)
            pattern = self.skeleton.pattern(self.order, self.unknowns[: self._outside], number)
            index[free[pattern.rows]] = np.arange(pattern.rows.size)
            self._known = free, (number, pattern, self._subspaces(index))
        return self._known[1]

    # values at points

    def functions(self, element: Ints, barycentric: Floats) -> FloatsPair:
        """Return values (k, n) and slopes (k, d, n) of the functions at points."""
        if not self.axis:
            return reference_functions(barycentric.T, self.order, 0, self.arcs)
        count, kind = len(self.unknowns), self.kind[element]
        values, slopes = np.empty((count, kind.size)), np.empty((count, self.dim, kind.size))
        for one in np.unique(kind).tolist():
            rows = np.flatnonzero(kind == one)
            found = reference_functions(barycentric[:, rows].T, self.order, one, self.arcs)
            values[:, rows], slopes[:, :, rows] = found
        return values, slopes

    def at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        return np.sum(self.functions(element, barycentric)[0] * u[self.unknowns[:, element]], axis=0)

    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        slope = np.einsum("icn,in->cn", self.functions(element, barycentric)[1], u[self.unknowns[:, element]])
        return np.einsum("in,cin->cn", slope, self.hats_at(element, barycentric)[:, 1:])

    def hats_at(self, element: Ints, barycentric: Floats) -> Floats:
        """Return the gradients of the barycentric coordinates at points, (d, d + 1, n)."""
        return self.shape.hat_gradients(element, barycentric)

    def in_each(self, u: Floats, at: Floats) -> Floats:
        """Return values (n, nelements) at coordinates (n, d + 1) of every element."""
        return self._sums_in_each(u, at, np.empty((len(at), self.kind.size)), 0)

    def _sums_in_each(self, u: Floats, at: Floats, found: Floats, part: int) -> Floats:
        # of values, the first part of reference functions, or of their slopes, the second
        for kind in np.unique(self.kind).tolist():
            rows = np.flatnonzero(self.kind == kind) if self.axis else slice(None)
            functions = reference_functions(at, self.order, kind, self.arcs)[part]
            found[..., rows] = np.tensordot(functions, u[self.unknowns[:, rows]], (0, 0))
        return found

    def interpolated(self, old: "Space", u: Floats) -> Floats:
        """Return the unknowns of a function in elements of another order."""
        found = np.empty(self.doflocs.shape[1])
        found[self.unknowns] = old.in_each(u, nodes(self.order, self.dim, self.arcs))
        return found

    def gradient_in_each(self, u: Floats, at: Floats) -> Floats:
        """Return gradients at barycentric coordinates (n, d + 1) of every element.

        The shape is (d, n nelements), with the first points of all elements before the second.
        """
        along = self._sums_in_each(u, at, np.empty((self.dim, len(at), self.kind.size)), 1)
        found, rows = times(self.hats[:, 1:, None], along), np.flatnonzero(self.curved)
        if rows.size:
            found[..., rows] = times(self.shape.hats_in(rows, at)[:, 1:], along[..., rows])
        return found.reshape(self.dim, -1)

    def barycentric(self, x: Floats, element: Ints) -> Floats:
        """Return the barycentric coordinates (d + 1, n) of points in elements."""
        return self.shape.barycentric_coordinates(element, x)

    def located(self, x: Floats, straight: Ints) -> Ints:
        """Return the elements of points, -1 outside, from the straight ones."""
        return self.shape.locate(x, straight)[0]

    def slope_of_corners_at(self, values: Floats, element: Ints, x: Floats) -> Floats:
        """Return gradients at points as in `slope_of_corners`, (d, n)."""
        hats = self.hats_at(element, self.barycentric(x, element))
        return np.einsum("in,cin->cn", values[self.corners.t[:, element]], hats)

    def limit_points(self, element: Ints, barycentric: Floats) -> Floats:
        """Return points off the axis for limits on the axis from inside the element."""
        if not self.axis:
            return barycentric
        on_axis = factor_at(self.kind[element], barycentric.T) < INWARDS
        return np.where(on_axis, barycentric + INWARDS * (1.0 / 3.0 - barycentric), barycentric)

    def load_at(self, element: Ints, barycentric: Floats, vectors: Floats) -> Floats:
        """Return a load at the quadrature points from vectors at points.

        ``int load . grad phi`` is the sum of ``vectors . grad phi`` over the points. In an element of the plane the
        load is the gradient of a function, in space the projection of the vectors onto polynomials.
        """
        if self.dim == 3:
            degree = max(1, self.order - 1)
            at_points, inverse = hierarchical(self.barycentric_of_points.T, degree)[0], inverse_mass(degree, self.dim)
            moments = (hierarchical(barycentric.T, degree)[0][:, None] * vectors).reshape(-1, element.size)
            sums = np.stack([np.bincount(element, each, self.volumes.size) for each in moments])
            coefficients = np.tensordot(inverse, sums.reshape(len(inverse), self.dim, -1), 1) / self.volumes
            return np.einsum("in,icn->cn", at_points, coefficients[:, :, self.element])
        order = np.argsort(element, kind="stable")
        touched, first = np.unique(element[order], return_index=True)
        against = np.einsum("icn,cn->in", self._gradients(element, barycentric), vectors)
        sums = np.add.reduceat(against[:, order], first, axis=1)
        load, at = np.zeros((2, self.element.size)), self.barycentric_of_points
        for row, total in zip(touched, sums.T, strict=True):
            points = np.flatnonzero(self.element == row)
            slopes = self._gradients(self.element[points], at[:, points])
            products = np.einsum("icn,jcn,n->ij", slopes, slopes, self.weights[points], optimize=True)
            load[:, points] = np.einsum("i,icn->cn", np.linalg.lstsq(products, total, rcond=RANK)[0], slopes)
        return load

    def _gradients(self, element: Ints, barycentric: Floats) -> Floats:
        # of the functions at points, (k, d, n)
        slopes = self.functions(element, barycentric)[1]
        found = np.einsum("kin,cin->kcn", slopes, self.hats_at(element, barycentric)[:, 1:])
        if self.axis:
            # Functions with values on the axis, where u is 0, have no finite energy.
            at_nodes = nodes(self.order, self.dim, self.arcs)
            factor = np.stack([factor_at(np.array(kind), at_nodes) for kind in range(len(ON_AXIS))], axis=1)
            found *= (factor > OFF_AXIS)[:, None, self.kind[element]]
        return found
