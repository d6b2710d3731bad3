"""Integrals of functions of order 1 and 2 on tetrahedra."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.magnetostatics.equations.elements import FiniteElements, LinearFunctions
from kohonen_adapt.magnetostatics.equations.groups_of_tetrahedra import EDGES, METRIC, PAIRS, Group, groups_of
from kohonen_adapt.magnetostatics.equations.system import Reduced
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.host import edges_between, number_edges
from kohonen_adapt.mesh.measures import CurvedTetrahedra, area, inner_points, magnitude

__all__ = ["EDGES", "LinearTetrahedra", "QuadraticTetrahedra", "Tetrahedra", "tetrahedra_on"]

FACE_EDGES = np.array([(0, 1), (1, 2), (0, 2)]).T
CHUNK = 1 << 14  # elements whose products are computed at once


class Tetrahedra(FiniteElements):
    """Functions of one order on tetrahedra.

    Arrays at quadrature points have shape (..., npoints). `gradient` may have fewer columns than points, because
    gradients of order 1 are constant in elements; `gradient_weights` are the volumes of its columns.
    """

    order: int
    mesh: MeshTet
    volumes: Any  # (nelements,)
    element: Ints  # (npoints,): element of every quadrature point
    points: Floats  # (3, npoints)
    weights: Any  # (npoints,): volumes of the quadrature points
    gradient_weights: Any

    @abstractmethod
    def gradient(self, u: Floats) -> Floats: ...

    @abstractmethod
    def gradient_at_points(self, u: Floats) -> Floats: ...

    @abstractmethod
    def mean(self, values: Floats) -> Floats: ...

    # of an element, or of a face, at barycentric coordinates (4, ...) or (3, ...)
    @abstractmethod
    def functions(self, barycentric: Floats) -> Floats: ...

    @abstractmethod
    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats: ...

    # The next two return (k, nelements), for arguments as `gradient`.
    @abstractmethod
    def against_gradients(self, flux: Floats) -> Floats: ...

    @abstractmethod
    def against_slopes(self, size: Floats) -> Floats: ...

    @abstractmethod
    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced: ...

    def at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        return np.sum(self.functions(barycentric) * u[self.unknowns[:, element]], axis=0)

    def barycentric(self, x: Floats, element: Ints) -> Floats:
        middle = self.mesh.p[:, self.mesh.t[:, element]].mean(axis=1)
        return 0.25 + np.einsum("cin,cn->in", self.hats[:, :, element], x - middle)

    def load_at(self, x: Floats, element: Ints, vectors: Floats) -> Floats:
        # as `Higher.load_at`: the projection of the vectors onto linear functions, which gradients are
        moments = self.barycentric(x, element)[:, None] * vectors
        sums = np.stack([np.bincount(element, each, self.volumes.size) for each in moments.reshape(12, -1)])
        sums = sums.reshape(4, 3, -1)
        nodal = 20.0 / self.volumes * (sums - 0.2 * sums.sum(axis=0))
        return np.einsum("in,icn->cn", self.barycentric(self.points, self.element), nodal[:, :, self.element])

    @property
    def hats_of_corners(self) -> Floats | None:
        # `hats` at every corner, (4, 3, 4, nelements), if an element is curved
        return None

    def located(self, x: Floats, straight: Ints) -> Ints:
        # elements of points, -1 outside, from the straight elements around them
        return straight

    def hats_at(self, element: Ints, barycentric: Floats) -> Floats:
        # gradients of the barycentric coordinates at points, (3, 4, n)
        return self.hats[:, :, element]

    def slope_of_corners(self, values: Floats) -> Floats:
        return np.einsum("ik,cik->ck", values[self.mesh.t], self.hats)[:, self.element]

    def slope_of_corners_at(self, values: Floats, element: Ints, x: Floats) -> Floats:
        hats = self.hats_at(element, self.barycentric(x, element))
        return np.einsum("in,cin->cn", values[self.mesh.t[:, element]], hats)

    def facet_points(self, facets: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
        # points (3, n) at coordinates (3,) of facets, and normals whose length is twice the area per reference area
        corners = self.mesh.p[:, self.mesh.facets[:, facets]]
        return np.einsum("i,cin->cn", barycentric, corners), normals(self.mesh.p.T, self.mesh.facets[:, facets].T).T


class LinearTetrahedra(LinearFunctions, Tetrahedra):
    # one quadrature point, or four if a field varies inside
    order, edges = 1, tuple(EDGES)

    def __init__(self, mesh: MeshTet, varies: bool = False) -> None:
        self.mesh = self.corners = mesh
        self.unknowns, self.doflocs = mesh.t, mesh.p
        corners = mesh.p[:, mesh.t]
        inside = inner_points(corners) if varies else corners.mean(axis=1, keepdims=True)
        self.points = inside.reshape(3, -1)
        self.element = np.tile(np.arange(mesh.t.shape[1]), inside.shape[1])

    @property
    def gradient_weights(self) -> Floats:
        return self.volumes

    @property
    def weights(self) -> Floats:
        return (self.volumes * (self.volumes.size / self.element.size))[self.element]

    def mean(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, self.volumes.size).mean(axis=-2)

    def gradient_at_points(self, u: Floats) -> Floats:
        return self.gradient(u)[:, self.element]

    def functions(self, barycentric: Floats) -> Floats:
        return barycentric

    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        return self.gradient(u)[:, element]


class QuadraticTetrahedra(Tetrahedra):
    # the unknowns of `skfem.ElementTetP2`, nodes before edges; curved elements are isoparametric
    order = 2

    def __init__(self, mesh: MeshTet, nonlinear: Mask) -> None:
        self.shape = CurvedTetrahedra(mesh)
        self.mesh = self.corners = mesh = self.shape.corners
        number_edges(mesh)
        self.unknowns = np.vstack((mesh.t, mesh.p.shape[1] + mesh.t2e))
        self.doflocs = np.hstack((mesh.p, mesh.p[:, mesh.edges].mean(axis=1) + self.shape.edge_offset))
        self.volumes = area(mesh)
        self._groups = groups_of(nonlinear, self.shape, self.hats, self.volumes)
        for group in self._groups:
            if group.curved:
                self.volumes[group.rows] = group.point_volumes.sum(axis=0)
        corners = mesh.p[:, mesh.t]
        self.points, self.weights, self.element = (
            np.concatenate(parts, axis=-1)
            for parts in zip(*((
                self._points_of(each, corners[:, :, each.rows]),
                each.point_volumes.ravel(),
                np.tile(each.rows, each.weights.size),
            ) for each in self._groups), strict=True)
        )  # fmt: skip

    def _points_of(self, group: Group, corners: Floats) -> Floats:
        if group.curved:
            at = np.repeat(group.barycentric.T, group.rows.size, axis=1)
            return self.shape.points(np.tile(group.rows, group.weights.size), at)
        return np.einsum("qi,cim->cqm", group.barycentric, corners).reshape(3, -1)

    @property
    def gradient_weights(self) -> Floats:
        return self.weights

    def on_facets(self, facets: Ints) -> Ints:
        corners = np.sort(self.mesh.facets[:, facets], axis=0)
        edges = edges_between(self.mesh, *corners[FACE_EDGES])
        return np.vstack((corners, self.mesh.p.shape[1] + edges))

    def gradient(self, u: Floats) -> Floats:
        local, found = u[self.unknowns], []
        for group in self._groups:
            along = np.tensordot(group.slopes, local[:, group.rows], (1, 0))
            found.append(np.einsum(f"qam,{group.axes}->cqm", along, group.hats).reshape(3, -1))
        return np.concatenate(found, axis=1)

    def slope_of_corners(self, values: Floats) -> Floats:
        found, local = super().slope_of_corners(values), values[self.mesh.t]
        for group in self._groups:
            if group.curved:
                found[:, group.columns] = np.einsum("am,caqm->cqm", local[:, group.rows], group.hats).reshape(3, -1)
        return found

    def located(self, x: Floats, straight: Ints) -> Ints:
        return self.shape.locate(x, straight)[0] if self.shape.curved.any() else straight

    def barycentric(self, x: Floats, element: Ints) -> Floats:
        found, rows = super().barycentric(x, element), np.flatnonzero(self.shape.curved[element])
        found[:, rows] = self.shape.barycentric_coordinates(element[rows], x[:, rows])
        return found

    @property
    def hats_of_corners(self) -> Floats | None:
        count = self.volumes.size
        if not self.shape.curved.any():
            return None
        return np.stack([self.hats_at(np.arange(count), np.tile(at[:, None], count)) for at in np.eye(4)])

    def hats_at(self, element: Ints, barycentric: Floats) -> Floats:
        found, rows = self.hats[:, :, element], np.flatnonzero(self.shape.curved[element])
        found[:, :, rows] = self.shape.hat_gradients(element[rows], barycentric[:, rows])
        return found

    def facet_points(self, facets: Ints, barycentric: Floats) -> tuple[Floats, Floats]:
        x, normal = super().facet_points(facets, barycentric)
        corner, edge = np.split(self.on_facets(facets), 2)
        offset = self.shape.edge_offset[:, edge - self.mesh.p.shape[1]]
        rows, tangent = np.flatnonzero(offset.any(axis=(0, 1))), self.mesh.p[:, corner]
        for k, (a, b) in enumerate(FACE_EDGES.T):
            x[:, rows] += 4.0 * barycentric[a] * barycentric[b] * offset[:, k, rows]
            tangent[:, a] += 4.0 * barycentric[b] * offset[:, k]
            tangent[:, b] += 4.0 * barycentric[a] * offset[:, k]
        one, other = tangent[:, 1:, rows].swapaxes(0, 1) - tangent[:, 0, rows]
        normal[:, rows] = np.cross(one, other, axis=0)
        return x, normal

    def gradient_at_points(self, u: Floats) -> Floats:
        return self.gradient(u)

    def mean(self, values: Floats) -> Floats:
        return self._by_element(
            [
                np.sum(group.restrict(values) * group.point_volumes, axis=-2) / self.volumes[group.rows]
                if group.curved
                else np.tensordot(group.restrict(values), group.weights, (-2, 0))
                for group in self._groups
            ]
        )

    def functions(self, barycentric: Floats) -> Floats:
        start, end = EDGES if len(barycentric) == 4 else FACE_EDGES
        return np.vstack((barycentric * (2.0 * barycentric - 1.0), 4.0 * barycentric[start] * barycentric[end]))

    def gradient_at(self, u: Floats, element: Ints, barycentric: Floats) -> Floats:
        local, (start, end), nodes = u[self.unknowns[:, element]], EDGES, slice(4)
        along = (4.0 * barycentric - 1.0) * local[nodes]
        for row, one, other in zip(local[4:], start, end, strict=True):
            along[one] += 4.0 * barycentric[other] * row
            along[other] += 4.0 * barycentric[one] * row
        return np.einsum("in,cin->cn", along, self.hats_at(element, barycentric))

    def against_gradients(self, flux: Floats) -> Floats:
        found = []
        for group in self._groups:
            weighted = group.restrict(flux * self.weights)
            along = np.einsum(f"cqm,{group.axes}->qam", weighted, group.hats)
            found.append(np.tensordot(group.slopes, along, ((0, 2), (0, 1))))
        return self._by_element(found)

    def against_slopes(self, size: Floats) -> Floats:
        found = []
        for group in self._groups:
            lengths = magnitude(group.hats)
            along = group.restrict(size * self.weights)[:, None] * (lengths.swapaxes(0, 1) if group.curved else lengths)
            found.append(np.tensordot(np.abs(group.slopes), along, ((0, 2), (0, 1))))
        return self._by_element(found)

    def stiffness(self, across: Floats, free: Ints, along: tuple[Floats, Floats] | None = None) -> Reduced:
        index = np.full(self.doflocs.shape[1], -1, dtype=np.int32)
        index[free] = np.arange(free.size)
        products, (i, j) = self._products(across, along), PAIRS
        on_diagonal = np.bincount(self.unknowns.ravel(), products[i == j].ravel(), index.size)[free]
        start, end = index[self.unknowns[i[i != j]]], index[self.unknowns[j[i != j]]]
        inner = (start >= 0) & (end >= 0)
        values, start, end, diagonal = products[i != j][inner], start[inner], end[inner], index[free]
        values = np.concatenate((values, values, on_diagonal))
        indices = np.concatenate((start, end, diagonal)), np.concatenate((end, start, diagonal))
        matrix = coo_array((values, indices), shape=(free.size, free.size)).tocsc()
        return Reduced(matrix, prolongation=self._from_corners(index))

    def _products(self, across: Floats, along: tuple[Floats, Floats] | None) -> Floats:
        found, (a, b) = [], METRIC
        for group in self._groups:
            count = group.weights.size if group.has_law or group.curved else 1
            reference, own = group.products.reshape(len(PAIRS[0]), -1), np.empty((len(PAIRS[0]), group.rows.size))
            coefficient = group.restrict(across)[:count]
            for first in range(0, group.rows.size, CHUNK):
                part = slice(first, first + CHUNK)
                hats, volume = group.hats[..., part], group.volumes[..., part]
                metric = np.einsum("cp...,cp...->p...", hats[:, a], hats[:, b])
                metric = (metric if group.curved else metric[:, None]) * coefficient[:, part]
                if along is not None and group.has_law:
                    more = group.restrict(along[0])[:, part] - coefficient[:, part]
                    slope = np.einsum(f"cqm,{group.axes}->aqm", group.restrict(along[1])[:, :, part], hats)
                    metric += more * slope[a] * slope[b]
                own[:, part] = reference @ (metric * volume).reshape(reference.shape[1], -1)
            found.append(own)
        return self._by_element(found)

    def _from_corners(self, index: Ints) -> csr_array:
        # (nfree, free nodes): functions of order 1 by their values at the unknowns
        nnodes, (start, end) = self.mesh.p.shape[1], self.mesh.edges
        row = np.concatenate((index[:nnodes], index[nnodes:], index[nnodes:]))
        node = index[np.concatenate((np.arange(nnodes), start, end))]
        value, inner = np.repeat([1.0, 0.5], [nnodes, 2 * start.size]), (row >= 0) & (node >= 0)
        shape = np.count_nonzero(index >= 0), np.count_nonzero(index[:nnodes] >= 0)
        return coo_array((value[inner], (row[inner], node[inner])), shape=shape).tocsr()

    def _by_element(self, found: Sequence[Floats]) -> Floats:
        if len(found) == 1:
            return found[0]
        whole = np.empty((*found[0].shape[:-1], self.volumes.size))
        for group, values in zip(self._groups, found, strict=True):
            whole[..., group.rows] = values
        return whole


def tetrahedra_on(mesh: MeshTet, order: int, varies: bool, nonlinear: Mask) -> Tetrahedra:
    return LinearTetrahedra(mesh, varies) if order == 1 else QuadraticTetrahedra(mesh, nonlinear)
