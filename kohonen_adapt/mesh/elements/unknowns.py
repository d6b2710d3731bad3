"""Numbers and positions of the unknowns of finite elements."""

from functools import cached_property
from math import comb, factorial
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from skfem import Mesh

from kohonen_adapt.arrays import Floats, FloatsPair, Ints, Mask
from kohonen_adapt.mesh.blended import Blended, Projections
from kohonen_adapt.mesh.curved import Isoparametric, corners_of, is_second_order
from kohonen_adapt.mesh.elements.functions import (
    EQUIDISTANT,
    ON_AXIS,
    inner_order,
    kinds_at_axis,
    nodes,
    parts,
    rank_of,
    reference_functions,
)
from kohonen_adapt.mesh.elements.rules import facet_rule
from kohonen_adapt.mesh.host import edges_around, number_edges, number_facets, remade
from kohonen_adapt.mesh.measures import magnitude

__all__ = ["Unknowns"]

ROUNDING = 1e-9  # of barycentric coordinates of nodes


class Unknowns:
    """Unknowns of finite elements at nodes, see `Space`."""

    def __init__(
        self,
        mesh: Mesh,
        order: int,
        nonlinear: Mask | None = None,
        axis: bool = False,
        sides: Projections | None = None,
        arcs: bool | None = None,
        varies: bool = False,
    ) -> None:
        self._varies = varies
        self.mesh, self.order, self.axis, self.sides, self.dim = mesh, order, axis, sides, len(mesh.p)
        self.arcs = order > EQUIDISTANT if arcs is None else arcs
        self.nonlinear = np.zeros(mesh.nelements, bool) if nonlinear is None else nonlinear
        # scikit-fem sorts the corners of a `MeshTri` and relies on the order.
        if is_second_order(mesh) and not np.array_equal(mesh.t, self.corners.t):
            names = {"boundaries": mesh.boundaries, "subdomains": mesh.subdomains}
            self.mesh = remade(mesh, mesh.doflocs, self.corners.t, **names)

    @cached_property
    def shape(self) -> Any:
        """Map of curved elements, a `CurvedElements`."""
        mesh = corners_of(self.mesh) if self.has_constant_gradients else self.mesh
        return Blended(mesh, self.sides) if self.arcs and self.dim == 2 else Isoparametric(mesh)

    @cached_property
    def corners(self) -> Mesh:
        """The mesh with straight sides."""
        found = self.shape.corners if is_second_order(self.mesh) else self.mesh
        if self.dim == 2:
            number_facets(found)
        return found

    @property
    def has_constant_gradients(self) -> bool:
        return self.order == 1 and not self.axis

    @cached_property
    def curved(self) -> Mask:
        return self.shape.curved if is_second_order(self.mesh) else np.zeros(self.mesh.nelements, bool)

    @cached_property
    def kind(self) -> Ints:
        """Kinds of elements as in `ON_AXIS`, (nelements,)."""
        corners = self.corners
        return kinds_at_axis(corners.p[0, corners.t.T]) if self.axis else np.zeros(corners.nelements, np.int64)

    @cached_property
    def unknowns(self) -> Ints:
        """Unknowns of elements at corners, edges, faces and inside, (k, nelements)."""
        if self.order == 1:
            return self.corners.t
        found = list[Ints]()
        for size, (first, index, inner) in enumerate(self._parts, start=1):
            each = np.arange(inner)[:, None]
            for corners, part in zip(parts(self.dim, size), index, strict=True):
                ascending = inner == 1 or self.dim == 2  # scikit-fem sorts the corners of triangles
                own = each if ascending else inner_order(self.order, size)[rank_of(self.corners.t[list(corners)])].T
                found.append(first + inner * part + own)
        return np.vstack(found)

    @cached_property
    def _parts(self) -> list[tuple[int, Ints, int]]:
        # The first unknown of nodes, edges, faces and the inside of elements as far as unknowns are there, their
        # numbers in elements, and how many unknowns are in each.
        mesh, nelements = self.corners, self.corners.nelements
        each = [(mesh.t, mesh.nvertices)]
        if self.dim == 3 and self.order > 1:
            number_edges(mesh)
            each.append((mesh.t2e, mesh.nedges))
        if self.order >= self.dim:
            number_facets(mesh)
            each.append((mesh.t2f, mesh.nfacets))
        if self.order > self.dim:
            each.append((np.arange(nelements)[None], nelements))
        found, first = [], 0
        for size, (index, number) in enumerate(each):
            inner = comb(self.order - 1, size)
            found.append((first, index, inner))
            first += inner * number
        return found

    @cached_property
    def doflocs(self) -> Floats:
        """Positions of the unknowns, (d, nunknowns)."""
        mesh = self.corners
        if self.order == 1:
            return mesh.p
        owner, at = self._places
        return self.shape.points(owner, at.T)

    @cached_property
    def _places(self) -> tuple[Ints, Floats]:
        # an element of every unknown, and the barycentric coordinates there, (nunknowns, d + 1)
        owner, local = np.empty((2, int(self.unknowns.max()) + 1), np.int64)
        owner[self.unknowns] = np.arange(self.unknowns.shape[1])
        local[self.unknowns] = np.arange(len(self.unknowns))[:, None]
        return owner, nodes(self.order, self.dim, self.arcs)[local]

    def on_facets(self, given: Ints | None = None) -> Ints:
        """Return the unknowns of facets, at corners first, (k, nfacets)."""
        number_facets(self.corners)
        facets = np.arange(self.corners.nfacets) if given is None else given
        around = [self.corners.facets[:, facets]]
        if self.order > 1:
            around += [edges_around(self.corners, facets), np.asarray(facets)[None]]
        found = list[Ints]()
        for index, (first, _, inner) in zip(around[: self.dim], self._parts, strict=False):
            found += [first + inner * part + np.arange(inner)[:, None] for part in index]
        return np.vstack(found)

    def prolongation(self, index: Ints) -> csr_array:
        """Return the functions of order 1 by their values at unknowns.

        `index` (nunknowns,) is the row of an unknown, -1 for others, such as prescribed ones. Columns belong to the
        nodes with a row, in their order.
        """
        owner, value = self._places
        free = index[: self.corners.nvertices] >= 0
        column = np.where(free, np.cumsum(free) - 1, -1)[self.corners.t[:, owner].T]
        used = (index >= 0)[:, None] & (column >= 0) & (value > 0.0)
        row = np.broadcast_to(index[:, None], used.shape)
        shape = np.count_nonzero(index >= 0), np.count_nonzero(free)
        return csr_array((value[used], (row[used], column[used])), shape=shape)

    def stars(self, index: Ints) -> list[Ints]:
        """Return the rows of the unknowns at, on edges at, and on faces at each node.

        `index` is as in `prolongation`. Unknowns inside elements have no rows. A node without rows is left out.
        """
        local, corner = np.nonzero(nodes(self.order, self.dim, self.arcs) > ROUNDING)
        row, node = index[self.unknowns[local]].ravel(), self.corners.t[corner].ravel()
        used, count = row >= 0, np.int64(index.size)
        star, row = np.divmod(np.unique(node[used] * count + row[used]), count)
        return np.split(row, np.flatnonzero(np.diff(star)) + 1)

    def facet_points(self, facets: Ints, barycentric: Floats) -> FloatsPair:
        """Return points of facets at barycentric coordinates (d,), and normals, (d, n).

        The length of a normal is the size of the facet, in space twice its size, if the facet is straight.
        """
        x, tangents = self.shape.facet_points(facets, barycentric[:, None])
        return x[..., 0], _normal(tangents[..., 0])

    def products_on(self, facets: Ints, weight: Floats) -> Floats:
        """Return integrals of ``weight phi_i phi_j`` over facets, (k, k, nfacets).

        Around an axis they have the factor 1 / r.
        """
        count = comb(self.order + self.dim - 1, self.order)
        found = np.zeros((count, count, len(facets)))
        for at, of_point in zip(*facet_rule(self.order, self.dim, self.arcs, self.axis), strict=True):
            x, normal = self.facet_points(facets, at)
            values = self._traces(facets, at)
            size = weight * of_point * magnitude(normal) / factorial(self.dim - 1)
            found += values[:, None] * values * (size / x[0] if self.axis else size)
        return found

    def _traces(self, facets: Ints, at: Floats) -> Floats:
        # the functions of facets at barycentric coordinates (d,), (k, n)
        values = reference_functions(at[None], self.order, spread=self.arcs)[0]
        if not self.axis:
            return values
        on_axis = np.isin(self.corners.facets[:, facets], self.corners.t[ON_AXIS[self.kind].T])
        factor, there = 1.0 - at @ on_axis, 1.0 - nodes(self.order, self.dim - 1, self.arcs) @ on_axis
        return values * factor / np.where(there > 0.0, there, 1.0)


def _normal(tangents: Floats) -> Floats:
    # of tangents (d, d - 1, n)
    if len(tangents) == 3:
        return np.cross(tangents[:, 0], tangents[:, 1], axis=0)
    return np.stack((tangents[1, 0], -tangents[0, 0]))
